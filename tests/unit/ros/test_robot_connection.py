"""Sessions as the node sees them, with a robot that writes down what it receives."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from support.cases import each
from wheelwire import (
    BaseDriver,
    DeviceRefused,
    DifferentialDrive,
    Expired,
    InvalidCommand,
    LinkLost,
    RequestTimeout,
    Twist,
)
from wheelwire_protocol.codes import RefusalCode
from wheelwire_ros.robot_connection import CommandIgnored, Ignored, RobotConnection, Tuning
from wheelwire_ros.speed_limiter import FIRST_STEP_S, AxisLimits, Limits

GIVEN = {"proportional_gain": 2.0, "wheel_radius": 0.04}


class RecordingRobot:
    """Only what a connection uses of a driver."""

    def __init__(self) -> None:
        self.told: list[Any] = []
        self.values = {"proportional_gain": 1.0, "integral_gain": 16.0, "wheel_radius": 0.033}
        self.geometry = DifferentialDrive(0.2, 0.033, 360)
        self.sessions = 1
        self.ttl_max_s: float | None = None
        self.error: Exception | None = None
        self.parameters = self
        self.has_device = True
        self.info: Any = SimpleNamespace(device=SimpleNamespace(boot_id=0))
        self.is_unarmed = False

    def __getitem__(self, name: str) -> float:
        if self.error is not None:
            raise self.error
        return self.values[name]

    def set(self, name: str, value: float) -> float:
        self._tell((name, value))
        self.values[name] = value
        return value

    def set_all(self, values: dict[str, float]) -> None:
        for name, value in values.items():
            self.set(name, value)

    def set_wheel_velocity(self, left: float, right: float, ttl: float, *, stamp: float) -> None:
        if time.monotonic() >= stamp + ttl:
            raise Expired("the time to live has run out")
        self._tell(("drive", left, right, stamp + ttl))

    def estop(self) -> None:
        self._tell("estop")

    def clear_estop(self) -> None:
        self._tell("clear_estop")

    def clear_fault(self) -> None:
        self._tell("clear_fault")

    def save(self) -> None:
        self._tell("save")

    def stop(self) -> None:
        self._tell("stop")

    def _tell(self, what: Any) -> None:
        if self.error is not None:
            raise self.error
        self.told.append(what)


class Clock:
    """The monotonic clock."""

    def __init__(self) -> None:
        self.now_s = time.monotonic()

    def monotonic(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(time, "monotonic", clock.monotonic)
    return clock


class Connection(RobotConnection):
    """To a robot that writes down what it receives."""

    robot: RecordingRobot  # type: ignore[assignment]

    def __init__(self) -> None:
        super().__init__(cast("BaseDriver", RecordingRobot()), dict(GIVEN), Tuning(), lambda: None)
        self.active = True
        self.follow()
        self.robot.told.clear()

    def begin_session(self) -> None:
        """The link was lost and is back."""
        self.robot.sessions += 1
        self.follow()


@pytest.fixture
def connection() -> Connection:
    return Connection()


def ignored(connection: Connection, born_s: float | None = None) -> Ignored:
    """Why a command is not obeyed."""
    with pytest.raises(CommandIgnored) as error:
        connection.command(Twist(0.2, 0), time.monotonic() if born_s is None else born_s)
    return error.value.reason


def test_a_command_lives_no_longer_than_the_robot_takes(connection: Connection) -> None:
    connection.connected_s = 0
    connection.robot.ttl_max_s = 0.3
    born_s = time.monotonic()
    connection.command(Twist(0.2, 0.0), born_s)
    assert connection.robot.told[-1][-1] == born_s + 0.3


def test_a_command_becomes_one_setpoint_with_the_rest_of_its_life(connection: Connection) -> None:
    connection.connected_s = 0
    born_s = time.monotonic() - 0.2
    connection.command(Twist(0.2, 1.0), born_s)
    ((_, left, right, end_s),) = connection.robot.told
    assert (left, right) == pytest.approx((0.1, 0.3))
    assert end_s == born_s + 0.5
    assert connection.obeyed == 1


@pytest.mark.parametrize("connected_s", [0.0, 1e9])
@pytest.mark.parametrize("age_s", [0.5, 0.6, 1e9])
def test_a_command_older_than_the_timeout_is_stale_whenever_the_session_began(
    connection: Connection, age_s: float, connected_s: float
) -> None:
    connection.connected_s = connected_s
    assert ignored(connection, time.monotonic() - age_s) is Ignored.STALE
    assert connection.robot.told == []


@each(
    ("error", "reason"),
    [
        (InvalidCommand("left = nan: give a finite number"), Ignored.INVALID),
        (DeviceRefused(RefusalCode.UNARMED, "the setpoint"), Ignored.UNARMED),
        (DeviceRefused(RefusalCode.EXPIRED, "the setpoint"), Ignored.REFUSED),
        (LinkLost("gone"), Ignored.OUT_OF_REACH),
    ],
)
def test_nothing_is_kept_of_a_command_that_is_not_sent(error: Exception, reason: Ignored) -> None:
    connection = Connection()
    connection.robot.error = error
    assert ignored(connection) is reason
    connection.robot.error = None
    connection.begin_session()
    assert connection.robot.told == list(GIVEN.items())  # no zero of the node's own either


def test_a_new_session_gets_the_parameters_and_the_estop_before_any_command(
    connection: Connection,
) -> None:
    connection.estop()
    connection.robot.told.clear()
    connection.begin_session()
    assert connection.robot.told == ["estop", *GIVEN.items()]
    assert ignored(connection) is Ignored.ESTOPPED
    connection.clear_estop()
    connection.command(Twist(0.2, 0), time.monotonic())
    assert connection.robot.told[-2:-1] == ["clear_estop"]


def test_a_command_of_the_previous_session_is_not_replayed(connection: Connection) -> None:
    born_s = time.monotonic()
    connection.robot.sessions += 1
    assert ignored(connection, born_s) is Ignored.BEFORE_RECONNECT
    assert connection.robot.told == []
    connection.follow()
    assert ignored(connection, born_s) is Ignored.BEFORE_RECONNECT
    assert connection.robot.told == list(GIVEN.items())
    connection.command(Twist(0.2, 0), time.monotonic())


def test_a_robot_that_does_not_take_its_parameters_is_not_driven(connection: Connection) -> None:
    connection.robot.sessions += 1
    connection.robot.error = DeviceRefused(RefusalCode.OUT_OF_RANGE, "ParameterSet")
    with pytest.raises(DeviceRefused):
        connection.follow()
    assert ignored(connection) is Ignored.REFUSED
    assert connection.problem is connection.robot.error
    assert connection.robot.told == []
    connection.robot.error = None
    connection.follow()
    assert connection.problem is None


def test_a_loss_during_the_preparation_is_no_problem_of_the_session(connection: Connection) -> None:
    connection.robot.sessions += 1
    connection.robot.error = LinkLost("the device has not answered yet")
    with pytest.raises(LinkLost):
        connection.follow()
    assert connection.problem is None
    assert ignored(connection) is Ignored.BEFORE_RECONNECT
    assert connection.robot.told == []
    connection.robot.error = None
    connection.follow()
    drive(connection, Twist(0.4, 0.0))


def test_an_estop_that_did_not_arrive_is_reported_later(connection: Connection) -> None:
    connection.robot.error = LinkLost("gone")
    with pytest.raises(LinkLost):
        connection.estop()
    connection.robot.error = None
    assert ignored(connection) is Ignored.ESTOPPED
    connection.begin_session()
    assert connection.robot.told[0] == "estop"


def test_an_unacknowledged_estop_is_sent_again_in_the_same_session(connection: Connection) -> None:
    connection.robot.error = RequestTimeout("no answer")
    with pytest.raises(RequestTimeout):
        connection.estop()
    connection.robot.error = None
    connection.follow()
    assert connection.robot.told[0] == "estop"


@pytest.mark.parametrize("first", ["estop", "clear_estop"])
def test_an_estop_that_is_set_while_one_is_cleared_holds(
    connection: Connection, monkeypatch: pytest.MonkeyPatch, first: str
) -> None:
    """By another thread: whichever of the two the robot got first, it ends latched."""
    connection.estop()
    clear = connection.robot.clear_estop

    def interrupted() -> None:
        if first == "clear_estop":
            clear()
        connection.estop()
        if first == "estop":
            clear()

    monkeypatch.setattr(connection.robot, "clear_estop", interrupted)
    connection.clear_estop()
    assert connection.estopped
    assert connection.robot.told[-1] == "estop"
    assert ignored(connection) is Ignored.ESTOPPED


def test_an_estop_that_is_cleared_while_a_new_session_sets_it_again_is_cleared(
    connection: Connection, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not set again behind the clear, by a node that then says that it is cleared."""
    connection.estop()
    connection.robot.told.clear()
    estop, sets, goes_on = connection.robot.estop, threading.Event(), threading.Event()

    def slow() -> None:
        sets.set()
        assert goes_on.wait(10)
        estop()

    monkeypatch.setattr(connection.robot, "estop", slow)
    connection.robot.sessions += 1
    following = threading.Thread(target=connection.follow)
    following.start()
    assert sets.wait(10)
    clearing = threading.Thread(target=connection.clear_estop)
    clearing.start()
    clearing.join(0.1)  # which is more than enough for one that does not wait
    goes_on.set()
    following.join(10)
    clearing.join(10)
    assert [one for one in connection.robot.told if one in ("estop", "clear_estop")] == [
        "estop",
        "clear_estop",
    ]
    assert not connection.estopped
    assert connection.is_prepared


