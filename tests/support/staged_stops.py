"""Stops of a simulated robot, staged one by one in virtual time, as a tap sees them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from types import MappingProxyType
from typing import NamedTuple

from wheelwire.errors import LinkLost, WheelwireError
from wheelwire.link.port_loop import CLOSED
from wheelwire.link.requests import RequestMessage
from wheelwire.link.session import Phase
from wheelwire.link.traffic import Kind, TrafficReader
from wheelwire.log.why.diagnosis import Diagnosis, Stop
from wheelwire.robot.verbs import WATCHED
from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.codes import Fault, ResetReason, StopMode, TrialAction
from wheelwire_protocol.framing import encode_frame
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import ClearEstop, ClearFault, Estop, Hello, ParameterTrial, Restart
from wheelwire_protocol.types import Stop as StopRequest

from .virtual import STEP_US, VirtualRobot

SUPPLY = {"supply_ohm": 0.4}
"""One that sags."""
TTL_S = 0.3
HELLO = Hello(77, PROTOCOL_VERSION, schema_hash())
"""Another program's."""


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

    def pull(self, seconds: float) -> None:
        """The cable is off for so long; the system says nothing, as with a bare UART."""
        self.cable = False
        self.drive(0.2, 0.2, seconds)
        self.sim.read()
        self.cable = True


Step = Callable[[StagedRobot], object]


class Staged(NamedTuple):
    """One stop.

    Attributes:
        stops: The only right answer: each stop's cause, or those that the data leaves open.
        steps: They bring it about, from a robot that drives.
        settings: The simulator's.
        closed: The recording was closed; else it was cut off.
        driving: The robot drives before; else it stands.
    """

    stops: tuple[str, ...]
    steps: tuple[Step, ...]
    settings: Mapping[str, float]
    closed: bool
    driving: bool = True

    def play(self, seed: int = 1) -> StagedRobot:
        """The robot, once it has stopped."""
        robot = StagedRobot(seed, **self.settings)
        robot.open()
        robot.run(0.3)
        if self.driving:
            robot.drive(0.2, 0.2, 1.0)
            assert robot.sample.left_mps > 0.1
        for step in self.steps:
            step(robot)
        robot.run(0.1)
        return robot


def staged(
    stops: str,
    *steps: Step,
    settings: Mapping[str, float] = MappingProxyType({}),
    closed: bool = True,
) -> Staged:
    """One stop, or several with commas between their causes."""
    return Staged(tuple(stops.split(", ")), steps, settings, closed)


# --- what steps are made of ---


def drives(seconds: float, mps: float = 0.2, ttl_s: float = TTL_S) -> Step:
    """On and on, whatever is answered."""
    return lambda robot: robot.drive(mps, mps, seconds, ttl_s)


def waits(seconds: float) -> Step:
    """Without a setpoint."""
    return lambda robot: robot.run(seconds)


def sets(name: str, value: float = 1.0) -> Step:
    """A variable of the simulation."""
    return lambda robot: robot.sim.set(name, value)


def line(**values: object) -> Step:
    """Attributes of the robot's line: `cable`, `corrupt`, `delay_us`."""
    return lambda robot: vars(robot).update(values)


def asks(request: RequestMessage) -> Step:
    """By this program, whether it is refused or not."""

    def play(robot: StagedRobot) -> None:
        with suppress(WheelwireError):
            robot.request(request)

    return play


def hears(message: Estop | StopRequest | Hello) -> Step:
    """Another program writes to the port."""
    return lambda robot: robot.sim.write(b"\0" + encode_frame(message, 0))


def resets(reason: ResetReason) -> Step:
    """The chip."""
    return lambda robot: robot.sim.reset(reason)


def fails(name: str, value: float = 1.0) -> Step:
    """A variable changes, the robot is driven, and a fault follows."""

    def play(robot: StagedRobot) -> None:
        robot.sim.set(name, value)
        robot.until(lambda: bool(robot.sample.faults))

    return play


def stops(robot: StagedRobot) -> None:
    """By this program."""
    robot.stop()


def estops(robot: StagedRobot) -> None:
    """By this program."""
    robot.estop()


