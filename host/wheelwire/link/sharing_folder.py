"""The folder in which a program that holds a port offers it to others of this computer.

Also which programs have driven a robot, so that one that died can be named.
"""

from __future__ import annotations

import fcntl
import grp
import json
import os
import shlex
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from ..errors import ConfigurationError
from ..whole_file import write_whole
from .holds import Program, start_of

DIRECTORY_VARIABLE = "WHEELWIRE_TAP_DIR"
GROUP_VARIABLE = "WHEELWIRE_TAP_GROUP"
SUFFIX = ".tap"
TEMPORARY = "/tmp"  # noqa: S108 - it is only looked into, if it is this user's alone
"""The temporary folder of a program without TMPDIR."""
SESSIONS = "/run/user"
"""Where systemd has the folders that XDG_RUNTIME_DIR names."""


class SharingFolder(NamedTuple):
    """Where the sockets are, and who may use them."""

    path: Path
    group: int | None
    """Its members may use it as well as the owner; None: only the owner."""

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Only one program at a time replaces a socket that is left over."""
        descriptor = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            yield
        finally:
            os.close(descriptor)


def sharing_folder(*, make: bool = False) -> SharingFolder:
    """The sharing folder of the user who runs this.

    Args:
        make: Make it if it is missing.

    Raises:
        ConfigurationError: Others than this user, and the group if one was named, can get into it.
        OSError: It is missing, or cannot be made.
    """
    path, group = _paths()[0], _group()
    if make and not path.is_dir():
        path.mkdir(mode=0o700, exist_ok=True)
        if group is not None:
            os.chown(path, -1, group)
            path.chmod(0o750)
    return _checked(path, group)


def sharing_folders() -> list[SharingFolder]:
    """All folders in which a program may offer its port to this user.

    A service, or a program that cron or ssh has started, commonly has no XDG_RUNTIME_DIR, and so
    offers its link in another folder than a program of the same user's desktop would.
    """
    found = []
    for path in _paths():
        with suppress(OSError, ConfigurationError):
            found.append(_checked(path, _group()))
    return found


def _checked(path: Path, group: int | None) -> SharingFolder:
    found = path.lstat()
    is_private = found.st_uid == os.getuid() and not found.st_mode & 0o077
    is_the_groups = found.st_gid == group and not found.st_mode & 0o007
    # Anyone who can put a socket there could pose as the program that holds the port.
    if not stat.S_ISDIR(found.st_mode) or not (is_private or is_the_groups):
        named = f"this user and the group of {GROUP_VARIABLE}" if group else "this user"
        raise ConfigurationError(
            f"{path} is not a folder that only {named} can get into: remove it, or name another "
            f"one in {DIRECTORY_VARIABLE}"
        )
    return SharingFolder(path, group)


def _paths() -> list[Path]:
    """The folder of this program, and then those of the same user's other programs."""
    if named := os.environ.get(DIRECTORY_VARIABLE):
        # Resolved: systemd makes links to a service's folders.
        return [Path(named).resolve()]
    user = os.getuid()
    paths = [Path(folder) / f"wheelwire-{user}" for folder in (tempfile.gettempdir(), TEMPORARY)]
    if session := os.environ.get("XDG_RUNTIME_DIR"):
        paths.insert(0, Path(session) / "wheelwire")
    return list(dict.fromkeys([*paths, Path(SESSIONS) / str(user) / "wheelwire"]))


def _group() -> int | None:
    named = os.environ.get(GROUP_VARIABLE)
    if not named:
        return None
    try:
        return grp.getgrnam(named).gr_gid
    except KeyError:
        raise ConfigurationError(
            f"{GROUP_VARIABLE} = {named!r}: there is no such group; `groups` lists yours"
        ) from None


# --- the programs that drove ------------------------------------------------------------------

KEPT = 8
"""Sessions of one board that are remembered."""
LONGEST_COMMAND = 200
_SUFFIX = ".programs"


def note_driver(directory: SharingFolder, board_id: str, session_id: int) -> None:
    """Remember that this program drives in a session.

    Raises:
        OSError: The file cannot be written.
    """
    path = directory.path / f"{board_id}{_SUFFIX}"
    with directory.locked():
        known = [one for one in _read(path) if one[0] != session_id]
        known.append((session_id, this_program()))
        write_whole(path, json.dumps(known[-KEPT:]).encode(), sync=False)


def driver_of(board_id: str, session_id: int) -> Program | None:
    """The program that drove in a session; None unless it is this user's, on this computer."""
    for directory in sharing_folders():
        for known_id, program in _read(directory.path / f"{board_id}{_SUFFIX}"):
            if known_id == session_id:
                return program
    return None


def this_program() -> Program:
    """The program that calls this."""
    try:
        words = Path("/proc/self/cmdline").read_bytes().decode("utf-8", "replace").split("\0")
    except OSError:
        words = ["?"]
    command = shlex.join(word for word in words if word)
    pid = os.getpid()
    return Program(pid, start_of(pid) or 0, command[:LONGEST_COMMAND])


def _read(path: Path) -> list[tuple[int, Program]]:
    try:
        return [(int(known), Program(*one)) for known, one in json.loads(path.read_text("utf-8"))]
    except (OSError, ValueError, TypeError):
        return []  # it is missing, or holds something else
