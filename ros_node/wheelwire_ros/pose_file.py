"""Where the robot was: what a node that starts anew goes on from. Needs no rclpy."""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

AUTO = "auto"
"""In place of a path: below ROS's own folder, by the node's name and the board's identity."""
FORMAT = 1


@dataclass(frozen=True)
class PoseRecord:
    """The pose at one sample, and what the wheels had counted then.

    Attributes:
        board_id: Of the board that counted; empty where the driver has none.
        boot_id: Of the sample.
        t_us: The device's time of it.
        left_ticks: The device's counter.
        right_ticks: The device's counter.
        left_total: Ticks since the odometry began, which joint_states shows.
        right_total: The same of the right wheel.
        pose: x and y in m, heading in rad.
        covariance: Of the pose, 3 by 3, row by row.
        saved_s: When, on the wall clock.
        is_final: Whether the wheels had been stopped, and nothing of this node moved them later.
    """

    board_id: str
    boot_id: int
    t_us: int
    left_ticks: int
    right_ticks: int
    left_total: int
    right_total: int
    pose: tuple[float, float, float]
    covariance: tuple[float, ...]
    saved_s: float = 0.0
    is_final: bool = False

    @property
    def age_s(self) -> float:
        """Since it was saved; never negative, though the wall clock may have been set back."""
        return max(0.0, time.time() - self.saved_s)


class PoseFileError(Exception):
    """The file cannot be used; says why."""


def path_of(setting: str, node_name: str, board_id: str) -> Path | None:
    """The file that `pose_file` means; None for none.

    Args:
        setting: The parameter: `auto`, a path, or nothing.
        node_name: With its namespace.
        board_id: Two robots of one name, on two domains, do not share a file.
    """
    if setting != AUTO:
        return Path(setting).expanduser() if setting else None
    home = os.environ.get("ROS_HOME") or "~/.ros"
    name = "-".join(filter(None, [node_name.strip("/").replace("/", "."), board_id]))
    return Path(home).expanduser() / "wheelwire" / f"{name}.pose.json"


def read(path: Path) -> PoseRecord | None:
    """What the file has; None if there is no file.

    Raises:
        PoseFileError: It cannot be read, or is none of these.
    """
    try:
        found = json.loads(path.read_text("utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as error:
        raise PoseFileError(f"{path}: {error}") from error
    try:
        return _record(found)
    except (KeyError, TypeError, ValueError) as error:
        raise PoseFileError(f"{path}: it is no pose file of this release ({error})") from error


def write(path: Path, record: PoseRecord) -> None:
    """Replace the file: whoever reads it, also after a power cut, finds the old or the new one.

    Raises:
        PoseFileError: It cannot be written.
    """
    beside = path.with_name(f"{path.name}.{os.getpid()}.new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with beside.open("w", encoding="utf-8") as file:
                json.dump({"format": FORMAT, **asdict(record)}, file)
                file.flush()
                os.fsync(file.fileno())
            beside.replace(path)
        finally:
            with suppress(FileNotFoundError):
                beside.unlink()
    except OSError as error:
        raise PoseFileError(f"{path}: {error}") from error


def _record(found: Any) -> PoseRecord:
    if found["format"] != FORMAT:
        raise ValueError(f"format {found['format']}")
    values: dict[str, Any] = {field.name: found[field.name] for field in fields(PoseRecord)}
    record = PoseRecord(
        board_id=_typed(values["board_id"], str),
        is_final=_typed(values["is_final"], bool),
        pose=_pose(values["pose"]),
        covariance=_numbers(values["covariance"], 9),
        saved_s=_numbers([values["saved_s"]], 1)[0],
        **{name: _typed(values[name], int) for name in _COUNTERS},
    )
    if any(record.covariance[diagonal] < 0 for diagonal in (0, 4, 8)):
        raise ValueError("a variance below 0")
    return record


_COUNTERS = ("boot_id", "t_us", "left_ticks", "right_ticks", "left_total", "right_total")


def _typed(value: object, type_: type) -> Any:
    # To Python a bool is an int.
    if not isinstance(value, type_) or isinstance(value, bool) is not (type_ is bool):
        raise TypeError(f"{value!r} is no {type_.__name__}")
    return value


def _pose(value: object) -> tuple[float, float, float]:
    x_m, y_m, heading_rad = _numbers(value, 3)
    return x_m, y_m, heading_rad


def _numbers(value: object, count: int) -> tuple[float, ...]:
    if not isinstance(value, Sequence) or len(value) != count:
        raise TypeError(f"{value!r} is not {count} numbers")
    numbers = tuple(float(number) for number in value)
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"{value!r} is not finite")
    return numbers
