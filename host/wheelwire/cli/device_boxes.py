"""`wheelwire why` of a device's black boxes: in a file, or stored in a robot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from wheelwire.errors import OutputFailed, RecordingError
from wheelwire_protocol.black_box import BoxError

if TYPE_CHECKING:
    from wheelwire.link.info import Recorded, StoredBox
    from wheelwire.log.why import Stop

SUFFIX = ".box"


def is_box(address: str) -> bool:
    """Whether an address is a file of a black box."""
    return address.lower().endswith(SUFFIX)


def stops_of_file(file: Path) -> list[Stop]:
    """The stops that a box is of.

    Raises:
        RecordingError: It cannot be read, or is no black box.
    """
    from wheelwire.log.black_box import read_box
    from wheelwire.log.why.boxes import stops_of_box

    try:
        return stops_of_box(read_box(file))
    except BoxError as error:
        raise RecordingError(f"{file} is {error}: use the library of that release") from error


def check_folder(folder: Path) -> None:
    """Make the folder, before anything is read.

    Raises:
        OutputFailed: It cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputFailed.at(folder, error) from error


def write_boxes(recorded: Recorded, board_id: str, folder: Path) -> list[Path]:
    """Write each box that was read to a file of its own; a file that exists holds the same box.

    Raises:
        OutputFailed: One cannot be written.
    """
    return [_write(folder / _name(box, board_id), image) for box, image in recorded.boxes if image]


def _name(box: StoredBox, board_id: str) -> str:
    head = box.head
    return f"{board_id}-{head.number}-{head.boot_id:08x}-{head.cause.name.lower()}{SUFFIX}"


def _write(file: Path, image: bytes) -> Path:
    # Beside it first: a full disk must not leave a part of a box under its name.
    fresh = file.with_suffix(".part")
    try:
        fresh.write_bytes(image)
        fresh.replace(file)
    except OSError as error:
        fresh.unlink(missing_ok=True)
        raise OutputFailed.at(file, error) from error
    return file
