"""The host's session against the firmware's core, both in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from random import Random

from wheelwire.errors import WheelwireError
from wheelwire.link.requests import Answer, RequestMessage
from wheelwire.link.session import Phase, Session
from wheelwire.samples import WheelSample
from wheelwire.simulation.libfwsim import FwSim
from wheelwire_protocol.codes import StopMode, SupervisorState
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import ParameterGet, ParameterSet, ParameterValue

from .host_samples import received

STEP_US = 1000
TIMEOUT_S = 5.0


class VirtualRobot:
    """A simulated device with a host on its line; time passes only in `run`.

    Args:
        seed: Seed of everything random.
        store: Where the device keeps what it saves; None: in memory.
        settings: The simulator's variables, such as `**{"left.encoder_dead": 1}`.
    """

    def __init__(self, seed: int = 1, store: Path | None = None, /, **settings: float) -> None:
        self.sim = FwSim(seed, store)
        for name, value in settings.items():
            self.sim.set(name, value)
        self.now_us = 0
        self.samples: list[WheelSample] = []
        self._random = Random(seed)
        self.session = Session(lambda: self._random.getrandbits(32))

    @property
    def sample(self) -> WheelSample:
        """The newest sample."""
        return self.samples[-1]

    def state(self) -> SupervisorState:
        """The supervisor's state in the newest sample."""
        return self.sample.state

    def open(self) -> VirtualRobot:
        """Connect, and wait until the session is open and the first sample is here."""
        self.session.connect(self.now_us)
        self.run_until(lambda: self.session.phase is Phase.OPEN and bool(self.samples))
        return self

    def run(self, seconds: float) -> None:
        """Let time pass."""
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self.step()

    def run_until(self, condition: Callable[[], bool], timeout_s: float = TIMEOUT_S) -> None:
        """Let time pass until `condition()` holds; fails when it does not within `timeout_s`."""
        end_us = self.now_us + round(timeout_s * 1e6)
        while not condition():
            assert self.now_us < end_us, "the condition never held"
            self.step()

    def step(self) -> None:
        """Advance one millisecond: the host first, then the device."""
        self.session.advance(self.now_us)
        self._write()
        self.sim.advance_us(STEP_US)
        self.now_us += STEP_US
        self.samples += received(self.session, self.sim.read(), self.now_us)

    def set_velocity(self, left_mps: float, right_mps: float, ttl_s: float = 0.5) -> None:
        """Send one setpoint."""
        expiry_us = self.now_us + round(ttl_s * 1e6)
        self._write(
            self.session.setpoints.velocity_frame(left_mps, right_mps, expiry_us, self.now_us)
        )

    def set_duty(self, left: float, right: float, ttl_s: float = 0.5) -> None:
        """Send one open-loop setpoint."""
        expiry_us = self.now_us + round(ttl_s * 1e6)
        self._write(self.session.setpoints.duty_frame(left, right, expiry_us, self.now_us))

    def drive(self, left_mps: float, right_mps: float, seconds: float) -> None:
        """Command 50 times a second for `seconds`."""
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self.set_velocity(left_mps, right_mps)
            self.run(0.02)

    def drive_duty(self, left: float, right: float, seconds: float) -> None:
        """Command 50 times a second for `seconds`, open loop."""
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self.set_duty(left, right)
            self.run(0.02)

    def stop(self, mode: StopMode = StopMode.CONFIGURED) -> None:
        """Stop, and wait for the acknowledgement."""
        results: list[Answer | WheelwireError] = []
        self.session.stop(mode, results.append, self.now_us)
        self._wait(results)

    def estop(self) -> None:
        """Stop and latch, and wait for the acknowledgement."""
        results: list[Answer | WheelwireError] = []
        self.session.estop(results.append, self.now_us)
        self._wait(results)

    def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer. Raises what the device refuses."""
        results: list[Answer | WheelwireError] = []
        self.session.request(message, results.append, self.now_us)
        return self._wait(results)

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

    def _write(self, setpoint: bytes = b"") -> None:
        self.sim.write(self.session.take_output() + setpoint)

    def _wait(self, results: list[Answer | WheelwireError]) -> Answer:
        self.run_until(lambda: bool(results))
        if isinstance(results[0], WheelwireError):
            raise results[0]
        return results[0]
