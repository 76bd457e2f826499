"""Stops of a simulated robot, staged one by one in virtual time, as a tap sees them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

from wheelwire.errors import LinkLost, WheelwireError
from wheelwire.link.port_loop import CLOSED
from wheelwire.link.session import Phase
from wheelwire.link.traffic import Kind, TrafficReader
from wheelwire.log.why.diagnosis import Diagnosis, Stop
from wheelwire.robot.verbs import WATCHED
from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.codes import Fault, ResetReason, StopMode, TrialAction
from wheelwire_protocol.framing import encode_frame
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import (
    ClearEstop,
    ClearFault,
    Estop,
    Hello,
    ParameterTrial,
    Restart,
)
from wheelwire_protocol.types import Stop as StopRequest

from .virtual import STEP_US, VirtualRobot

SUPPLY = {"supply_ohm": 0.4}
"""One that sags."""
TTL_S = 0.3


class StagedRobot(VirtualRobot):
    """A robot whose tap is read."""

    def __init__(self, seed: int = 1, /, **settings: float) -> None:
        super().__init__(seed, None, WATCHED, **settings)
        self.reader = TrafficReader(10_000_000)
        self.session.listen(self.reader, 0)
        self.cable = True
        self.corrupt = False
        self.delay_us = 0
        self._delayed: deque[tuple[int, bytes]] = deque()

    def step(self, most_us: int = STEP_US) -> None:
        """As the base's, with what the port's thread reports."""
        if not self.cable:
            self.session.advance(self.now_us)
            self.session.take_output()
            self.sim.advance_us(STEP_US)
            self.sim.read()
            self.now_us += STEP_US
            return
        # What is delayed may be due at any time.
        super().step(STEP_US if self.delay_us else most_us)

    def write(self, setpoint: bytes = b"") -> None:
        """As the base's, over the cable."""
        data = self.session.take_output() + setpoint
        if not self.cable:
            return
        if data and self.session.traffic.readers:
            self.session.traffic.put(Kind.SENT, self.now_us, data)
        if self.corrupt and len(data) > 20:
            data = data[:9] + bytes([data[9] ^ 0x10 or 1]) + data[10:]
        self._delayed.append((self.now_us + self.delay_us, data))
        while self._delayed and self._delayed[0][0] <= self.now_us:
            self.sim.write(self._delayed.popleft()[1])

    def drive(
        self, left_mps: float, right_mps: float, seconds: float, ttl_s: float = TTL_S
    ) -> None:
        """As an application does that goes on whatever it is answered."""
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            with suppress(WheelwireError):
                self.set_velocity(left_mps, right_mps, ttl_s)
            self.run(0.02)

    def until(self, condition: Callable[[], bool], *, driving: float | None = 0.2) -> None:
        """Drive on until something holds."""
        end_us = self.now_us + 8_000_000
        while not condition():
            assert self.now_us < end_us, "the condition never held"
            if driving is None:
                self.run(0.02)
            else:
                self.drive(driving, driving, 0.02)

    def freeze(self, seconds: float) -> None:
        """The host stands still; what the device sends waits."""
        self.sim.advance_us(round(seconds * 1e6))
        self.now_us += round(seconds * 1e6)

    def stranger(self, message: Estop | StopRequest | Hello) -> None:
        """Another program writes to the port."""
        self.sim.write(b"\0" + encode_frame(message, 0))

    def pull(self, seconds: float) -> None:
        """The cable is off for so long; the system says nothing, as with a bare UART."""
        self.cable = False
        self.drive(0.2, 0.2, seconds)
        self.sim.read()
        self.cable = True


class Staged(NamedTuple):
    """One stop.

    Attributes:
        stops: The only right answer: each stop's cause, or those that the data leaves open.
        play: Brings it about, from a robot that drives.
        settings: The simulator's.
        closed: The recording was closed; else it was cut off.
        driving: The robot drives before; else it stands.
    """

    stops: tuple[str, ...]
    play: Callable[[StagedRobot], object]
    settings: dict[str, float] = {}  # noqa: RUF012 - of a named tuple, never changed
    closed: bool = True
    driving: bool = True


def _one_by_one(*steps: Callable[[StagedRobot], object]) -> Callable[[StagedRobot], None]:
    def play(robot: StagedRobot) -> None:
        for step in steps:
            step(robot)

    return play


def _set(name: str, value: float = 1.0) -> Callable[[StagedRobot], None]:
    """A variable changes while the robot drives, and a fault follows."""

    def play(robot: StagedRobot) -> None:
        robot.sim.set(name, value)
        robot.until(lambda: bool(robot.sample.faults))

    return play


