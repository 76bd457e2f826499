"""Files of black boxes: what a device was given and did before it stopped, and its re-run."""

from __future__ import annotations

from pathlib import Path

from wheelwire_protocol.black_box import BOX_SIZE, Box, BoxError, Rerun, RerunOutcome, core_hash

from ..errors import RecordingError


def read_box(path: Path) -> Box:
    """The black box in this file.

    Raises:
        RecordingError: It cannot be read, or is no black box.
        NativeMissingError: The firmware's library is missing or of another release.
    """
    try:
        with path.open("rb") as file:
            # One byte more shows a file that is longer.
            return Box(file.read(BOX_SIZE + 1))
    except OSError as error:
        raise RecordingError(
            f"cannot read {path}: {error.strerror or error}; name the file of a black box"
        ) from None
    except BoxError as error:
        raise RecordingError(
            f"{path} is {error}: name a file of {BOX_SIZE} bytes that was read from a robot"
        ) from None


def rerun_box(path: Path) -> Rerun:
    """Give the inputs in this file to the firmware's core again, in virtual time.

    Raises:
        RecordingError: It cannot be read, is no black box, or is one of another core.
        NativeMissingError: The firmware's library is missing or of another release.
    """
    box = read_box(path)
    head = box.head
    if head.core != core_hash():
        raise RecordingError(
            f"{path} is of the core {head.core:08x} (firmware {head.release}, commit "
            f"{head.git_hash:08x}), and this is {core_hash():08x}: re-run it with the library of "
            "that release or commit"
        )
    rerun = box.rerun()
    if rerun.outcome is RerunOutcome.UNREADABLE:
        raise RecordingError(
            f"{path} is damaged: the robot's state in it cannot be read; read the box "
            "from the robot again"
        )
    if rerun.outcome is RerunOutcome.EMPTY:
        raise RecordingError(
            f"{path} is empty: it was stored before the robot made a step; choose another box"
        )
    return rerun
