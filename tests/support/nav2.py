"""What Nav2 does to commands on their way to the robot: the rules, without ROS.

Of Nav2 for Jazzy, 1.3.13 (branch jazzy, commit f4108e5b). Each rule names its source.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import yaml

FILE = Path(__file__).parents[2] / "ros_node" / "config" / "nav2_params.yaml"
X, YAW = 0, 2


class Command(NamedTuple):
    """A TwistStamped; m/s, rad/s, and s on the ROS clock."""

    linear_mps: float
    angular_radps: float
    stamp_s: float

    @property
    def is_zero(self) -> bool:
        return self.linear_mps == self.angular_radps == 0


def shipped(node: str) -> dict[str, Any]:
    """The parameters of one of Nav2's nodes in `nav2_params.yaml`."""
    parameters: dict[str, Any] = yaml.safe_load(FILE.read_text())[node]["ros__parameters"]
    return parameters


class Smoother:
    """nav2_velocity_smoother/src/velocity_smoother.cpp, `smootherTimer`, with OPEN_LOOP feedback.

    - After `velocity_timeout` without a command its target is zero, stamped with the present time:
      the ramp to it has fresh stamps.
    - A ramp changes a velocity by at most `max_accel` or `max_decel` / `smoothing_frequency`.
    - It stamps what it publishes with the time of the smoothing, and stops publishing once it has
      published zero after a timeout.
    """

    def __init__(self, parameters: dict[str, Any]) -> None:
        self.period_s: float = 1 / parameters["smoothing_frequency"]
        self._timeout_s = parameters["velocity_timeout"]
        self._limits = [
            (parameters["max_accel"][axis], parameters["max_decel"][axis]) for axis in (X, YAW)
        ]
        self._most = [parameters["max_velocity"][axis] for axis in (X, YAW)]
        self._target: tuple[float, float] | None = None
        self._commanded_s = -math.inf
        self._last = (0.0, 0.0)
        self._stopped = True

    def command(self, command: Command) -> None:
        """`inputCommandStampedCallback`."""
        self._target, self._commanded_s = command[:2], command.stamp_s

    def step(self, now_s: float) -> Command | None:
        """What it publishes now, if anything."""
        if self._target is None:
            return None
        if now_s - self._commanded_s > self._timeout_s:
            if self._last == (0.0, 0.0) or self._stopped:
                self._stopped = True
                return None
            self._target = 0.0, 0.0
        self._stopped = False
        left, right = (
            self._toward(last, min(max(target, -most), most), *limits)
            for last, target, most, limits in zip(
                self._last, self._target, self._most, self._limits, strict=True
            )
        )
        self._last = left, right
        return Command(left, right, now_s)

    def _toward(self, last: float, target: float, accel: float, decel: float) -> float:
        faster = abs(target) >= abs(last) and last * target >= 0
        step = (accel if faster else -decel) * self.period_s
        return float(last + min(max(target - last, -step), step))


class CollisionMonitor:
    """nav2_collision_monitor/src/collision_monitor_node.cpp, `process` and `publishVelocity`.

    - A source from which nothing came for `source_timeout` stops the robot.
    - `approach`: the velocity is scaled by the time to the collision over `time_before_collision`.
    - The header is that of the command. After a stop it publishes zeros for `stop_pub_timeout`
      (1 s), then nothing.
    """

    STOP_PUB_TIMEOUT_S = 1.0

    def __init__(self, parameters: dict[str, Any]) -> None:
        self._source_timeout_s = parameters["source_timeout"]
        self._before_s = parameters["approach"]["time_before_collision"]
        self._seen_s = -math.inf
        self._ahead_m = math.inf
        self._was_zero = False
        self._stopped_s = -math.inf

    def scan(self, ahead_m: float, now_s: float) -> None:
        """A scan came; so far it is to what is ahead of the footprint."""
        self._ahead_m, self._seen_s = ahead_m, now_s

    def command(self, command: Command, now_s: float) -> Command | None:
        """What it makes of a command; None: nothing is published."""
        scale = 1.0
        if now_s - self._seen_s > self._source_timeout_s:
            scale = 0.0
        elif command.linear_mps > 0:
            scale = min(1.0, self._ahead_m / command.linear_mps / self._before_s)
        out = Command(command.linear_mps * scale, command.angular_radps * scale, command.stamp_s)
        if out.is_zero:
            if not self._was_zero:
                self._stopped_s = now_s
            elif now_s - self._stopped_s > self.STOP_PUB_TIMEOUT_S:
                return None
        self._was_zero = out.is_zero
        return out


@dataclass
class Controller:
    """nav2_controller/src/controller_server.cpp, `computeControl`.

    At each end of a goal, by success, cancellation, or any exception, it
    publishes a zero (`publishZeroVelocity`, while `publish_zero_velocity` is true, its default).
    """

    goal: tuple[float, float] | None = None
    """The velocity to follow; None: there is no goal."""
    _ends: bool = False

    def begin(self, linear_mps: float, angular_radps: float) -> None:
        """A goal."""
        self.goal = linear_mps, angular_radps

    def end(self) -> None:
        """It was reached, canceled or aborted."""
        self._ends = self._ends or self.goal is not None
        self.goal = None

    def step(self, now_s: float) -> Command | None:
        """What it publishes now, if anything."""
        if self._ends:
            self._ends = False
            return Command(0.0, 0.0, now_s)
        return None if self.goal is None else Command(*self.goal, now_s)
