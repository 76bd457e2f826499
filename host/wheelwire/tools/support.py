"""What a bug report needs, in one archive, without what names a person or a network."""

from __future__ import annotations

import json
import os
import platform
import re
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from getpass import getuser
from pathlib import Path
from typing import Any, NamedTuple

from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash

from ..errors import OutputFailed, WheelwireError
from ..link.info import library_version
from ..robot.robot import Robot
from ..samples import to_json_value
from .files.board import reported
from .files.parameters import ParameterFile

RECORDINGS = "*.mcap"
LARGEST = 200 << 20
"""A recording above this is named, but not packed."""
LEFT_OUT = (
    "left out: names of users, computers and folders, addresses of networks; the device's own id "
    "(its MAC address) is in it"
)
_NETWORK = re.compile(r"(socket|rfc2217|tcp)://[^\s\"',;]*[^\s\"',;:.]")
_HOMES = re.compile(r"(/home|/Users|/run/user|/run/media|/media)/[^/\s\"']+")
_PATH = re.compile(r"(?<![\w/.~-])/(?!/)[^\s\"',;:()<>|]+")
"""A path from the root. An address such as `socket://HOST` has none."""
_SYSTEM = ("/dev", "/sys", "/proc", "/usr", "/etc", "/lib", "/bin", "/sbin", "/boot")
"""Folders in which nothing has the name of a person."""
_COMMON_USERS = ("root", "pi", "robot", "ros", "ubuntu", "debian", "user", "wheelwire")
"""Users that are not people, and whose names may be words of a message."""
_IPV4 = re.compile(r"\b(?:\d{1,3}\.){3}\d{1,3}\b")


class Part(NamedTuple):
    """A file of the archive, and in words what it is."""

    name: str
    content: str
    what: str


def versions(now: datetime) -> Part:
    """Versions of Wheelwire, Python and the system."""
    found = {
        "wheelwire": library_version(),
        "protocol": PROTOCOL_VERSION,
        "schema": f"{schema_hash():08x}",
        "python": platform.python_version(),
        # Not platform.node() or uname(), which contain the computer's name.
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "ros_distro": os.environ.get("ROS_DISTRO"),
        "packages": dict(_packages()),
        "time": now.isoformat(timespec="seconds"),
    }
    return Part("versions.json", _json(found), "versions of Wheelwire, Python and the system")


def _packages() -> Iterator[tuple[str, str]]:
    from importlib.metadata import PackageNotFoundError, version

    for name in ("pyserial", "construct", "numpy", "mcap", "gpiozero", "lgpio", "pigpio", "typer"):
        with suppress(PackageNotFoundError):
            yield name, version(name)


def of_robot(driver: Robot) -> Iterator[Part]:
    """What the robot reports; for a question that it does not answer, the error."""
    yield Part("sample.json", _json(driver.read()), "the newest sample")
    yield Part("link.json", _json(driver.statistics), "what this end of the link has counted")
    if not driver.has_device:
        return
    yield Part("info.json", _json(driver.info), "the device, its firmware and its board")
    yield _answer("parameters.yaml", "all parameters", lambda: _parameters(driver))
    yield _answer("board.yaml", "the active board", lambda: reported(*driver.board.read()))
    yield _answer("device.json", "what the device has counted", lambda: _counters(driver))


def of_error(error: WheelwireError) -> Part:
    """Why there is nothing of the robot."""
    said = {"error": type(error).__name__, "message": str(error)}
    return Part("error.json", _json(said), f"why the robot is not in it: {error}")


def _answer(name: str, what: str, ask: Any) -> Part:
    try:
        return Part(name, ask(), what)
    except WheelwireError as error:
        return Part(f"{name}.error", f"{type(error).__name__}: {error}\n", f"no {what}: {error}")


def _parameters(driver: Robot) -> str:
    return ParameterFile.of_robot(driver.parameters.list(), driver.info.device).text()


