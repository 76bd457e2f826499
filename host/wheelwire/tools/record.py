"""Records a robot, and adds its parameters, its board and the versions to the file."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from ..errors import InvalidCommand, LinkLost, RequestTimeout, WheelwireError
from ..link.connection import Link
from ..link.device_link import DeviceLink
from ..link.info import host_release
from ..link.sample_stream import LatestSample
from ..log.recorder import Attachment, Recorder
from ..log.share.attached_link import AttachedLink
from ..robot.board import DeviceBoard
from ..robot.calls import Requests, run
from ..robot.parameters import DeviceParameters
from ..robot.sensors import DEFAULT_RATE_HZ, Streams
from .files.board import reported
from .files.parameters import ParameterFile

ASKS = 10
"""How often a robot that is out of reach is asked for its sensors' samples."""
ASK_AGAIN_S = 1.0
_YAML = "application/yaml"


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
    return reported(*DeviceBoard(Requests(link)).read())
