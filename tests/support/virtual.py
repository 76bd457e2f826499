"""The host's session against the firmware's core, both in virtual time."""

from __future__ import annotations

from pathlib import Path
from random import Random

from wheelwire.simulation.libfwsim import FwSim
from wheelwire_protocol.codes import SupervisorState
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import ParameterGet, ParameterSet, ParameterValue

from .host_samples import received
from .virtual_host import VirtualHost

STEP_US = 1000


def box_after_a_contact() -> bytes:
    """The black box of a robot whose e-stop contact opened while it drove."""
    robot = VirtualRobot().open()
    robot.drive(0.2, 0.1, 1.5)
    robot.sim.set("estop_open", 1)
    robot.run(0.3)
    return robot.sim.black_box()


class VirtualRobot(VirtualHost):
    """A simulated device with a host on its line.

    Args:
        seed: Seed of everything random.
        store: Where the device keeps what it saves; None: in memory.
        watched: The session's.
        settings: The simulator's variables, such as `**{"left.encoder_dead": 1}`.
    """

    def __init__(
        self,
        seed: int = 1,
        store: Path | None = None,
        watched: tuple[int, ...] = (),
        /,
        **settings: float,
    ) -> None:
        super().__init__(seed, watched=watched)
        self.sim = FwSim(seed, store)
        for name, value in settings.items():
            self.sim.set(name, value)

    def state(self) -> SupervisorState:
        """The supervisor's state in the newest sample."""
        return self.sample.state

    def step(self, most_us: int = STEP_US) -> None:
        """Advance to the next whole millisecond in which something happens: host, then device."""
        due_us = self.session.next_deadline_us
        if due_us is not None and self.now_us >= due_us:
            self.session.advance(self.now_us)
            due_us = self.session.next_deadline_us
        self.write()
        if due_us is not None:
            most_us = min(most_us, due_us - self.now_us)
        self.now_us += self.sim.advance_to_bytes(STEP_US, most_us)
        self.samples += received(self.session, self.sim.read(), self.now_us)

    def run(self, seconds: float) -> None:
        """As the base's."""
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self.step(end_us - self.now_us)

    def write(self, setpoint: bytes = b"") -> None:
        """As the base's."""
        self.sim.write(self.session.take_output() + setpoint)

    def drive(self, left_mps: float, right_mps: float, seconds: float) -> None:
        """Command 50 times a second for `seconds`."""
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self.set_velocity(left_mps, right_mps)
            self.run(0.02)

    def drive_held(self, left_mps: float, right_mps: float, seconds: float, random: Random) -> None:
        """As `drive`, with one wheel, or both, held fast."""
        held = random.choice((("left",), ("right",), ("left", "right")))
        for side in held:
            self.sim.set(f"{side}.blocked", 1)
        self.drive(left_mps, right_mps, seconds)
        for side in held:
            self.sim.set(f"{side}.blocked", 0)

    def drive_duty(self, left: float, right: float, seconds: float) -> None:
        """Command 50 times a second for `seconds`, open loop."""
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self.set_duty(left, right)
            self.run(0.02)

    def parameter(self, name: str) -> float:
        """The value of one parameter."""
        answer = self.request(ParameterGet(0, 0, PARAMETER_BY_NAME[name].id))
        assert isinstance(answer, ParameterValue)
        return answer.value

    def set_parameter(self, name: str, value: float) -> float:
        """Set one parameter; returns the active value."""
        answer = self.request(ParameterSet(0, 0, PARAMETER_BY_NAME[name].id, value))
        assert isinstance(answer, ParameterValue)
        return answer.value
