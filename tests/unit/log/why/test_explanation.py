"""An error that a driver raises because of a stop carries the stop's sentence."""

from __future__ import annotations

import asyncio
import pickle
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable

import pytest

import wheelwire
from support.cases import each
from support.waiting import wait_until
from wheelwire import aio
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


def drive(robot: MockDriver, wait: Callable[[float], object]) -> None:
    """Until an error ends it."""
    for _ in range(1000):
        robot.set_velocity(0.2, 0.0)
        wait(0.005)


def test_a_latched_estop_names_who_latched_it() -> None:
    with mock() as robot:
        robot.estop()
        robot.advance(0.1)
        with pytest.raises(DeviceRefused) as raised:
            robot.set_velocity(0.2, 0.0)
    assert raised.value.why == "The emergency stop was requested over this link."
    assert str(raised.value).endswith(raised.value.why)
    back = pickle.loads(pickle.dumps(raised.value))  # noqa: S301
    assert (back.why, str(back)) == (raised.value.why, str(raised.value))


def test_a_fault_names_its_wheel() -> None:
    with mock() as robot:
        robot.simulator.set("left.encoder_reversed", 1)
        with pytest.raises(DeviceRefused) as raised:
            drive(robot, robot.advance)
    assert raised.value.code == RefusalCode.FAULT
    assert raised.value.why == "Left wheel's speed grew against its drive."


def test_a_lost_link_says_what_may_be_behind_it() -> None:
    with mock() as robot:
        robot.unplug()
        with pytest.raises(LinkLost) as raised:
            robot.set_velocity(0.1, 0.0)
        assert raised.value.why == "The connection to the robot was lost."
        with pytest.raises(LinkLost) as raised:
            robot.set_duty(0.1, 0.1)
        assert raised.value.why == "The connection to the robot was lost."
        robot.plug()
        robot.advance(1.0)
        robot.set_velocity(0.1, 0.0)


async def test_asyncio_has_it_too() -> None:
    async with aio.open_driver("mock", realtime=False) as robot:
        robot.unplug()
        with pytest.raises(LinkLost) as raised:
            robot.set_velocity(0.1, 0.0)
    assert raised.value.why == "The connection to the robot was lost."


def test_report_and_error_describe_a_watched_stop_alike() -> None:
    reported: list[Stop] = []
    told = threading.Event()

    def report(stop: Stop) -> None:
        reported.append(stop)
        told.set()

    with mock(realtime=True) as robot:
        robot.simulator.set("supply_ohm", 0.4)
        robot.watch_stops(report)
        end_s = time.monotonic() + 1.0
        while time.monotonic() < end_s:
            robot.set_velocity(0.2, 0.0)
            time.sleep(0.02)
        robot.simulator.set("left.blocked", 1)
        with pytest.raises(DeviceRefused) as raised:  # at once, before the stop is reported
            drive(robot, time.sleep)
        assert told.wait(PATIENCE_S)
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


def test_an_error_that_no_stop_is_behind_says_nothing() -> None:
    for error in (RequestTimeout("late"), LinkLost("not opened yet"), WheelwireError("other")):
        assert (explained(error).why, error.evidence, error.look_at) == ("", (), "")


def test_a_code_of_a_later_firmware_says_nothing() -> None:
    assert explained(DeviceRefused(250, "the setpoint")).why == ""


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


# --- requests and callbacks --------------------------------------------------------------------


def test_a_refused_clear_names_the_cause() -> None:
    with mock() as robot:
        robot.simulator.set("estop_open", 1)
        robot.advance(0.1)
        with pytest.raises(DeviceRefused) as raised:
            robot.clear_estop()
        assert raised.value.code == RefusalCode.CAUSE_PRESENT
        assert raised.value.why == "The emergency stop's contact opened."
        assert str(raised.value).endswith(raised.value.why)
        assert raised.value.look_at == CAUSES["contact_open"].look_at
        robot.simulator.set("estop_open", 0)
        robot.clear_estop()


def test_a_fault_that_lasts_is_named_when_its_clear_is_refused() -> None:
    with mock() as robot:
        robot.simulator.set("driver_failed", 1)
        robot.advance(0.1)
        with pytest.raises(DeviceRefused) as raised:
            robot.clear_fault()
    assert raised.value.why == "A motor or encoder peripheral did not start."
    assert raised.value.evidence[0].startswith("DRIVER_FAILED: ")
    assert "DRIVER_FAILED" in str(raised.value)


def test_requests_of_parameters_and_boards_say_why_they_are_refused() -> None:
    with mock() as robot:
        robot.set_velocity(0.2, 0.0)
        robot.advance(0.05)
        for refused in (robot.parameters.save, robot.recorder.ledger, robot.board.restart):
            with pytest.raises(DeviceRefused) as raised:
                refused()
            assert raised.value.code == RefusalCode.NOT_STOPPED
            assert raised.value.why == f"{CAUSES['not_stopped'].sentence}."
            assert raised.value.why not in str(raised.value)  # the code's text says the same
        robot.stop()
        robot.advance(2.0)  # until the wheels stand
        robot.parameters.set("stream_rate_hz", 200.0)
        with pytest.raises(DeviceRefused) as raised:
            robot.parameters.set("control_rate_hz", 100.0)
        assert raised.value.why == "Parameters contradict each other."


def test_a_request_of_a_lost_robot_and_the_callback_say_what_is_behind_it() -> None:
    lost: list[WheelwireError] = []
    with mock() as robot:
        robot.on_lost = lost.append
        robot.unplug()
        for unreachable in (robot.device_counters, robot.stop, robot.estop, robot.clear_fault):
            with pytest.raises(LinkLost) as raised:
                unreachable()
            assert raised.value.why == "The connection to the robot was lost."
            assert raised.value.evidence
            assert raised.value.look_at == CAUSES["cable_pulled"].look_at
    assert [error.why for error in lost] == ["The connection to the robot was lost."]


async def test_asyncio_says_it_of_requests_and_to_its_callback() -> None:
    told: list[str] = []
    async with aio.open_driver("mock", realtime=False) as robot:
        robot.on_lost = lambda error: told.append(error.why)
        robot.simulator.set("estop_open", 1)
        robot.advance(0.1)
        with pytest.raises(DeviceRefused) as refused:
            await robot.clear_estop()
        robot.unplug()
        with pytest.raises(LinkLost) as raised:
            await robot.stop()
        while not told:  # the callback is a task of its own
            await asyncio.sleep(0.001)
    assert refused.value.why == "The emergency stop's contact opened."
    assert told == [raised.value.why] == ["The connection to the robot was lost."]


def test_a_forgotten_driver_is_closed_although_it_explains_errors() -> None:
    robot = mock()
    robot.on_lost = print
    known = weakref.ref(robot)
    del robot
    assert known() is None


def test_drivers_start_without_diagnosis() -> None:
    code = (
        "import sys, wheelwire.drivers.serial, wheelwire.drivers.mock;"
        "sys.exit('wheelwire.log.why' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_an_error_imports_the_table_alone() -> None:
    code = (
        "import sys, wheelwire.log.why.explanation;"
        "slow = ('log.reader', 'link.session');"
        "sys.exit(any(f'wheelwire.{name}' in sys.modules for name in slow))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
