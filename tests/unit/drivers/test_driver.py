"""The serial driver against the core on a pseudo-terminal, in real time."""

import math
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import cast

import pytest

from support.core_device import BOARD_ID, CoreDevice
from support.processes import interruptible
from support.pty_device import PtyDevice
from support.waiting import stop_and_stand, wait_until
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.transports import SerialTransport
from wheelwire_protocol.codes import SupervisorState
from wheelwire_protocol.parameters import PARAMETER_BY_ID, PARAMETER_BY_NAME
from wheelwire_protocol.types import (
    ParameterGet,
    ParameterSave,
    ParameterSet,
    ParameterValue,
    SetDuty,
    SetWheelVelocity,
    Stop,
)


@pytest.fixture
def driver(device: PtyDevice) -> Iterator[SerialDriver]:
    with SerialDriver(str(device.path)) as driver:
        device.device.forget()
        yield driver


def test_a_duty_arrives_in_q15(device: PtyDevice, driver: SerialDriver) -> None:
    driver.set_duty(-1.0, 0.5)
    wait_until(lambda: bool(device.device.obeyed))
    setpoint = device.device.obeyed[0]
    assert isinstance(setpoint, SetDuty)
    assert (setpoint.left_duty_q15, setpoint.right_duty_q15) == (-32767, 16384)


def test_an_overflow_is_no_command(driver: SerialDriver) -> None:
    driver.parameters.set("wheel_separation", 5)
    with pytest.raises(errors.InvalidCommand):
        driver.set_velocity(1.7e308, 1.7e308)


def test_an_endless_time_to_live_fits_the_wire(device: PtyDevice, driver: SerialDriver) -> None:
    device.device.edits[ParameterValue] = {"value": 3e38}
    driver.parameters.refresh("ttl_max_s")
    driver.set_velocity(0.1, 0.0, ttl=1e38)
    wait_until(lambda: bool(device.device.obeyed))


@pytest.mark.parametrize("end", ["exit", "interrupt"])
def test_the_end_of_the_program_stops_the_robot(device: PtyDevice, end: str) -> None:
    program = (
        "import sys, time, wheelwire\n"
        "robot = wheelwire.open_driver('serial', port=sys.argv[1])\n"
        "robot.set_velocity(0.2, 0.0, ttl=1)\n"
        # A signal that comes just before a sleep is handled after it: many short ones.
        "for _ in range(3 if sys.argv[2] == 'exit' else 600):\n"
        "    time.sleep(0.1)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program, str(device.path), end],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stderr=subprocess.DEVNULL,
        preexec_fn=interruptible,
    )
    wait_until(lambda: device.device.supervisor is SupervisorState.DRIVING)
    if end == "interrupt":
        process.send_signal(signal.SIGINT)
    process.wait(60)
    assert device.device.count(Stop) > 0
    assert device.device.supervisor is SupervisorState.IDLE


def test_the_geometry_is_the_devices_and_follows_it(tmp_path: Path) -> None:
    device = CoreDevice(wheel_separation=0.3)
    with PtyDevice(tmp_path / "robot", device) as pty, SerialDriver(str(pty.path)) as driver:
        assert driver.geometry.wheel_separation == 0.3
        assert driver.geometry.wheel_radius == 0.033
        driver.parameters.set("max_velocity_mps", 0.15)
        assert driver.geometry.max_velocity_mps == 0.15
        device.forget()
        driver.set_velocity(0.3, 0.0)
        wait_until(lambda: bool(device.obeyed))
        assert isinstance(device.obeyed[0], SetWheelVelocity)
        assert device.obeyed[0].left_mps == pytest.approx(0.15)
        stop_and_stand(driver)
        driver.parameters.reset()
        assert driver.geometry.wheel_separation == 0.3
        assert driver.geometry.max_velocity_mps == 0.4


def test_parameters_are_listed_and_saved_by_name(device: PtyDevice, driver: SerialDriver) -> None:
    parameters = driver.parameters
    info = next(info for info in parameters.list() if info.name == "ttl_max_s")
    assert (info.default, info.minimum, info.maximum, info.unit) == (1.0, 0.02, 5.0, "s")
    parameters.save()
    parameters.save("integral_gain")
    with pytest.raises(errors.UnknownParameter):
        parameters.save("integral_gian")
    saved = [m.parameter for m in device.device.asked(ParameterSave)]
    assert saved == [0, PARAMETER_BY_NAME["integral_gain"].id]


def asked(device: PtyDevice) -> list[str]:
    """The parameters that the device was asked for, by name; forgets them."""
    gets = [PARAMETER_BY_ID[m.parameter].name for m in device.device.asked(ParameterGet)]
    device.device.received.clear()
    return gets


