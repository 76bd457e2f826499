"""Offers a link to other programs of this computer, which `log.share` serves once they attach.

The port's owner alone drives, sets and clears. All of it runs in a thread of its own.
"""

from __future__ import annotations

import errno
import os
import select
import socket
import stat
import struct
import threading
import time
import weakref
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import WheelwireError
from . import LazyLogger
from .sharing_folder import SUFFIX, SharingFolder, note_driver, sharing_folder
from .threads import Notifier, WakeUp, abandon_in_child, start_without_waiting

if TYPE_CHECKING:
    from ..log.share.server import AttachedPrograms
    from .connection import Link

COPY_S = 0.02
"""How often records are copied to the listeners."""
LOOK_S = 1.0
"""How often the socket's file and the board's identity are looked at."""
MAX_PROGRAMS = 16
MANY = 32
"""Requests that came together: a program that sends more is given a rest."""
LONGEST_REST_S = 0.02
NAMES = 8
"""Boards with the same identity on one computer: simulated ones."""
CLOSE_TIMEOUT_S = 1.0

_CREDENTIALS = struct.Struct("3i")
_LOG = LazyLogger("wheelwire.share")


class SharingServer:
    """Offers one link, from `start` to its end.

    Args:
        link: A weak reference: attached programs must not keep the robot alive.
    """

    def __init__(self, link: Link) -> None:
        self._link = weakref.ref(link)
        self._wake_up = WakeUp()
        self._changed = Notifier()
        self._finishing = self._has_ended = False
        self._place = _Place()
        self._programs: AttachedPrograms | None = None
        """None before the first program attaches; most links never have one."""
        self._look_s = 0.0
        self._poller = select.poll()
        self._poller.register(self._wake_up, select.POLLIN)
        self._thread = threading.Thread(target=self._run, name="wheelwire share", daemon=True)
        abandon_in_child(self)

    def start(self) -> None:
        """Begin to offer the link. Never waits, and a failure is only logged."""
        start_without_waiting(self._thread, self._give_up)

    def finish(self) -> None:
        """Pass on what is left until the link has ended, and end; without waiting."""
        self._finishing = True
        self._wake_up.wake()

    def close(self) -> None:
        """As `finish`, and wait for it: the link has ended."""
        self.finish()
        if threading.current_thread() is self._thread:
            return
        # As in `Link.close`: not join() alone, which an exception out of a handler may cut short.
        ended = self._changed.wait_for(lambda: self._has_ended, CLOSE_TIMEOUT_S)
        if ended and self._thread.is_alive():
            self._thread.join(CLOSE_TIMEOUT_S)

    def abandon(self) -> None:
        """This process was forked: the parent goes on with what is open."""
        self._place.abandon()
        self._release()

    # --- the thread ----------------------------------------------------------------------------

    def _give_up(self, error: RuntimeError) -> None:
        _LOG.warning("other programs cannot look at this robot: %s", error)
        self._release()

    def _run(self) -> None:
        try:
            while self._work(self._wait()):
                pass
        except Exception:
            # No failure here may become an error in the program that drives.
            _LOG.exception("sharing has failed: other programs cannot look at this robot any more")
        finally:
            self._place.close()
            self._release()

    def _release(self) -> None:
        if self._programs is not None:
            self._programs.close()
        self._wake_up.close()
        self._has_ended = True
        self._changed.notify_all()

    def _wait(self) -> list[int]:
        """Wait until there is something to do; returns the descriptors that have something."""
        now_s, programs = time.monotonic(), self._programs
        wait_s = COPY_S if self._finishing else max(0.0, self._look_s - now_s)
        if programs is not None:
            wait_s = min(wait_s, programs.longest_wait_s(now_s))
        ready = [descriptor for descriptor, _ in self._poller.poll(wait_s * 1000)]
        if self._wake_up.fileno() in ready:
            self._wake_up.drain()
        return ready

    def _work(self, ready: list[int]) -> bool:
        """Do what there is to do; False once the link has ended."""
        link = self._link()
        if link is None:
            return False
        # First: what crosses the link before its end is passed on below.
        has_ended = link.has_ended
        # First of all what was asked: it may be an e-stop.
        begin_s = time.monotonic()
        asked = 0 if self._programs is None else self._programs.read(link, ready)
        now_s = time.monotonic()
        is_second = now_s >= self._look_s
        if is_second:
            self._look_s = now_s + LOOK_S
            self._look(link)
        if self._place.listener is not None and self._place.listener.fileno() in ready:
            self._accept(link, self._place.listener)
        if self._programs is not None:
            self._programs.write(link, with_status=is_second)
        if asked > MANY:
            # The owner's threads share the interpreter with this one, and need it to drive.
            time.sleep(min(LONGEST_REST_S, 2 * (time.monotonic() - begin_s)))
        return not has_ended

    def _look(self, link: Link) -> None:
        """Offer the link under its board's name, again if the file is gone."""
        place, board_id = self._place, link.info.device.board_id
        if link.arms:
            place.note_driver(board_id, link.session_id)
        if place.is_at(board_id):
            return
        if place.listener is not None:
            self._poller.unregister(place.listener)
            place.close()
        place.take(board_id)
        if place.listener is not None:
            self._poller.register(place.listener, select.POLLIN)

    def _accept(self, link: Link, listener: socket.socket) -> None:
        try:
            connection, _ = listener.accept()
        except OSError:  # the other end is gone, or no descriptor is left
            return
        if not self._place.admits(connection):
            connection.close()
            return
        if self._programs is None:
            from ..log.share.server import AttachedPrograms  # here, for most links have none

            self._programs = AttachedPrograms(self._link, self._poller, self._wake_up.wake)
        self._programs.add(connection, link)