def _reset(reason: ResetReason) -> Callable[[StagedRobot], None]:
    def play(robot: StagedRobot) -> None:
        robot.sim.reset(reason)
        robot.drive(0.2, 0.2, 2.0)

    return play


def _from_rest(settings: dict[str, float]) -> Callable[[StagedRobot], None]:
    def play(robot: StagedRobot) -> None:
        for name, value in settings.items():
            robot.sim.set(name, value)
        robot.until(lambda: bool(robot.sample.faults))

    return play


def _contact_refused(robot: StagedRobot) -> None:
    robot.sim.set("estop_open", 1)
    robot.run(0.02)
    with suppress(WheelwireError):
        robot.request(ClearEstop(0, 0))


def _contact_closed_again(robot: StagedRobot) -> None:
    robot.sim.set("estop_open", 1)
    robot.run(0.05)
    robot.sim.set("estop_open", 0)


def _latched_before(message: str) -> Callable[[StagedRobot], None]:
    def play(robot: StagedRobot) -> None:
        if message == "estop":
            robot.estop()
        else:
            robot.sim.set("left.encoder_dead", 1)
            robot.until(lambda: bool(robot.sample.faults))
        robot.run(0.3)
        robot.sim.reset(ResetReason.PANIC)
        robot.run(2.0)

    return play


def _trial(robot: StagedRobot) -> None:
    robot.request(ParameterTrial(0, 0, TrialAction.BEGIN, 0.2))
    robot.session.release_trial()
    robot.drive(0.2, 0.2, 1.0)


def _empties(robot: StagedRobot) -> None:
    for volt in range(40):
        robot.sim.set("supply_v", 7.4 - 0.05 * volt)
        robot.sim.set("battery_v", 7.4 - 0.05 * volt)
        robot.run(3.0)
    robot.sim.reset(ResetReason.BROWNOUT)
    robot.run(2.0)


def _dips(robot: StagedRobot) -> None:
    """A wheel is held fast, and the current pulls the supply down."""
    boot_id = robot.sample.boot_id
    robot.sim.set("left.blocked", 1)
    robot.until(lambda: robot.sample.boot_id != boot_id)
    robot.run(0.5)


def _unarmed(robot: StagedRobot) -> None:
    robot.estop()
    robot.request(ClearEstop(0, 0))
    robot.drive(0.2, 0.2, 0.2)


def _unplugged(robot: StagedRobot) -> None:
    robot.session.disconnect(LinkLost("the port is gone: Input/output error; trying again"))
    robot.cable = False
    robot.run(1.0)
    robot.cable = True
    robot.sim.read()
    robot.session.connect(robot.now_us)
    robot.until(lambda: robot.session.phase is Phase.OPEN, driving=None)


def _hangs_up(robot: StagedRobot) -> None:
    robot.session.disconnect(LinkLost(CLOSED))
    robot.cable = False


def _closes(robot: StagedRobot) -> None:
    robot.session.stop(StopMode.CONFIGURED, lambda _: None, robot.now_us)
    robot.write()
    _hangs_up(robot)


def _contradicts(robot: StagedRobot) -> None:
    robot.sim.preset(PARAMETER_BY_NAME["control_rate_hz"].id, 100.0)
    robot.sim.preset(PARAMETER_BY_NAME["stream_rate_hz"].id, 200.0)
    robot.sim.reset(ResetReason.POWER_ON)
    robot.drive(0.0, 0.0, 0.2)  # what is refused after a reset, before a zero, is not sent
    robot.drive(0.2, 0.2, 2.0)


def _loses_parameters(fault: Fault) -> Callable[[StagedRobot], None]:
    def play(robot: StagedRobot) -> None:
        robot.sim.set("store_unreadable", fault)
        robot.sim.reset(ResetReason.POWER_ON)
        robot.run(2.0)

    return play


def _silent(robot: StagedRobot) -> None:
    robot.cable = False
    robot.drive(0.2, 0.2, 3.0)


def _corrupt(robot: StagedRobot) -> None:
    robot.corrupt = True
    robot.drive(0.2, 0.2, 0.6)
    robot.corrupt = False


def _too_late(robot: StagedRobot) -> None:
    robot.delay_us = 120_000
    robot.drive(0.2, 0.2, 1.0, ttl_s=0.1)


def _reverts(robot: StagedRobot) -> None:
    """The program leaves its lost trial, and drives on."""
    with suppress(WheelwireError):
        robot.request(ParameterTrial(0, 0, TrialAction.REVERT, 0.0))
    robot.until(lambda: robot.session.phase is Phase.OPEN, driving=None)