def opens(robot: StagedRobot) -> None:
    """It waits for a session, and drives nothing."""
    robot.until(lambda: robot.session.phase is Phase.OPEN, driving=None)


# --- steps with names ---


def freezes(robot: StagedRobot) -> None:
    """The host, for a second."""
    robot.freeze(1.0)
    robot.run(0.2)


def empties(robot: StagedRobot) -> None:
    for volt in range(40):
        robot.sim.set("supply_v", 7.4 - 0.05 * volt)
        robot.sim.set("battery_v", 7.4 - 0.05 * volt)
        robot.run(3.0)
    robot.sim.reset(ResetReason.BROWNOUT)
    robot.run(2.0)


def dips(robot: StagedRobot) -> None:
    """A wheel is held fast, and the current pulls the supply down."""
    boot_id = robot.sample.boot_id
    robot.sim.set("left.blocked", 1)
    robot.until(lambda: robot.sample.boot_id != boot_id)
    robot.run(0.5)


def unplugged(robot: StagedRobot) -> None:
    robot.session.disconnect(LinkLost("the port is gone: Input/output error; trying again"))
    robot.cable = False
    robot.run(1.0)
    robot.cable = True
    robot.sim.read()
    robot.session.connect(robot.now_us)
    opens(robot)


def hangs_up(robot: StagedRobot) -> None:
    robot.session.disconnect(LinkLost(CLOSED))
    robot.cable = False


def closes(robot: StagedRobot) -> None:
    robot.session.stop(StopMode.CONFIGURED, lambda _: None, robot.now_us)
    robot.write()
    hangs_up(robot)


def presets(robot: StagedRobot) -> None:
    """What the chip has after its reset contradicts itself."""
    robot.sim.preset(PARAMETER_BY_NAME["control_rate_hz"].id, 100.0)
    robot.sim.preset(PARAMETER_BY_NAME["stream_rate_hz"].id, 200.0)


def out_of_reach(happens: Step) -> tuple[Step, ...]:
    """The cable is off while something happens, and on again."""
    drained: Step = lambda robot: robot.sim.read()  # noqa: E731
    off = line(cable=False), drives(0.1), happens, drives(1.5)
    return (*off, drained, line(cable=True), waits(2.0))


CONTACT = sets("estop_open")
CLEAR = asks(ClearEstop(0, 0))
REVERT = asks(ParameterTrial(0, 0, TrialAction.REVERT, 0.0))
RESTART = asks(Restart(0, 0))
OTHERS_STOP = hears(StopRequest(0x1234, 5, 1, StopMode.COAST)), waits(0.02)
OTHERS_ESTOP = hears(Estop(0x1234, 5)), waits(0.05)
LEFT_TRIAL = (
    asks(ParameterTrial(0, 0, TrialAction.BEGIN, 0.2)),
    lambda robot: robot.session.release_trial(),
)
CLEARED = CLEAR, drives(0.04, 0.0)
"""And armed, so that it drives next."""

LOW = {"supply_v": 5.9, "battery_v": 5.9}
EITHER = "encoder_dead or wheel_blocked"

