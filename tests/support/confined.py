"""A process in a world of its own: read-only root, chosen folders, a user without rights.

The root is an overlay on this computer's, in a mount namespace, so nothing of it changes. The
network, /dev, /proc and /sys are this computer's. Needs root, as in a container of CI.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir

import pytest

from .processes import captured

NOBODY = 65534
TIMEOUT_S = 120.0
_ENTER = """
base=$1 root=$1/layers/root
shift
mount -t tmpfs world "$base/layers" && mkdir "$base"/layers/upper "$base"/layers/work "$root" &&
cp -a "$base/files/." "$base/layers/upper" &&
mount -t overlay -o "lowerdir=/,upperdir=$base/layers/upper,workdir=$base/layers/work" w "$root" &&
for name in dev proc sys; do mount --rbind "/$name" "$root/$name" || exit 1; done &&
while read -r name; do mount --bind "$base/writable$name" "$root$name" || exit 1; done \
    < "$base/folders" &&
mount -o remount,ro "$root" && cd / && exec "$@"
"""


class World:
    """A file system for one user; its files are this computer's and those that are added.

    Args:
        user: The user's number.
        groups: The group's number, then those of other groups.
    """

    def __init__(self, user: int = NOBODY, groups: Sequence[int] = (NOBODY,)) -> None:
        require()
        self._user = user
        self._groups = groups
        self._folder = TemporaryDirectory(prefix="wheelwire-world-")
        self._base = Path(self._folder.name)
        self._base.chmod(0o755)
        _lay_out(self._base)
        # Python and the checkout may be below a folder that only root may enter.
        for path in (Path(sys.base_prefix), Path(sys.prefix), Path(__file__)):
            for parent in reversed(path.parents):
                if not parent.stat().st_mode & 0o001:
                    self._under("files", str(parent)).chmod(0o755)
        self.add_folder(gettempdir()).chmod(0o1777)

    def add_file(self, path: str, text: str, *, executable: bool = False) -> None:
        """Add a file of root's, which all may read."""
        file = self._file(path)
        file.write_text(text)
        file.chmod(0o755 if executable else 0o644)

    def add_link(self, path: str, target: Path) -> None:
        """Add a symbolic link."""
        self._file(path).symlink_to(target)

    def add_folder(self, path: str) -> Path:
        """Add a folder that the user owns and may write to; returns it as seen from outside."""
        self._under("files", path)
        folder = self.outside(path)
        with (self._base / "folders").open("a") as folders:
            folders.write(f"{path}\n")
        os.chown(folder, self._user, self._groups[0])
        return folder

    def outside(self, path: str) -> Path:
        """A folder that was added, as seen from outside."""
        return self._under("writable", path)

    def start(
        self, command: Sequence[str], folder: str, environment: Mapping[str, str]
    ) -> subprocess.Popen[str]:
        """Start a program; its process is the one that is returned."""
        group, *others = map(str, self._groups)
        given = [f"{name}={value}" for name, value in environment.items()]
        return subprocess.Popen(
            [
                *_entering(self._base),
                *("chroot", str(self._base / "layers" / "root")),
                *("setpriv", "--reuid", str(self._user), "--regid", group),
                *(["--groups", ",".join(others)] if others else ["--clear-groups"]),
                *("--no-new-privs", "--inh-caps=-all", "--bounding-set=-all"),
                *("env", "--ignore-environment", f"--chdir={folder}", *given, *command),
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            preexec_fn=_as_a_service,
        )

    def run(
        self, command: Sequence[str], folder: str, environment: Mapping[str, str]
    ) -> tuple[int, str]:
        """Run a program to its end; returns exit code and output."""
        with self.start(command, folder, environment) as process:
            output, _ = process.communicate(timeout=TIMEOUT_S)
        return process.returncode, output

    def close(self) -> None:
        """Remove it; its processes have ended."""
        self._folder.cleanup()

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _file(self, path: str) -> Path:
        return self._under("files", str(Path(path).parent)) / Path(path).name

    def _under(self, part: str, path: str) -> Path:
        folder = self._base / part
        for name in Path(path).parts[1:]:
            folder /= name
            if not folder.exists():
                folder.mkdir()
                folder.chmod(0o755)
        return folder


def require() -> None:
    """Skip the test, with the reason, where there can be no such world."""
    if os.getuid() != 0:
        pytest.skip("an emulated unit needs root, for a file system of its own")
    for program in ("unshare", "chroot", "setpriv"):
        if shutil.which(program) is None:
            pytest.skip(f"an emulated unit needs {program}: apt install util-linux coreutils")
    with TemporaryDirectory() as base:
        _lay_out(Path(base))
        root = f"{base}/layers/root"
        tried = captured(*_entering(Path(base)), "test", "-e", root + sys.executable)
    if tried.returncode != 0:
        reason = tried.stderr.strip() or f"{sys.executable} is on a file system of its own"
        pytest.skip(f"an emulated unit needs an overlay of the root file system: {reason}")


def _entering(base: Path) -> list[str]:
    """The command before one that has the world's file systems."""
    private = ["unshare", "--mount", "--propagation", "private"]
    return [*private, "sh", "-c", _ENTER, "sh", str(base)]


def _lay_out(base: Path) -> None:
    for name in ("files", "layers", "writable"):
        (base / name).mkdir()
    (base / "folders").touch()


def _as_a_service() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.umask(0o022)