def _clears(robot: StagedRobot) -> None:
    """And arms the robot, so that it drives next."""
    robot.request(ClearEstop(0, 0))
    robot.drive(0.0, 0.0, 0.04)


def _fault_lasts(robot: StagedRobot) -> None:
    robot.sim.set("driver_failed", 1)
    robot.run(0.2)
    with suppress(WheelwireError):
        robot.request(ClearFault(0, 0))


def _driving(seconds: float) -> Callable[[StagedRobot], None]:
    return lambda robot: robot.drive(0.2, 0.2, seconds)


def _waiting(seconds: float) -> Callable[[StagedRobot], None]:
    return lambda robot: robot.run(seconds)


def _resets(reason: ResetReason) -> Callable[[StagedRobot], None]:
    return lambda robot: robot.sim.reset(reason)


def _open_contact(robot: StagedRobot) -> None:
    robot.sim.set("estop_open", 1)
    robot.run(0.3)


def _stranger_stops(robot: StagedRobot) -> None:
    robot.stranger(StopRequest(0x1234, 5, 1, StopMode.COAST))
    robot.run(0.02)


def _stranger_estops(robot: StagedRobot) -> None:
    robot.stranger(Estop(0x1234, 5))
    robot.run(0.05)


def _stranger_opens(robot: StagedRobot) -> None:
    robot.stranger(Hello(77, *_VERSION))
    robot.run(0.5)
    robot.until(lambda: robot.session.phase is Phase.OPEN, driving=None)


def _out_of_reach(happens: Callable[[StagedRobot], object]) -> Callable[[StagedRobot], None]:
    """The cable is off while something happens, and on again."""

    def play(robot: StagedRobot) -> None:
        robot.cable = False
        _driving(0.1)(robot)
        happens(robot)
        _driving(1.5)(robot)
        robot.sim.read()
        robot.cable = True
        robot.run(2.0)

    return play


def _late_for_a_while(robot: StagedRobot) -> None:
    robot.delay_us = 120_000
    robot.drive(0.2, 0.2, 0.6, ttl_s=0.1)
    robot.delay_us = 0
    robot.drive(0.2, 0.2, 0.3)


_LOW = {"supply_v": 5.9, "battery_v": 5.9}
_VERSION = PROTOCOL_VERSION, schema_hash()