_FROM_REST: dict[str, Staged] = {
    "encoder dead from rest": staged(
        "wheel_never_counted", fails("left.encoder_dead"), settings=SUPPLY
    ),
    "blocked from rest": staged("wheel_never_counted", fails("left.blocked"), settings=SUPPLY),
    "one channel": staged("encoder_one_channel", fails("left.stuck_channel"), settings=SUPPLY),
    "reversed": staged("wheel_reversed", fails("left.encoder_reversed")),
    "runs away downhill": staged("overspeed", fails("slope_rad", -0.45), settings={"mass_kg": 3.0}),
    "contradiction": staged(
        "power_lost, contradiction",
        *(presets, resets(ResetReason.POWER_ON)),
        drives(0.2, 0.0),  # what is refused after a reset, before a zero, is not sent
        drives(2.0),
    ),
    **{
        title: staged(
            f"power_lost, {cause}",
            *(sets("store_unreadable", fault), resets(ResetReason.POWER_ON), waits(2.0)),
        )
        for title, cause, fault in (
            ("flash full", "store_full", Fault.STORE_FULL),
            ("parameters of a newer firmware", "store_newer", Fault.STORE_NEWER),
        )
    },
    "battery empty": staged("battery_empty", empties),
    "board unconfirmed": staged("board_unconfirmed", drives(0.5), settings={"board_unwritten": 1}),
    "driver failed": staged("driver_failed", waits(0.5), settings={"driver_failed": 1}),
    "restart asked for": staged("restart_requested", waits(0.5), RESTART, waits(2.0)),
    "restart asked for, then one by itself": staged(
        "restart_requested, restarted_itself",
        *(waits(0.5), RESTART, waits(1.0), resets(ResetReason.SOFTWARE), waits(1.5)),
    ),
}
FROM_REST = {title: one._replace(driving=False) for title, one in _FROM_REST.items()}
RESETS = {
    title: staged(cause, resets(reason), drives(2.0))
    for title, cause, reason in (
        ("brown-out", "brownout", ResetReason.BROWNOUT),
        ("panic", "panic", ResetReason.PANIC),
        ("task watchdog", "task_watchdog", ResetReason.TASK_WATCHDOG),
        ("interrupt watchdog", "interrupt_watchdog", ResetReason.INTERRUPT_WATCHDOG),
        ("power", "power_lost", ResetReason.POWER_ON),
        ("reset pin", "reset_pin", ResetReason.EXTERNAL),
        ("firmware restarts", "restarted_itself", ResetReason.SOFTWARE),
        ("reset that cannot say why", "reset_unknown", ResetReason.UNKNOWN),
    )
}
WHILE_IT_DRIVES: dict[str, Staged] = {
    "encoder dead": staged("encoder_dead", fails("left.encoder_dead"), settings=SUPPLY),
    "encoder dead, right": staged("encoder_dead", fails("right.encoder_dead"), settings=SUPPLY),
    "wheel blocked": staged("wheel_blocked", fails("left.blocked"), settings=SUPPLY),
    "motor's wire off": staged("motor_open", fails("left.motor_open"), settings=SUPPLY),
    "encoder dead, stiff supply": staged(EITHER, fails("left.encoder_dead")),
    "wheel blocked, stiff supply": staged(EITHER, fails("left.blocked")),
    "one channel while it turns": staged(
        "encoder_one_channel", fails("left.stuck_channel"), settings=SUPPLY
    ),
    "late step": staged("control_overrun", sets("control_delay_us", 40_000), drives(0.3)),
    "contact, still open": staged("contact_open", CONTACT, waits(0.02), CLEAR),
    "contact, closed again": staged("contact_open", CONTACT, waits(0.05), sets("estop_open", 0)),
    "estop of this program": staged("estop_by_session", estops),
    "estop of another one": staged("estop_by_stranger", *OTHERS_ESTOP),
    "stop of this program": staged("stop_by_session", stops),
    "stop of another one": staged("stop_by_stranger", *OTHERS_STOP),
    "zero": staged("zero_setpoint", drives(1.0, 0.0)),
    "another session": staged("new_session", hears(HELLO), waits(0.02)),
    "trial": staged("trial_expired", *LEFT_TRIAL, drives(1.0)),
    "program killed": staged("host_killed or recording_cut", closed=False),
    "program frozen": staged("host_frozen", freezes),
    "program pauses": staged("program_paused", waits(1.0)),
    "cable off and on": staged("cable_pulled", lambda robot: robot.pull(2.0), waits(1.0)),
    "port gone": staged("cable_pulled", unplugged),
    "silence to the end": staged("cable_pulled or power_lost", line(cable=False), drives(3.0)),
    "line corrupt": staged("line_corrupt", line(corrupt=True), drives(0.6), line(corrupt=False)),
    "setpoints too late": staged(
        "setpoints_expired", line(delay_us=120_000), drives(1.0, ttl_s=0.1)
    ),
    "link closed while it drives": staged("host_hung_up", hangs_up),
    "robot closed while it drives": staged("stop_by_session", closes),
    "battery low": staged("battery_low", dips, settings={**SUPPLY, **LOW, "brownout_v": 5.7}),
    "battery low, short dip": staged(
        "battery_low", resets(ResetReason.BROWNOUT), drives(2.0), settings=LOW
    ),
    "supply sags": staged("battery_sags", dips, settings={"supply_ohm": 2.0, "brownout_v": 6.0}),
    "fault before reset": staged(
        "encoder_dead, panic, fault_before_reset",
        *(fails("left.encoder_dead"), waits(0.3), resets(ResetReason.PANIC), waits(2.0)),
        settings=SUPPLY,
    ),
    "estop before reset": staged(
        "estop_by_session, panic, estop_before_reset",
        *(estops, waits(0.3), resets(ResetReason.PANIC), waits(2.0)),
    ),
    "unarmed": staged("estop_by_session, unarmed", estops, CLEAR, drives(0.2)),
    "cable off, and the contact meanwhile": staged(
        "contact_open or estop_by_stranger", *out_of_reach(CONTACT)
    ),
    "cable off, and a panic meanwhile": staged("panic", *out_of_reach(resets(ResetReason.PANIC))),
}
TWO_WITHIN_A_SECOND: dict[str, Staged] = {
    "own stop, then the contact": staged(
        "stop_by_session, contact_open", stops, drives(0.3), CONTACT, waits(0.3)
    ),
    "own stop, then another program's": staged(
        "stop_by_session, stop_by_stranger", stops, drives(0.3), *OTHERS_STOP
    ),
    "another program's stop, then an own one": staged(
        "stop_by_stranger, stop_by_session", *OTHERS_STOP, drives(0.3), stops
    ),
    "own e-stop, then the contact": staged(
        "estop_by_session, contact_open",
        *(estops, *CLEARED, drives(0.2), CONTACT, waits(0.3)),
    ),
    "another program's e-stop, then the contact": staged(
        "estop_by_stranger, contact_open",
        *(*OTHERS_ESTOP, *CLEARED, drives(0.2), CONTACT, waits(0.3)),
    ),
    "own stop, twice": staged("stop_by_session, stop_by_session", stops, drives(0.1), stops),
    "another program's stop, twice": staged(
        "stop_by_stranger, stop_by_stranger", *OTHERS_STOP, drives(0.2), *OTHERS_STOP
    ),
    "trial, then an own stop": staged(
        "trial_expired, stop_by_session",
        *(*LEFT_TRIAL, drives(0.35), REVERT, opens, drives(0.1), stops),
    ),
    "fault, then an e-stop": staged(
        "encoder_dead, estop_by_session", fails("left.encoder_dead"), estops, settings=SUPPLY
    ),
    "fault that lasts, then another program's e-stop": staged(
        "driver_failed, estop_by_stranger",
        *(sets("driver_failed"), waits(0.2), asks(ClearFault(0, 0)), *OTHERS_ESTOP),
    ),
    "pause, then frozen": staged("program_paused, host_frozen", waits(0.5), drives(0.2), freezes),
    "another session, then an own stop": staged(
        "new_session, stop_by_session",
        *(hears(HELLO), waits(0.5), opens, drives(0.3), stops),
    ),
    "zero, then a pause": staged("zero_setpoint, program_paused", drives(0.6, 0.0), waits(1.0)),
    "too late, then a pause": staged(
        "setpoints_expired, program_paused",
        *(line(delay_us=120_000), drives(0.6, ttl_s=0.1)),
        *(line(delay_us=0), drives(0.3), waits(0.8)),
    ),
    "own stop, then a panic": staged(
        "stop_by_session, panic", stops, waits(0.1), resets(ResetReason.PANIC), waits(2.0)
    ),
    "panic, then a brown-out": staged(
        "panic, brownout",
        *(resets(ResetReason.PANIC), drives(1.0), resets(ResetReason.BROWNOUT), drives(2.0)),
    ),
}
"""What explains the first does not explain the second."""
STAGED = FROM_REST | RESETS | WHILE_IT_DRIVES | TWO_WITHIN_A_SECOND


def judged(robot: StagedRobot, *, complete: bool = True) -> list[Stop]:
    """The stops that a diagnosis finds in what a robot's tap has seen."""
    diagnosis = Diagnosis()
    found = diagnosis.feed_all(robot.reader.take())
    return found + diagnosis.end(complete=complete)


def diagnosed(staged: Staged, seed: int = 1) -> list[Stop]:
    """The stops that a diagnosis finds in one that was staged."""
    return judged(staged.play(seed), complete=staged.closed)
