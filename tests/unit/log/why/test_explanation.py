"""An error that a driver raises because of a stop carries the stop's sentence."""

from __future__ import annotations

import pickle
import time
import weakref
from collections.abc import Callable
from functools import partial

import pytest

import wheelwire
from support.cases import each
from support.waiting import wait_until
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import (
    DeviceRefused,
    LinkLost,
    ProtocolMismatch,
    Release,
    RequestTimeout,
    WheelwireError,
)
from wheelwire.log.share.wire import decoded_error, encoded_error
from wheelwire.log.why.causes import CAUSES
from wheelwire.log.why.diagnosis import Stop
from wheelwire.log.why.explanation import explain
from wheelwire_protocol.codes import Fault, Held, RefusalCode, SupervisorState

pytestmark = pytest.mark.timeout(60)
PATIENCE_S = 20.0


def mock(*, realtime: bool = False) -> MockDriver:
    robot = wheelwire.open_driver("mock", realtime=realtime)
    assert isinstance(robot, MockDriver)
    return robot


def drive(robot: MockDriver, wait: Callable[[float], object] | None = None) -> None:
    """Until an error ends it."""
    for _ in range(1000):
        robot.set_velocity(0.2, 0.0)
        (wait or robot.advance)(0.005)


def sets(variable: str) -> Callable[[MockDriver], None]:
    def play(robot: MockDriver) -> None:
        robot.simulator.set(variable, 1)
        robot.advance(0.1)

    return play


def estops(robot: MockDriver) -> None:
    robot.estop()
    robot.advance(0.1)


def drives(robot: MockDriver) -> None:
    robot.set_velocity(0.2, 0.0)
    robot.advance(0.05)


def set_rates_that_contradict(robot: MockDriver) -> None:
    robot.parameters.set("stream_rate_hz", 200.0)
    robot.parameters.set("control_rate_hz", 100.0)


ESTOP = "The emergency stop was requested over this link."
REVERSED = "Left wheel's speed grew against its drive."
CONTACT = "The emergency stop's contact opened."
NO_DRIVER = "A motor or encoder peripheral did not start."
MOVING = f"{CAUSES['not_stopped'].sentence}."
CONTRADICT = "Parameters contradict each other."
CODES_THAT_SAY_IT = (RefusalCode.NOT_STOPPED, RefusalCode.CONTRADICTION)
Act = Callable[[MockDriver], object]
REFUSED: list[tuple[Act, Act, RefusalCode, str]] = [
    (estops, drive, RefusalCode.ESTOPPED, ESTOP),
    (sets("left.encoder_reversed"), drive, RefusalCode.FAULT, REVERSED),
    (sets("estop_open"), MockDriver.clear_estop, RefusalCode.CAUSE_PRESENT, CONTACT),
    (sets("driver_failed"), MockDriver.clear_fault, RefusalCode.CAUSE_PRESENT, NO_DRIVER),
    (drives, lambda robot: robot.parameters.save(), RefusalCode.NOT_STOPPED, MOVING),
    (drives, lambda robot: robot.recorder.ledger(), RefusalCode.NOT_STOPPED, MOVING),
    (drives, lambda robot: robot.board.restart(), RefusalCode.NOT_STOPPED, MOVING),
    (lambda _: None, set_rates_that_contradict, RefusalCode.CONTRADICTION, CONTRADICT),
]


@each(("happens", "call", "code", "why"), REFUSED)
def test_what_is_refused_says_why(happens: Act, call: Act, code: RefusalCode, why: str) -> None:
    with mock() as robot:
        happens(robot)
        with pytest.raises(DeviceRefused) as raised:
            call(robot)
    error = raised.value
    assert (error.code, error.why) == (code, why)
    assert error.look_at
    assert str(error).endswith(why) is (code not in CODES_THAT_SAY_IT)
    back = pickle.loads(pickle.dumps(error))  # noqa: S301
    assert (back.why, str(back)) == (error.why, str(error))


def test_a_fault_that_lasts_is_named_when_its_clear_is_refused() -> None:
    with mock() as robot:
        sets("driver_failed")(robot)
        with pytest.raises(DeviceRefused, match="DRIVER_FAILED") as raised:
            robot.clear_fault()
    assert raised.value.evidence[0].startswith("DRIVER_FAILED: ")


LOST = "The connection to the robot was lost."


