"""The host's session and the firmware on a line where anything happens, held to a small model.

Whatever is asked, lost, repeated, damaged, reset, unplugged and waited for, in any order: the drive
is on only while the model has a setpoint that is not expired and not void, and a value that the
device reports is one that was set.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    precondition,
    rule,
    run_state_machine_as_test,
)

from support.impaired_robot import ImpairedVirtualRobot
from support.virtual import STEP_US
from wheelwire.errors import WheelwireError
from wheelwire.link.requests import Answer, Done, RequestMessage
from wheelwire.link.session import Phase
from wheelwire.simulation.bad_line import Impairment, LineProfile
from wheelwire.simulation.libfwsim import library_path
from wheelwire_protocol.codes import StopMode
from wheelwire_protocol.parameters import PARAMETER_BY_NAME, Parameter
from wheelwire_protocol.types import (
    ClearEstop,
    ParameterGet,
    ParameterSave,
    ParameterSet,
    ParameterValue,
)

# --- the model -----------------------------------------------------------------------------------


Values = dict[int, frozenset[float]]
"""The values that a parameter may have, by its id."""


@dataclass
class Model:
    """Times are the host's, in microseconds.

    Attributes:
        values: In the device's memory.
        saved: In its store.
        boots: How often the device was reset; requests before a reset have no effect after it.
        clears: How many requests to clear an e-stop may still be carried out.
        latched: An e-stop was acknowledged, and no request to clear it was sent.
    """

    values: Values
    saved: Values
    boots: int = 0
    clears: int = 0
    latched: bool = False
    _expiries_us: list[int] = field(default_factory=list)

    def may_drive(self, now_us: int) -> bool:
        """Whether a setpoint may still be valid."""
        return not self.latched and any(now_us <= expiry_us for expiry_us in self._expiries_us)

    @property
    def setpoints(self) -> int:
        """The number of setpoints sent; a later stop cancels those before it."""
        return len(self._expiries_us)

    def sent_setpoint(self, expiry_us: int) -> None:
        self._expiries_us.append(expiry_us)

    def stopped(self, setpoints: int, boots: int) -> None:
        """Note the acknowledgement of a stop that was sent after so many setpoints and resets."""
        if boots == self.boots:
            self._expiries_us[:setpoints] = [0] * setpoints

    def estopped(self, boots: int) -> None:
        """Note the acknowledgement of an e-stop; setpoints after it are refused, too."""
        if boots == self.boots and not self.clears:
            self.stopped(self.setpoints, boots)
            self.latched = True

    def asked_to_clear(self) -> None:
        self.clears += 1
        self.latched = False

    def asked_to_set(self, parameter: int, value: float) -> None:
        self.values[parameter] |= {value}

    def has_set(self, parameter: int, value: float, boots: int) -> None:
        if boots == self.boots:
            self.values[parameter] = frozenset({value})

    def asked_to_save(self, numbers: Iterable[int] | None = None) -> None:
        """Those of these ids; None: all."""
        for number in self.saved if numbers is None else numbers:
            self.saved[number] |= self.values[number]

    def has_saved(self, values: Values, boots: int) -> None:
        """`values`: when it was asked for."""
        if boots == self.boots:
            self.saved |= values

    def reset(self) -> None:
        """The device starts again: an open session's setpoints and its latch are gone."""
        self.stopped(self.setpoints, self.boots)
        self.boots += 1
        self.latched = False
        self.values = dict(self.saved)


# Without a part in what is tested; the first may not change while driving, the other may.
PARAMETERS = [PARAMETER_BY_NAME[name] for name in ("wheel_separation", "acceleration_feedforward")]

PERIODS_US = 2 * STEP_US
"""One control period until the drive is removed, and one until that is looked at."""

SETTLED_S = 0.5
"""By then a host that loses nothing any more has noticed a reset."""

chances = st.sampled_from([0.0, 0.0, 0.05, 0.3])
moments = st.sampled_from([0, 1, 3, 10, 30, 100, 300, 700])  # ms
bad_line = st.builds(
    Impairment,
    loss=st.sampled_from([0.0, 0.0, 0.05, 0.3, 1.0]),
    repeat=chances,
    reorder=chances,
    flip=chances,
    noise_bytes_per_s=st.sampled_from([0.0, 5_000.0]),
    split=st.booleans(),
    jitter_us=st.sampled_from([0, 3_000, 40_000]),
)


def single(value: float) -> float:
    """As it is on the wire."""
    number: float = struct.unpack("<f", struct.pack("<f", value))[0]
    return number