STAGED: dict[str, Staged] = {
    "encoder dead": Staged(("encoder_dead",), _set("left.encoder_dead"), SUPPLY),
    "encoder dead, right": Staged(("encoder_dead",), _set("right.encoder_dead"), SUPPLY),
    "wheel blocked": Staged(("wheel_blocked",), _set("left.blocked"), SUPPLY),
    "motor's wire off": Staged(("motor_open",), _set("left.motor_open"), SUPPLY),
    "encoder dead, stiff supply": Staged(
        ("encoder_dead or wheel_blocked",), _set("left.encoder_dead")
    ),
    "wheel blocked, stiff supply": Staged(("encoder_dead or wheel_blocked",), _set("left.blocked")),
    "encoder dead from rest": Staged(
        ("wheel_never_counted",), _from_rest({"left.encoder_dead": 1}), SUPPLY, driving=False
    ),
    "blocked from rest": Staged(
        ("wheel_never_counted",), _from_rest({"left.blocked": 1}), SUPPLY, driving=False
    ),
    "one channel": Staged(
        ("encoder_one_channel",), _from_rest({"left.stuck_channel": 1}), SUPPLY, driving=False
    ),
    "reversed": Staged(
        ("wheel_reversed",), _from_rest({"left.encoder_reversed": 1}), driving=False
    ),
    "runs away downhill": Staged(
        ("overspeed",), _from_rest({"slope_rad": -0.45}), {"mass_kg": 3.0}, driving=False
    ),
    "late step": Staged(
        ("control_overrun",),
        _one_by_one(
            lambda robot: robot.sim.set("control_delay_us", 40_000),
            lambda robot: robot.drive(0.2, 0.2, 0.3),
        ),
    ),
    "contact, still open": Staged(("contact_open",), _contact_refused),
    "contact, closed again": Staged(("contact_open",), _contact_closed_again),
    "estop of this program": Staged(("estop_by_session",), lambda robot: robot.estop()),
    "estop of another one": Staged(
        ("estop_by_stranger",), lambda robot: robot.stranger(Estop(0x1234, 5))
    ),
    "stop of this program": Staged(("stop_by_session",), lambda robot: robot.stop()),
    "stop of another one": Staged(
        ("stop_by_stranger",),
        lambda robot: robot.stranger(StopRequest(0x1234, 5, 1, StopMode.COAST)),
    ),
    "zero": Staged(("zero_setpoint",), lambda robot: robot.drive(0.0, 0.0, 1.0)),
    "another session": Staged(
        ("new_session",),
        _one_by_one(
            lambda robot: robot.stranger(Hello(77, *_VERSION)),
            lambda robot: robot.run(0.02),
        ),
    ),
    "trial": Staged(("trial_expired",), _trial),
    "program killed": Staged(("host_killed or recording_cut",), lambda _: None, closed=False),
    "program frozen": Staged(
        ("host_frozen",), _one_by_one(lambda robot: robot.freeze(1.0), lambda robot: robot.run(0.2))
    ),
    "program pauses": Staged(("program_paused",), lambda robot: robot.run(1.0)),
    "cable off and on": Staged(
        ("cable_pulled",), _one_by_one(lambda robot: robot.pull(2.0), lambda robot: robot.run(1.0))
    ),
    "port gone": Staged(("cable_pulled",), _unplugged),
    "silence to the end": Staged(("cable_pulled or power_lost",), _silent),
    "line corrupt": Staged(("line_corrupt",), _corrupt),
    "setpoints too late": Staged(("setpoints_expired",), _too_late),
    "link closed while it drives": Staged(("host_hung_up",), _hangs_up),
    "robot closed while it drives": Staged(("stop_by_session",), _closes),
    "contradiction": Staged(("power_lost", "contradiction"), _contradicts, driving=False),
    "flash full": Staged(
        ("power_lost", "store_full"),
        _loses_parameters(Fault.STORE_FULL),
        driving=False,
    ),
    "parameters of a newer firmware": Staged(
        ("power_lost", "store_newer"),
        _loses_parameters(Fault.STORE_NEWER),
        driving=False,
    ),
    "brown-out": Staged(("brownout",), _reset(ResetReason.BROWNOUT)),
    "panic": Staged(("panic",), _reset(ResetReason.PANIC)),
    "task watchdog": Staged(("task_watchdog",), _reset(ResetReason.TASK_WATCHDOG)),
    "interrupt watchdog": Staged(("interrupt_watchdog",), _reset(ResetReason.INTERRUPT_WATCHDOG)),
    "power": Staged(("power_lost",), _reset(ResetReason.POWER_ON)),
    "reset pin": Staged(("reset_pin",), _reset(ResetReason.EXTERNAL)),
    "battery empty": Staged(("battery_empty",), _empties, driving=False),
    "battery low": Staged(("battery_low",), _dips, {**SUPPLY, **_LOW, "brownout_v": 5.7}),
    "battery low, short dip": Staged(("battery_low",), _reset(ResetReason.BROWNOUT), _LOW),
    "supply sags": Staged(("battery_sags",), _dips, {"supply_ohm": 2.0, "brownout_v": 6.0}),
    "fault before reset": Staged(
        ("encoder_dead", "panic", "fault_before_reset"), _latched_before("fault"), SUPPLY
    ),
    "one channel while it turns": Staged(
        ("encoder_one_channel",), _set("left.stuck_channel"), SUPPLY
    ),
    "restart asked for": Staged(
        ("restart_requested",),
        _one_by_one(
            lambda robot: robot.run(0.5),
            lambda robot: robot.request(Restart(0, 0)),
            lambda robot: robot.run(2.0),
        ),
        driving=False,
    ),
    "firmware restarts": Staged(("restarted_itself",), _reset(ResetReason.SOFTWARE)),
    "board unconfirmed": Staged(
        ("board_unconfirmed",),
        lambda robot: robot.drive(0.2, 0.2, 0.5),
        {"board_unwritten": 1},
        driving=False,
    ),
    "unarmed": Staged(("estop_by_session", "unarmed"), _unarmed),
    "driver failed": Staged(
        ("driver_failed",), lambda robot: robot.run(0.5), {"driver_failed": 1}, driving=False
    ),
    "estop before reset": Staged(
        ("estop_by_session", "panic", "estop_before_reset"), _latched_before("estop")
    ),
    "reset that cannot say why": Staged(("reset_unknown",), _reset(ResetReason.UNKNOWN)),
    # --- two within a second: what explains the first does not explain the second
    "own stop, then the contact": Staged(
        ("stop_by_session", "contact_open"),
        _one_by_one(StagedRobot.stop, _driving(0.3), _open_contact),
    ),
    "own stop, then another program's": Staged(
        ("stop_by_session", "stop_by_stranger"),
        _one_by_one(StagedRobot.stop, _driving(0.3), _stranger_stops),
    ),
    "another program's stop, then an own one": Staged(
        ("stop_by_stranger", "stop_by_session"),
        _one_by_one(_stranger_stops, _driving(0.3), StagedRobot.stop),
    ),
    "own e-stop, then the contact": Staged(
        ("estop_by_session", "contact_open"),
        _one_by_one(StagedRobot.estop, _clears, _driving(0.2), _open_contact),
    ),
    "another program's e-stop, then the contact": Staged(
        ("estop_by_stranger", "contact_open"),
        _one_by_one(_stranger_estops, _clears, _driving(0.2), _open_contact),
    ),
    "own stop, twice": Staged(
        ("stop_by_session", "stop_by_session"),
        _one_by_one(StagedRobot.stop, _driving(0.1), StagedRobot.stop),
    ),
    "trial, then an own stop": Staged(
        ("trial_expired", "stop_by_session"),
        _one_by_one(
            lambda robot: robot.request(ParameterTrial(0, 0, TrialAction.BEGIN, 0.2)),
            lambda robot: robot.session.release_trial(),
            _driving(0.35),
            _reverts,
            _driving(0.1),
            StagedRobot.stop,
        ),
    ),
    "fault, then an e-stop": Staged(
        ("encoder_dead", "estop_by_session"),
        _one_by_one(_set("left.encoder_dead"), StagedRobot.estop),
        SUPPLY,
    ),
    "fault that lasts, then another program's e-stop": Staged(
        ("driver_failed", "estop_by_stranger"), _one_by_one(_fault_lasts, _stranger_estops)
    ),
    "pause, then frozen": Staged(
        ("program_paused", "host_frozen"),
        _one_by_one(_waiting(0.5), _driving(0.2), lambda robot: robot.freeze(1.0), _waiting(0.2)),
    ),
    "another session, then an own stop": Staged(
        ("new_session", "stop_by_session"),
        _one_by_one(_stranger_opens, _driving(0.3), StagedRobot.stop),
    ),
    "another program's stop, twice": Staged(
        ("stop_by_stranger", "stop_by_stranger"),
        _one_by_one(_stranger_stops, _driving(0.2), _stranger_stops),
    ),
    "zero, then a pause": Staged(
        ("zero_setpoint", "program_paused"),
        _one_by_one(lambda robot: robot.drive(0.0, 0.0, 0.6), _waiting(1.0)),
    ),
    "too late, then a pause": Staged(
        ("setpoints_expired", "program_paused"), _one_by_one(_late_for_a_while, _waiting(0.8))
    ),
    "cable off, and the contact meanwhile": Staged(
        ("contact_open or estop_by_stranger",),
        _out_of_reach(lambda robot: robot.sim.set("estop_open", 1)),
    ),
    "cable off, and a panic meanwhile": Staged(
        ("panic",), _out_of_reach(_resets(ResetReason.PANIC))
    ),
    "restart asked for, then one by itself": Staged(
        ("restart_requested", "restarted_itself"),
        _one_by_one(
            _waiting(0.5),
            lambda robot: robot.request(Restart(0, 0)),
            _waiting(1.0),
            _resets(ResetReason.SOFTWARE),
            _waiting(1.5),
        ),
        driving=False,
    ),
    "own stop, then a panic": Staged(
        ("stop_by_session", "panic"),
        _one_by_one(StagedRobot.stop, _waiting(0.1), _resets(ResetReason.PANIC), _waiting(2.0)),
    ),
    "panic, then a brown-out": Staged(
        ("panic", "brownout"),
        _one_by_one(
            _resets(ResetReason.PANIC),
            _driving(1.0),
            _resets(ResetReason.BROWNOUT),
            _driving(2.0),
        ),
    ),
}


def diagnosed(staged: Staged, seed: int = 1) -> list[Stop]:
    """The stops that a diagnosis finds in one that was staged."""
    robot = StagedRobot(seed, **staged.settings)
    robot.open()
    robot.run(0.3)
    if staged.driving:
        robot.drive(0.2, 0.2, 1.0)
        assert robot.sample.left_mps > 0.1
    staged.play(robot)
    robot.run(0.1)
    diagnosis = Diagnosis()
    found = diagnosis.feed_all(robot.reader.take())
    return found + diagnosis.end(complete=staged.closed)