def test_calls_of_a_lost_robot_and_the_callback_say_what_is_behind_it() -> None:
    lost: list[WheelwireError] = []
    with mock() as robot:
        robot.on_lost = lost.append
        robot.unplug()
        calls: list[Callable[[], object]] = [
            *(partial(setpoint, 0.1, 0.1) for setpoint in (robot.set_velocity, robot.set_duty)),
            *(robot.device_counters, robot.stop, robot.estop, robot.clear_fault),
        ]
        for unreachable in calls:
            with pytest.raises(LinkLost) as raised:
                unreachable()
            assert raised.value.why == LOST
            assert raised.value.evidence
            assert raised.value.look_at == CAUSES["cable_pulled"].look_at
        robot.plug()
        robot.advance(1.0)
        robot.set_velocity(0.1, 0.0)
    assert [error.why for error in lost] == [LOST]


def test_report_and_error_describe_a_watched_stop_alike() -> None:
    reported: list[Stop] = []
    with mock(realtime=True) as robot:
        robot.simulator.set("supply_ohm", 0.4)
        robot.watch_stops(reported.append)
        end_s = time.monotonic() + 1.0
        while time.monotonic() < end_s:
            robot.set_velocity(0.2, 0.0)
            time.sleep(0.02)
        robot.simulator.set("left.blocked", 1)
        with pytest.raises(DeviceRefused) as raised:  # at once, before the stop is reported
            drive(robot, time.sleep)
        wait_until(lambda: bool(reported), PATIENCE_S)
        with pytest.raises(DeviceRefused) as later:
            robot.set_velocity(0.2, 0.0)
    (stop,) = reported
    assert raised.value.why == later.value.why == stop.sentence
    assert stop.sentence.startswith("Left wheel")


def test_a_cleared_stop_is_no_longer_reported() -> None:
    with mock(realtime=True) as robot:
        watch = robot.watch_stops(lambda _: None)
        robot.estop()
        with pytest.raises(DeviceRefused) as raised:
            robot.set_velocity(0.1, 0.0)
        assert raised.value.why == f"{CAUSES['estop_by_session'].sentence}."
        robot.clear_estop()
        while robot.read().state is SupervisorState.ESTOPPED:
            pass
        assert watch.latched() is None
        watch.close()
        robot.estop()
        wait_until(lambda: robot.held_by is not None and Held.ESTOP in robot.held_by)
        with pytest.raises(DeviceRefused) as raised:
            robot.set_velocity(0.1, 0.0)
        # No program watches: the robot's own report is all there is.
        assert raised.value.evidence == (f"ESTOPPED: {RefusalCode.ESTOPPED.doc}",)
        assert raised.value.why == f"{CAUSES['estop_by_session'].sentence}."


def explained(error: WheelwireError) -> WheelwireError:
    explain(error, None)
    return error


@each("code", set(RefusalCode) - {RefusalCode.NONE})
def test_every_refusal_has_its_sentence_its_evidence_and_what_to_look_at(code: RefusalCode) -> None:
    faults = Fault.LEFT_REVERSED if code is RefusalCode.FAULT else Fault(0)
    error = explained(DeviceRefused(code, "the request", faults))
    assert error.why.endswith(".")
    assert error.evidence[-1] == f"{code.name}: {code.doc}"
    assert error.look_at


@each(
    "error",
    [
        RequestTimeout("late"),
        LinkLost("not opened yet"),
        WheelwireError("other"),
        DeviceRefused(250, "the setpoint"),  # a code of a later firmware
    ],
)
def test_an_error_that_no_stop_is_behind_says_nothing(error: WheelwireError) -> None:
    assert (explained(error).why, error.evidence, error.look_at) == ("", (), "")


def test_a_hello_of_another_release_is_named() -> None:
    error = ProtocolMismatch(Release(1, 2, "0.1.0"), Release(3, 4, "0.2.0"))
    assert explained(error).why == "Host and firmware are of different releases."
    assert error.evidence == (str(error),)


def test_what_is_behind_a_lost_link_reaches_a_program_that_is_attached() -> None:
    error = LinkLost("gone", causes=("cable_pulled", "power_lost"))
    received = decoded_error(encoded_error(error))
    assert isinstance(received, LinkLost)
    assert received.causes == error.causes
    assert explained(received).why == explained(error).why != ""


def test_a_forgotten_driver_is_closed_although_it_explains_errors() -> None:
    robot = mock()
    robot.on_lost = print
    known = weakref.ref(robot)
    del robot
    assert known() is None