def _counters(driver: Robot) -> str:
    return _json(
        {
            "link": driver.device_counters(),
            "control": driver.control_counters(),
            "contradictions": driver.contradictions(),
        }
    )


def newest_recording() -> Path | None:
    """The newest recording in this folder; None if there is none."""
    found = [file for file in Path().glob(RECORDINGS) if file.is_file()]
    return max(found, key=lambda file: file.stat().st_mtime, default=None)


def pack(target: Path, parts: Iterable[Part], recording: Path | None) -> dict[str, str]:
    """Write the archive; returns what each file in it is, by its name.

    Raises:
        OutputFailed: It cannot be written, or exists.
    """
    listed = {}
    with _written(target) as archive:
        for part in parts:
            archive.writestr(part.name, _anonymous(part.content))
            listed[part.name] = _anonymous(part.what)
        if recording is not None:
            name, what = _pack_recording(archive, recording)
            listed[name] = what
    return listed


def _pack_recording(archive: zipfile.ZipFile, source: Path) -> tuple[str, str]:
    try:
        size = source.stat().st_size
        if size > LARGEST:
            return source.name, f"not packed, {size >> 20} MB: send it by itself"
        archive.write(source, source.name)
    except OSError as error:
        raise OutputFailed(f"cannot pack {source}: {error.strerror}") from error
    return source.name, f"a recording, {size / 1e6:.1f} MB"


@contextmanager
def _written(target: Path) -> Iterator[zipfile.ZipFile]:
    """A new archive, which gets its name once it is finished."""
    if target.exists():
        raise OutputFailed(f"{target} exists: name another file with --output")
    part = target.with_name(f".{target.name}.part")
    try:
        with OutputFailed.of(target):
            with (
                part.open("wb") as file,
                zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed,
            ):
                yield packed
            part.rename(target)
    except BaseException:
        with suppress(OSError):  # on a file system that is read-only by now it stays
            part.unlink(missing_ok=True)
        raise


def _json(value: Any) -> str:
    return json.dumps(to_json_value(value), indent=2, allow_nan=False) + "\n"


def _anonymous(text: str) -> str:
    """The text without what names a person or a network."""
    text = _IPV4.sub("ADDRESS", _NETWORK.sub(r"\1://ADDRESS", text))
    for path, stands_for in ((Path.cwd(), "."), (Path.home(), "~")):
        if len(path.parts) > 1:  # not the root, which is in every path
            text = text.replace(str(path), stands_for)
    # Before what is a path only up to its first space.
    for folder in (*Path.cwd().parents, *_mounted()):
        if len(folder.parts) > 1 and not str(folder).startswith(_SYSTEM):
            text = text.replace(f"{folder}/", "FOLDER/")
    text = _PATH.sub(_without_folders, _HOMES.sub(r"\1/NAME", text))
    for name, stands_for in ((platform.node(), "COMPUTER"), (_user(), "USER")):
        if name:
            text = re.sub(rf"\b{re.escape(name)}\b", stands_for, text)
    return text


def _without_folders(path: re.Match[str]) -> str:
    """A path with the name of its file alone, unless it is the system's own."""
    if path[0].startswith(_SYSTEM):
        return path[0]
    place, own, rest = path[0].partition("/NAME")  # of `_HOMES`
    name = path[0].rpartition("/")[2]
    if own:
        return f"{place}/NAME/{name}" if rest else f"{place}/NAME"
    return f"FOLDER/{name}"


def _mounted() -> list[Path]:
    """Where disks are mounted by their labels, which people choose."""
    try:
        lines = Path("/proc/self/mounts").read_text("utf-8", "replace").splitlines()
    except OSError:
        return []
    places = [line.split(" ")[1].replace("\\040", " ") for line in lines if " " in line]
    return [Path(one) for one in places if one.startswith(("/media/", "/run/media/", "/mnt/"))]


def _user() -> str:
    """The name of the user, if it may be a person's."""
    try:
        name = getuser()
    except (OSError, KeyError):  # it has none
        return ""
    return "" if name in _COMMON_USERS else name