def offer(link: Link) -> SharingServer | None:
    """Begin to offer an open link; None if there is no room for it, which is logged."""
    try:
        server = SharingServer(link)
    except OSError as error:
        _LOG.warning("other programs cannot look at this robot: %s", error)
        return None
    server.start()
    return server


class _Place:
    """The socket's file.

    Attributes:
        listener: The socket; None while the link cannot be offered.
    """

    def __init__(self) -> None:
        self.listener: socket.socket | None = None
        self._board_id = ""
        self._directory: SharingFolder | None = None
        self._path = Path()
        self._identity: tuple[int, ...] = ()
        self._problem = ""
        self._session_id = 0

    def is_at(self, board_id: str) -> bool:
        """Whether the link is offered under the name of this board."""
        return self.listener is not None and board_id == self._board_id and self._is_there()

    def note_driver(self, board_id: str, session_id: int) -> None:
        """Remember that this program drives the board; a failure costs that alone."""
        if session_id in (0, self._session_id):
            return
        with suppress(OSError, WheelwireError):
            note_driver(sharing_folder(make=True), board_id, session_id)
        self._session_id = session_id

    def take(self, board_id: str) -> None:
        """Offer the link under the name of this board; a failure is logged."""
        try:
            self._directory = sharing_folder(make=True)
            with self._directory.locked():
                self._bind(board_id, self._directory)
        except (OSError, WheelwireError) as error:
            # Once: it is tried again each second.
            if not self._problem:
                self._problem = str(error)
                _LOG.warning("other programs cannot look at this robot: %s", error)
        else:
            self._board_id, self._problem = board_id, ""

    def _bind(self, board_id: str, directory: SharingFolder) -> None:
        for number in range(1, NAMES + 1):
            suffix = SUFFIX if number == 1 else f"-{number}{SUFFIX}"
            path = directory.path / f"{board_id}{suffix}"
            if _is_taken(path):
                continue
            # Named only once it listens: a program that finds a refusing name takes the robot for
            # free.
            unnamed = path.with_name(f"{path.name}.new")
            unnamed.unlink(missing_ok=True)  # of a program that was killed in here
            listener = socket.socket(socket.AF_UNIX)
            try:
                listener.bind(str(unnamed))
                # Before it listens, so that nobody can connect earlier.
                if directory.group is not None:
                    os.chown(unnamed, -1, directory.group)
                unnamed.chmod(0o600 if directory.group is None else 0o660)
                listener.setblocking(False)
                listener.listen(MAX_PROGRAMS)
                unnamed.rename(path)
            except BaseException:
                listener.close()
                raise
            self.listener, self._path, self._identity = listener, path, _identity(path)
            return
        raise OSError(errno.EADDRINUSE, f"{NAMES} programs offer a board of the same identity")

    def admits(self, connection: socket.socket) -> bool:
        """Whether the program at the other end may use it."""
        if self._directory is not None and self._directory.group is not None:
            return True  # by the mode of the file
        return credentials(connection)[1] in (0, os.getuid())

    def close(self) -> None:
        """Remove the file, unless it is another program's by now."""
        directory = self._directory
        if self.listener is None or directory is None:
            return
        self.abandon()
        # The folder may be gone.
        with suppress(OSError), directory.locked():
            if self._is_there():
                self._path.unlink()

    def abandon(self) -> None:
        """Close the socket, and leave the file."""
        if self.listener is not None:
            self.listener.close()
            self.listener = None

    def _is_there(self) -> bool:
        try:
            return _identity(self._path) == self._identity
        except OSError:
            return False


def _identity(path: Path) -> tuple[int, ...]:
    found = path.lstat()
    # The number of a file that was removed may be given to the next; not at the same moment.
    return found.st_dev, found.st_ino, found.st_mtime_ns


def _is_taken(path: Path) -> bool:
    """Whether a running program has this socket; what a killed one has left is removed."""
    try:
        if not stat.S_ISSOCK(path.lstat().st_mode):
            return True
    except FileNotFoundError:
        return False
    with socket.socket(socket.AF_UNIX) as probe:
        probe.setblocking(False)
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
            return False
        except OSError:  # its queue is full, or it is another user's
            return True
    return True


def credentials(connection: socket.socket) -> tuple[int, int]:
    """Process and user at the other end."""
    data = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    pid, user, _ = _CREDENTIALS.unpack(data)
    return pid, user
