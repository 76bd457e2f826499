"""The folder in which programs that hold a port offer their taps to others on this computer."""

from __future__ import annotations

import fcntl
import grp
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from ..errors import ConfigurationError

DIRECTORY_VARIABLE = "WHEELWIRE_TAP_DIR"
GROUP_VARIABLE = "WHEELWIRE_TAP_GROUP"
SUFFIX = ".tap"
TEMPORARY = "/tmp"  # noqa: S108 - it is only looked into, if it is this user's alone
"""The temporary folder of a program without TMPDIR."""
SESSIONS = "/run/user"
"""Where systemd has the folders that XDG_RUNTIME_DIR names."""


class TapDirectory(NamedTuple):
    """Where the sockets are, and who may use them."""

    path: Path
    group: int | None
    """Its members may, besides the owner; None: nobody."""

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Only one program at a time replaces a socket that is left over."""
        descriptor = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            yield
        finally:
            os.close(descriptor)


def tap_directory(*, make: bool = False) -> TapDirectory:
    """The folder of whoever runs this.

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


def tap_directories() -> list[TapDirectory]:
    """All folders in which whoever holds a port may offer it to whoever runs this.

    A service, or a program that cron or ssh has started, commonly has no XDG_RUNTIME_DIR, and so
    offers its link in another folder than a program of the same user's desktop would.
    """
    found = []
    for path in _paths():
        with suppress(OSError, ConfigurationError):
            found.append(_checked(path, _group()))
    return found


def _checked(path: Path, group: int | None) -> TapDirectory:
    found = path.lstat()
    is_private = found.st_uid == os.getuid() and not found.st_mode & 0o077
    is_the_groups = found.st_gid == group and not found.st_mode & 0o007
    # Whoever could put a socket there would pass for the program that holds the port.
    if not stat.S_ISDIR(found.st_mode) or not (is_private or is_the_groups):
        named = f"this user and the group of {GROUP_VARIABLE}" if group else "this user"
        raise ConfigurationError(
            f"{path} is not a folder that only {named} can get into: remove it, or name another "
            f"one in {DIRECTORY_VARIABLE}"
        )
    return TapDirectory(path, group)


def _paths() -> list[Path]:
    """The folder of this program, and then those of others of the same user."""
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