def test_no_command_is_sent_after_the_deactivation(
    connection: Connection, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another thread deactivates while a command is in flight: the stop comes after it."""
    send = connection.robot.set_wheel_velocity
    threads = []

    def deactivate() -> None:
        connection.deactivate()
        connection.stop()

    def interrupted(*velocity: float, stamp: float) -> None:
        threads.append(threading.Thread(target=deactivate))
        threads[0].start()
        threads[0].join(0.1)  # as far as it gets
        send(*velocity, stamp=stamp)

    monkeypatch.setattr(connection.robot, "set_wheel_velocity", interrupted)
    connection.command(Twist(0.2, 0), time.monotonic())
    threads[0].join()
    assert connection.robot.told[-1] == "stop"


def test_an_inactive_node_drives_nothing(connection: Connection) -> None:
    connection.active = False
    assert ignored(connection) is Ignored.INACTIVE
    assert connection.robot.told == []


def test_the_calibrated_geometry_is_computed_at_changes_only(connection: Connection) -> None:
    drive = connection.drive
    connection.command(Twist(0.2, 0.0), time.monotonic())
    assert connection.drive is drive
    connection.tuning = Tuning(
        separation_multiplier=1.1, left_radius_multiplier=0.9, right_radius_multiplier=1.05
    )
    assert connection.drive.wheel_separation == pytest.approx(0.22)
    assert connection.drive.left_radius_multiplier == 0.9
    assert connection.drive.right_radius_multiplier == 1.05
    connection.robot.geometry = DifferentialDrive(0.3, 0.033, 360)
    assert connection.drive.wheel_separation == pytest.approx(0.33)


def drive(connection: Connection, twist: Twist) -> Twist:
    return connection.command(twist, time.monotonic())


def test_a_limit_of_the_wheels_speed_scales_both_by_one_factor(connection: Connection) -> None:
    connection.tuning = Tuning(max_wheel_radps=10.0)  # 0.33 m/s at the rim
    assert drive(connection, Twist(0.4, 2.6)) == pytest.approx((0.2, 1.3))
    assert connection.robot.told[-1][1:3] == pytest.approx((0.07, 0.33))


ACCELERATION = Tuning(limits=Limits(AxisLimits(max_acceleration=1.0), AxisLimits()))


def test_a_command_is_limited_but_a_stop_is_not(connection: Connection) -> None:
    connection.tuning = ACCELERATION
    for _ in range(3):
        assert 0 < drive(connection, Twist(0.4, 0.0)).linear_mps < 0.4
    assert drive(connection, Twist(0.0, 0.0)) == (0.0, 0.0)
    assert connection.robot.told[-1][1:3] == (0.0, 0.0)


def estop_and_clear(connection: Connection) -> None:
    connection.estop()
    connection.clear_estop()


def be_refused(connection: Connection) -> None:
    connection.robot.error = DeviceRefused(RefusalCode.EXPIRED, "the setpoint")
    assert ignored(connection) is Ignored.REFUSED
    connection.robot.error = None


@pytest.mark.parametrize(
    "happen",
    [
        Connection.stop,
        Connection.note_standstill,
        Connection.clear_estop,  # one that was set elsewhere
        Connection.clear_fault,
        estop_and_clear,
        be_refused,
        Connection.begin_session,
    ],
)
def test_after_a_stop_the_acceleration_begins_at_zero(
    connection: Connection, happen: Callable[[Connection], None]
) -> None:
    drive(connection, Twist(0.4, 0.0))
    connection.tuning = ACCELERATION
    happen(connection)
    assert drive(connection, Twist(0.4, 0.0)).linear_mps == pytest.approx(FIRST_STEP_S)


@pytest.mark.parametrize("what", ["clear_fault", "save"])
def test_a_new_session_is_prepared_before_anything_else(connection: Connection, what: str) -> None:
    connection.robot.sessions += 1
    actions = {"clear_fault": connection.clear_fault, "save": connection.save_parameters}
    actions[what]()
    assert connection.robot.told == [*GIVEN.items(), what]


def test_no_parameter_is_set_before_a_new_session_is_prepared(connection: Connection) -> None:
    connection.robot.sessions += 1
    with pytest.raises(LinkLost, match="try again"):
        connection.set_parameters({"integral_gain": 1.0})
    assert connection.robot.told == []
    connection.follow()
    connection.set_parameters({"integral_gain": 1.0})
    assert connection.robot.told[-1] == ("integral_gain", 1.0)


def test_a_command_whose_life_ends_while_it_is_handed_over_is_stale(
    clock: Clock, connection: Connection, monkeypatch: pytest.MonkeyPatch
) -> None:
    """This process was suspended between two of its lines."""
    clock.now_s += 1
    send = connection.robot.set_wheel_velocity

    def frozen(*velocity: float, stamp: float) -> None:
        clock.now_s += 10
        send(*velocity, stamp=stamp)

    monkeypatch.setattr(connection.robot, "set_wheel_velocity", frozen)
    assert ignored(connection, clock.now_s) is Ignored.STALE
    assert connection.robot.told == []
    assert connection.obeyed == 0


def test_a_program_that_keeps_commanding_does_not_drive_a_restarted_device(
    clock: Clock, connection: Connection
) -> None:
    connection.tuning = replace(connection.tuning, rearm_gap_s=0.5)

    def begin(boot_id: int) -> None:
        connection.robot.info = SimpleNamespace(device=SimpleNamespace(boot_id=boot_id))
        connection.robot.sessions += 1
        connection.follow()
        connection.robot.told.clear()

    connection.connected_s = 0.0
    for holds, ends in enumerate(("zero", "gap"), 1):
        begin(holds)
        for _ in range(20):
            clock.now_s += 0.1
            assert ignored(connection, clock.now_s) is Ignored.UNARMED
        with pytest.raises(CommandIgnored, match="held: unarmed"):
            connection.command(
                Twist(0.0, 0.5), clock.now_s
            )  # turning on the spot is not a standstill
        assert connection.is_held
        assert connection.holds == holds
        assert connection.robot.told == []
        if ends == "zero":
            connection.command(Twist(0.0, 0.0), clock.now_s)
        else:
            clock.now_s += 0.6
        connection.command(Twist(0.2, 0.0), clock.now_s)
        assert connection.robot.told[-1][:3] == ("drive", 0.2, 0.2)
        assert not connection.is_held


def test_a_hold_lasts_until_the_robot_says_that_it_obeys(connection: Connection) -> None:
    connection.robot.error = DeviceRefused(RefusalCode.UNARMED, "the setpoint")
    connection.robot.is_unarmed = True
    assert ignored(connection) is Ignored.UNARMED
    connection.robot.error = None
    connection.command(Twist(0.2, 0.0), time.monotonic())  # its refusal has not arrived yet
    assert connection.is_held
    connection.robot.is_unarmed = False
    connection.command(Twist(0.0, 0.0), time.monotonic())
    assert not connection.is_held
    assert connection.holds == 1


def test_the_same_device_is_driven_on_in_its_next_session(connection: Connection) -> None:
    connection.tuning = replace(connection.tuning, rearm_gap_s=0.5)
    connection.begin_session()
    connection.command(Twist(0.2, 0.0), time.monotonic())
    assert connection.robot.told[-1][:3] == ("drive", 0.2, 0.2)


SLOW = Limits(linear=AxisLimits(max_acceleration=1.0))
"""A tenth of a metre per second more in each tenth of a second."""


def test_the_next_command_starts_from_what_the_wheels_could_do(
    clock: Clock, connection: Connection
) -> None:
    connection.robot.geometry = replace(connection.robot.geometry, max_velocity_mps=0.1)
    connection.command(Twist(0.4, 0.0), clock.now_s)  # without limits of the node's own
    connection.tuning = replace(connection.tuning, limits=SLOW)
    connection.robot.geometry = replace(connection.robot.geometry, max_velocity_mps=1.0)
    clock.now_s += 0.1
    assert connection.command(Twist(0.4, 0.0), clock.now_s).linear_mps == pytest.approx(0.2)


@pytest.mark.parametrize(("age_s", "goes_on"), [(0.0, True), (0.45, False)])
def test_a_command_counts_until_the_end_of_its_life(
    clock: Clock, connection: Connection, age_s: float, goes_on: bool
) -> None:
    connection.connected_s = 0.0
    connection.command(Twist(0.4, 0.0), clock.now_s - age_s)
    connection.tuning = replace(connection.tuning, limits=SLOW)
    clock.now_s += 0.1  # the older one has ended, and with it the drive
    obeyed = connection.command(Twist(0.5, 0.0), clock.now_s)
    assert obeyed.linear_mps == pytest.approx(0.5 if goes_on else FIRST_STEP_S)


def test_an_estop_that_was_cleared_before_it_could_be_sent_again_holds_nobody(
    connection: Connection,
) -> None:
    connection.estop()
    connection.robot.sessions += 1
    connection.robot.error = LinkLost("the device no longer knows this session")
    with pytest.raises(LinkLost):
        connection.follow()
    connection.robot.error = None
    connection.clear_estop()
    connection.follow()
    assert connection.is_prepared
    connection.command(Twist(0.2, 0.0), time.monotonic())
    assert connection.robot.told[-1][:3] == ("drive", 0.2, 0.2)
