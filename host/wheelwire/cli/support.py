"""`support`: what a bug report needs, in one archive."""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path

from wheelwire.errors import WheelwireError
from wheelwire.tools.support import LEFT_OUT, newest_recording, of_error, of_robot, pack, versions

from .address import Given
from .output import print_lines, printed_json
from .registry import Heading, command


@command("support", Heading.LOOK, 7, page="recording")
def support(given: Given, output: Path | None = None, recording: Path | None = None) -> None:
    """Pack what a bug report needs: versions, the robot's state and values, a recording.

    Sends nothing anywhere. For a robot out of reach it packs the error.

    Args:
        given: The robot.
        output: The archive; default: wheelwire-support-TIME.zip here.
        recording: A recording; default: the newest in this folder.
    """
    address = given.resolve()
    now = datetime.now(timezone.utc)
    target = output or Path(f"wheelwire-support-{now:%Y%m%d-%H%M%S}.zip")
    parts = [versions(now)]
    try:
        with address.open_to_look() as driver:
            parts += of_robot(driver)
    except WheelwireError as error:
        parts.append(of_error(error))
    source = recording or newest_recording()
    listed = pack(target, parts, source)
    if printed_json({"file": str(target), "parts": listed}):
        return
    print_lines(f"wrote {target}:", *(f"  {name}: {what}" for name, what in listed.items()))
    if source is None:
        print_lines("  no recording: `wheelwire log record ROBOT FILE.mcap` makes one")
    print_lines(LEFT_OUT)
