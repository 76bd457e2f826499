"""Records a robot, and adds its parameters, its board and the versions to the file."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..arguments import path as checked_path
from ..errors import InvalidArgument, InvalidCommand, LinkLost, RequestTimeout, WheelwireError
from ..files.board import to_yaml
from ..files.parameters import ParameterFile
from ..link.attached import AttachedLink
from ..link.connection import Link
from ..link.device_link import DeviceLink
from ..link.info import host_release
from ..link.latest_sample import LatestSample
from ..recording.recorder import Attachment, Recorder, recording_path
from .device_board import DeviceBoard
from .device_parameters import DeviceParameters
from .device_sensors import DEFAULT_RATE_HZ, Streams
from .factory import RECORD_VARIABLE
from .requests import Requests, run

if TYPE_CHECKING:
    from .base import BaseDriver

ASKS = 10
"""How often a robot that is out of reach is asked for its sensors' samples."""
ASK_AGAIN_S = 1.0
_YAML = "application/yaml"


def wanted_recording(record: str | Path | None) -> Path | None:
    """Where to record a robot: `record`, or what the environment says.

    Raises:
        RecordingError: No file can be made there.
        InvalidArgument: `record` is no path.
    """
    wanted = os.environ.get(RECORD_VARIABLE) if record is None else record
    if not wanted:
        return None
    wanted = checked_path("record", wanted)
    recording_path(wanted)
    return wanted


def record_opened(robot: BaseDriver, path: Path, driver: str, *, is_asked: bool) -> None:
    """Record a robot that was just opened.

    Args:
        robot: The robot.
        path: The file or folder to record to.
        driver: The driver's name.
        is_asked: Whether the program asked for it. The environment asks for all robots, but not
            every one can be recorded.
    """
    from .transport_driver import DeviceDriver  # here: it imports what calls this

    if isinstance(robot, DeviceDriver):
        with suppress(*() if is_asked else (InvalidCommand,)):
            robot.record(path, driver)
    elif is_asked:
        raise InvalidArgument(
            f"driver {driver!r} has no link that could be recorded: leave out `record`"
        )


def start(link: DeviceLink, path: str | Path, driver: str) -> Recorder:
    """Record a link that is open.

    Raises:
        InvalidCommand: The link is not in real time.
        RecordingError: The file cannot be made.
    """
    if not isinstance(link, (Link, AttachedLink)):
        raise InvalidCommand(f"{link.name}: only a robot in real time can be recorded")
    device, release = link.info.device, host_release()
    said = {
        "driver": driver,
        "board_id": device.board_id,
        "board": device.board.name,
        "git_hash": device.git_hash,
        "firmware": device.release.release,
        "version": release.release,
        "protocol": str(release.protocol_version),
        "schema": f"{release.schema_hash:08x}",
    }
    return Recorder(link, path, said, attachments=partial(_attachments, link, said))


def _attachments(link: Link | AttachedLink, said: dict[str, str]) -> Iterator[Attachment]:
    _ask_for_samples(link)
    versions = "".join(f"{name}: '{value}'\n" for name, value in said.items())
    yield Attachment("versions.yaml", _YAML, versions.encode())
    for name, text_of in (("parameters.yaml", _parameters), ("board.yaml", _board)):
        try:
            text = text_of(link)
        except WheelwireError as error:  # out of reach, or it cannot tell
            text = f"# {error}\n"
        yield Attachment(name, _YAML, text.encode())


def _ask_for_samples(link: Link | AttachedLink) -> None:
    """Ask for the sensors' samples, so that they are recorded; a robot may have none."""
    streams = Streams(Requests(link), LatestSample())
    for _ in range(ASKS):
        if link.has_ended or link.sensors.rate_hz:
            return
        try:
            run(streams.ask, DEFAULT_RATE_HZ)
        except (LinkLost, RequestTimeout):
            time.sleep(ASK_AGAIN_S)
        except WheelwireError:  # the firmware, or the program that holds the port, sends none
            return


def _parameters(link: Link | AttachedLink) -> str:
    return ParameterFile.of_robot(DeviceParameters(Requests(link)).list(), link.info.device).text()


def _board(link: Link | AttachedLink) -> str:
    state, found = DeviceBoard(Requests(link)).read()
    return f"# {state.doc}\n{to_yaml(found) if found else ''}"