class HostAndFirmware(RuleBasedStateMachine):
    """One host, one device, one line."""

    @initialize(seed=st.integers(0, 2**16))
    def power_on(self, seed: int) -> None:
        self.robot = ImpairedVirtualRobot(seed, LineProfile(seed=seed))
        self.asking = False
        defaults = {p.id: frozenset({single(p.default)}) for p in PARAMETERS}
        self.model = Model(values=dict(defaults), saved=dict(defaults))
        self.robot.open()

    # --- what the host asks for ----------------------------------------------------------------

    @precondition(lambda self: self.robot.session.phase is Phase.OPEN)
    @rule(speed=st.sampled_from([-0.3, 0.1, 0.3]), ttl_ms=st.integers(1, 500), ms=moments)
    def drive(self, speed: float, ttl_ms: int, ms: int) -> None:
        robot = self.robot
        try:
            robot.set_velocity(speed, speed, ttl_ms / 1000)
        except WheelwireError:
            return
        self.model.sent_setpoint(robot.now_us + ttl_ms * 1000 + PERIODS_US)
        self.wait(ms)

    @rule(mode=st.sampled_from(StopMode), ms=moments)
    def stop(self, mode: StopMode, ms: int) -> None:
        setpoints, boots = self.model.setpoints, self.model.boots
        done = self.once(lambda _: self.model.stopped(setpoints, boots))
        self.robot.session.stop(mode, done, self.robot.now_us)
        self.wait(ms)

    @rule(ms=moments)
    def estop(self, ms: int) -> None:
        boots = self.model.boots
        done = self.once(lambda _: self.model.estopped(boots))
        self.robot.session.stop(None, done, self.robot.now_us)
        self.wait(ms)

    @precondition(lambda self: self.can_ask)
    @rule(ms=moments)
    def clear_estop(self, ms: int) -> None:
        self.model.asked_to_clear()

        def ended() -> None:
            self.model.clears -= 1

        self.ask(ClearEstop(0, 0), lambda _: None, ended)
        self.wait(ms)

    @precondition(lambda self: self.can_ask)
    @rule(parameter=st.sampled_from(PARAMETERS), share=st.floats(0, 1))
    def set_parameter(self, parameter: Parameter, share: float) -> None:
        value = single(parameter.minimum + share * (parameter.maximum - parameter.minimum))
        boots = self.model.boots
        self.model.asked_to_set(parameter.id, value)

        def answered(answer: Answer) -> None:
            assert isinstance(answer, ParameterValue)
            assert (answer.parameter, answer.value) == (parameter.id, value)
            self.model.has_set(parameter.id, value, boots)

        self.ask(ParameterSet(0, 0, parameter.id, value), answered)

    @precondition(lambda self: self.can_ask)
    @rule(parameter=st.sampled_from(PARAMETERS))
    def get_parameter(self, parameter: Parameter) -> None:
        possible = self.model.values[parameter.id]

        def answered(answer: Answer) -> None:
            assert isinstance(answer, ParameterValue)
            assert answer.parameter == parameter.id
            assert answer.value in possible

        self.ask(ParameterGet(0, 0, parameter.id), answered)

    @precondition(lambda self: self.can_ask)
    @rule()
    def save(self) -> None:
        values, boots = dict(self.model.values), self.model.boots
        self.model.asked_to_save()
        self.ask(ParameterSave(0, 0, 0), lambda _: self.model.has_saved(values, boots))

    @precondition(lambda self: self.can_ask)
    @rule(parameter=st.sampled_from(PARAMETERS))
    def save_one(self, parameter: Parameter) -> None:
        values = {parameter.id: self.model.values[parameter.id]}
        boots = self.model.boots
        self.model.asked_to_save([parameter.id])
        request = ParameterSave(0, 0, parameter.id)
        self.ask(request, lambda _: self.model.has_saved(values, boots))

    # --- what happens --------------------------------------------------------------------------

    @rule(to_device=bad_line, to_host=bad_line)
    def impair(self, to_device: Impairment, to_host: Impairment) -> None:
        self.robot.line.to_device.impairment = replace(to_device)
        self.robot.line.to_host.impairment = replace(to_host)

    @rule()
    def mend(self) -> None:
        self.impair(Impairment(), Impairment())

    @rule(ms=moments)
    def reset(self, ms: int) -> None:
        self.robot.sim.reset()
        self.model.reset()
        self.wait(ms)

    @rule(ms=moments)
    def unplug(self, ms: int) -> None:
        self.robot.unplug()
        self.wait(ms)
        self.robot.plug()

    @rule(ms=moments)
    def wait(self, ms: int) -> None:
        for _ in range(ms):
            self.robot.step()
            driven = bool(self.robot.sim.get("drive_on"))
            assert not driven or self.model.may_drive(self.robot.now_us)

    def teardown(self) -> None:
        """On a good line everything works again, and all is as the model has it."""
        if not hasattr(self, "model"):
            return
        self.mend()
        self.robot.run(SETTLED_S)
        self.robot.run_until(lambda: self.can_ask)
        for parameter in PARAMETERS:
            assert self.robot.parameter(parameter.name) in self.model.values[parameter.id]
        self.robot.stop()
        assert not self.robot.sim.get("drive_on")
        self.robot.sim.close()

    # --- asking --------------------------------------------------------------------------------

    @property
    def can_ask(self) -> bool:
        """The model follows one request at a time; stops may come between."""
        return self.robot.session.phase is Phase.OPEN and not self.asking

    def ask(
        self,
        message: RequestMessage,
        answered: Callable[[Answer], None],
        ended: Callable[[], None] = lambda: None,
    ) -> None:
        self.asking = True

        def over() -> None:
            self.asking = False
            ended()

        self.robot.session.request(message, self.once(answered, over), self.robot.now_us)

    def once(
        self, answered: Callable[[Answer], None], ended: Callable[[], None] = lambda: None
    ) -> Done:
        """Refusals and time-outs say nothing that the model has to know."""
        calls = 0

        def done(result: Answer | WheelwireError) -> None:
            nonlocal calls
            calls += 1
            assert calls == 1
            ended()
            if not isinstance(result, WheelwireError):
                answered(result)

        return done


@pytest.mark.whole
@pytest.mark.skipif(not library_path().exists(), reason="not built: make sim")
def test_any_interleaving_agrees_with_the_model() -> None:
    run_state_machine_as_test(
        HostAndFirmware,
        settings=settings(max_examples=100, stateful_step_count=50),
    )