def test_parameters_are_a_mapping(device: PtyDevice, driver: SerialDriver) -> None:
    parameters = driver.parameters
    assert isinstance(parameters, Mapping)
    asked(device)
    assert list(parameters) == list(PARAMETER_BY_NAME)
    assert len(parameters) == len(PARAMETER_BY_NAME)
    assert "integral_gain" in parameters
    assert "integral_gian" not in parameters
    assert cast("str", 3) not in parameters
    assert parameters.get("integral_gian") is None
    assert parameters.get("integral_gian", 4.0) == 4.0
    assert asked(device) == []
    assert parameters.get("integral_gain", 4.0) == parameters["integral_gain"] != 4.0
    assert dict(parameters) == {i.name: i.value for i in parameters.list()} == parameters
    with pytest.raises(KeyError) as error:
        parameters["integral_gian"]
    assert str(error.value).startswith("no parameter is called")
    assert not hasattr(parameters, "__setitem__")


def test_a_value_that_is_known_in_this_session_is_not_asked_for(
    device: PtyDevice, driver: SerialDriver
) -> None:
    parameters = driver.parameters
    asked(device)
    assert parameters["wheel_radius"] == 0.033  # read when the session was opened
    assert asked(device) == []
    gain = parameters["integral_gain"]
    assert asked(device) == ["integral_gain"]
    assert parameters["integral_gain"] == gain
    parameters.set("path_gain", 2.5)
    assert parameters["path_gain"] == 2.5
    assert dict(parameters)["path_gain"] == 2.5
    assert asked(device) == []  # setting one has listed all, for their bounds


def test_refreshing_asks_for_one_value_or_for_all(device: PtyDevice, driver: SerialDriver) -> None:
    parameters = driver.parameters
    gain = parameters["integral_gain"]
    device.device.edits[ParameterValue] = {"value": gain / 2}
    assert parameters["integral_gain"] == gain
    asked(device)
    parameters.refresh("integral_gain")
    assert asked(device) == ["integral_gain"]
    assert parameters["integral_gain"] == gain / 2
    parameters.refresh()
    assert asked(device) == list(PARAMETER_BY_NAME)
    with pytest.raises(errors.UnknownParameter):
        parameters.refresh("integral_gian")


def test_a_new_session_voids_the_known_values(device: PtyDevice, driver: SerialDriver) -> None:
    gain = driver.parameters["integral_gain"]
    device.device.parameters["integral_gain"] = gain / 2
    device.device.reset()
    wait_until(lambda: driver.sessions == 2 and driver.is_open)
    assert driver.parameters["integral_gain"] == gain / 2
    device.unplug()
    wait_until(lambda: not driver.is_open)
    with pytest.raises(errors.LinkLost):
        driver.parameters["integral_gain"]
    with pytest.raises(errors.LinkLost):
        driver.parameters.get("integral_gain", 1.0)
    assert "integral_gain" in driver.parameters


def test_a_value_whose_change_was_not_answered_is_asked_for_again(
    device: PtyDevice, driver: SerialDriver
) -> None:
    parameters, core = driver.parameters, device.device
    gain = parameters["integral_gain"]
    parameters.list()
    core.lost = {ParameterSet}
    with pytest.raises(errors.RequestTimeout):
        parameters.set("integral_gain", gain / 2)
    core.lost = set()
    assert parameters["integral_gain"] == gain / 2
    asked(device)
    assert parameters["integral_gain"] == gain / 2
    assert asked(device) == []


def test_a_wrong_parameter_reaches_no_device(device: PtyDevice, driver: SerialDriver) -> None:
    with pytest.raises(errors.UnknownParameter, match="did you mean wheel_radius"):
        driver.parameters["wheel_radios"]
    for name, value, said in (
        ("wheel_radius", 7, "wheel_radius = 7.*at most 1"),
        ("wheel_radius", 0, "at least"),
        ("wheel_radius", math.nan, "finite"),
        ("counts_per_revolution", 360.5, "whole"),
    ):
        with pytest.raises(errors.ParameterOutOfRange, match=said):
            driver.parameters.set(name, value)
    assert device.device.count(ParameterSet) == 0


def test_link_information_and_statistics(device: PtyDevice, driver: SerialDriver) -> None:
    for _ in range(5):
        driver.read()
    info, statistics = driver.info, driver.statistics
    assert info.port == str(device.path)
    assert info.baud_rate == 921_600
    assert info.low_latency is None  # a pty has no such thing
    assert info.device.board_id == f"{BOARD_ID:012x}"
    assert statistics.sessions == 1
    assert statistics.frames_received >= 13
    assert 0 < statistics.round_trip_p50_us <= statistics.round_trip_p99_us
    assert statistics.frames_lost == statistics.bad_crc == statistics.reconnects == 0


def test_a_setpoint_that_the_port_does_not_take_is_no_success(
    driver: SerialDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(SerialTransport, "write", lambda *_: 0)

    def send_many() -> None:
        for _ in range(200):
            driver.set_duty(0.1, 0.1)

    with pytest.raises(errors.LinkLost, match="was not sent"):
        send_many()


def test_a_driver_says_what_it_is_and_is_closed_like_a_file(
    device: PtyDevice, driver: SerialDriver
) -> None:
    assert repr(driver) == f"<SerialDriver {device.path}: open>"
    driver.close()
    assert repr(driver) == f"<SerialDriver {device.path}: the link is closed; open it again>"
