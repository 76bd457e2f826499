"""The driver of a robot that is not there: the local control loop on a model robot.

In real time it stands in for a robot under any program. In virtual time nothing happens but in
`advance` and `read`, and the same calls give the same run, boot ids apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ..clock import host_clock_us
from ..errors import InvalidCommand, LinkLost, RequestTimeout
from ..local.driver import LocalDriver
from ..local.hardware import Hardware, WheelPair
from ..local.link import Clock
from ..local.parameters import default_values
from ..local.quadrature import QuadratureDecoder
from ..plant.encoder import Edge
from ..plant.motor import MotorModel
from ..plant.robot import ModelRobot
from ..samples import WheelSample


class VirtualClock:
    """Time that passes when it is told to."""

    def __init__(self) -> None:
        self.now_us = 0

    def __call__(self) -> int:
        """Microseconds."""
        return self.now_us


class MockRobot(ModelRobot):
    """The model robot behind the mock driver.

    Attributes:
        estop_open: The e-stop contact is open; only `estop_input_enabled` makes it count.
        link_lost: The pins are out of reach.
    """

    estop_open = False
    link_lost = False


class ModelPins(Hardware):
    """A model robot's pins. Its time passes when the control loop looks at it."""

    def __init__(self, robot: MockRobot, clock: Clock) -> None:
        self.left, self.right = robot.left, robot.right
        self._robot = robot
        self._clock = clock
        self._check()
        self._robot.advance_to(clock(), lambda *_: None)  # what went on meanwhile, uncounted
        self._decoders = [QuadratureDecoder(w.encoder.a, w.encoder.b) for w in robot.wheels]

    def ticks(self) -> WheelPair:
        """After the time since the last look has passed."""
        self._check()
        self._robot.advance_to(self._clock(), self._count)
        return WheelPair(*(decoder.ticks for decoder in self._decoders))

    def illegal_transitions(self) -> WheelPair:
        """Only a broken encoder that is mended makes them."""
        return WheelPair(*(decoder.illegal for decoder in self._decoders))

    def estop_is_open(self) -> bool:
        """As injected."""
        return self._robot.estop_open

    def close(self) -> None:
        """Both wheels coast."""
        for wheel in self._robot.wheels:
            wheel.set_enable(0.0)

    def _count(self, side: int, edge: Edge, t_us: float) -> None:
        self._decoders[side].change(edge.channel, edge.level, t_us)

    def _check(self) -> None:
        if self._robot.link_lost:
            raise LinkLost("the mock robot is out of reach: link_lost is set")


class MockDriver(LocalDriver):
    """A robot made of arithmetic: two gear motors, an L298N, two encoders.

    Args:
        realtime: False for virtual time.
        parameters: Values that differ from the defaults, by name.
        store: A JSON file that keeps parameters which are saved at run time.
        model: The motors; the encoders count `counts_per_revolution`.

    Attributes:
        robot: What the driver cannot know: the truth, and faults to inject.
    """

    def __init__(
        self,
        *,
        realtime: bool = True,
        parameters: Mapping[str, float] | None = None,
        store: Path | None = None,
        model: MotorModel | None = None,
    ) -> None:
        counts = int(default_values(parameters)["counts_per_revolution"])
        self._virtual = None if realtime else VirtualClock()
        clock: Clock = self._virtual or host_clock_us
        self.robot = robot = MockRobot(model or MotorModel(), counts, clock())
        super().__init__(
            "mock",
            lambda: ModelPins(robot, clock),
            parameters,
            store,
            clock=clock,
            threaded=realtime,
        )
        if self._virtual is not None:
            self._link.step()

    def advance(self, seconds: float) -> None:
        """Let virtual time pass, in whole control periods.

        Raises:
            InvalidCommand: Time is real.
        """
        if self._virtual is None:
            raise InvalidCommand("time passes by itself: give realtime=False to advance it")
        end_us = self._virtual.now_us + round(seconds * 1e6)
        while self._virtual.now_us < end_us:
            self._virtual.now_us += round(self._link.period_s * 1e6)
            if not self._link.step():
                self._link.reopen()

    def read(self, timeout: float = 1.0) -> WheelSample:
        """As every driver's; in virtual time, waiting makes it pass."""
        if self._virtual is None:
            return super().read(timeout)
        end_us = self._virtual.now_us + round(timeout * 1e6)
        while True:
            try:
                return super().read(0)
            except (RequestTimeout, LinkLost):
                if self._virtual.now_us >= end_us:
                    raise
            self.advance(self._link.period_s)
