"""Arguments of every wrong type and size: a named error each, and a link that goes on."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wheelwire
from support.cases import each
from support.pty_device import PtyDevice
from support.waiting import stop_and_stand
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import shown
from wheelwire_protocol.codes import SupervisorState
from wheelwire_protocol.types import SetStreamRate

NO_NUMBERS: list[Any] = [
    "fast",
    b"1",
    "",
    True,
    float("nan"),
    float("inf"),
    -float("inf"),
    10**400,
    10**5000,
    1j,
    [],
    {},
    ...,  # any other object; one with an address in its name would differ between two processes
    np.float64("nan"),
    np.array([1.0, 2.0]),
]

CALLS: dict[str, Callable[[SerialDriver, Any], object]] = {
    "linear": lambda robot, bad: robot.set_velocity(bad, 0.0),
    "angular": lambda robot, bad: robot.set_velocity(0.0, bad),
    "left": lambda robot, bad: robot.set_wheel_velocity(bad, 0.0),
    "right": lambda robot, bad: robot.set_wheel_velocity(0.0, bad),
    "left duty": lambda robot, bad: robot.set_duty(bad, 0.0),
    "right duty": lambda robot, bad: robot.set_duty(0.0, bad),
    "ttl": lambda robot, bad: robot.set_velocity(0.1, 0.0, ttl=bad),
    "wheel ttl": lambda robot, bad: robot.set_wheel_velocity(0.1, 0.0, ttl=bad),
    "duty ttl": lambda robot, bad: robot.set_duty(0.1, 0.0, ttl=bad),
    "stamp": lambda robot, bad: robot.set_velocity(0.1, 0.0, stamp=bad),
    "timeout": lambda robot, bad: robot.read(bad),
    "value": lambda robot, bad: robot.parameters.set("integral_gain", bad),
    "whole value": lambda robot, bad: robot.parameters.set("counts_per_revolution", bad),
    "name": lambda robot, bad: robot.parameters[bad],
    "set name": lambda robot, bad: robot.parameters.set(bad, 1.0),
}


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PtyDevice]:
    with PtyDevice(tmp_path_factory.mktemp("port") / "robot") as device:
        yield device


@pytest.fixture(scope="module")
def driver(robot: PtyDevice) -> Iterator[SerialDriver]:
    with SerialDriver(str(robot.path)) as driver:
        yield driver


@each("bad", NO_NUMBERS, ids=shown)
@each("call", CALLS)
def test_a_call_with_it_raises_a_named_error(
    robot: PtyDevice, driver: SerialDriver, call: str, bad: Any
) -> None:
    with pytest.raises(errors.WheelwireError) as told:
        CALLS[call](driver, bad)
    assert isinstance(told.value, (errors.InvalidArgument, errors.ParameterOutOfRange)) or (
        isinstance(told.value, errors.UnknownParameter) and "name" in call
    )
    assert len(str(told.value)) < 300
    driver.stop()
    assert robot.device.supervisor is SupervisorState.IDLE
    assert driver.sessions == 1


@each("bad", [None, -1.0, 1e9])
def test_a_wait_has_a_limit(driver: SerialDriver, bad: Any) -> None:
    with pytest.raises(errors.InvalidArgument, match="timeout"):
        driver.read(bad)


OPTIONS: dict[str, list[Any]] = {
    "port": [None, 5, "", b"/dev/x", [], True],
    "baud_rate": [*NO_NUMBERS, None, 0, -1, 1e9, 9600.5],
    "connect_timeout": [*NO_NUMBERS, None, -1],
    "stream_rate_hz": [*NO_NUMBERS, 0, -1, 1e9, 99.5, 65_536],
    "board_id": [5, True, "", "robot", "24:0a:c4:12:34:56", b"240ac4123456"],
    "any_board": [None, 1, "yes"],
}


@each(
    ("option", "bad"),
    [(name, bad) for name, values in OPTIONS.items() for bad in values],
    ids=shown,
)
def test_an_option_with_it_raises_a_named_error(tmp_path: Path, option: str, bad: Any) -> None:
    options: dict[str, Any] = {"port": str(tmp_path / "none"), option: bad}
    with pytest.raises(errors.InvalidArgument, match=option):
        SerialDriver(**options)
    with pytest.raises(errors.InvalidArgument, match=option):
        wheelwire.open_driver("serial", **options)


PIN_OPTIONS: dict[str, list[Any]] = {
    "pins": [5, "x", {"left_pwm": 18}],
    "parameters": [5, "x", [1]],
    "store": [5, b"x"],
    "core_timeout_ms": [*NO_NUMBERS, 0],
}


@each("driver", ["l298n", "pigpio"])
@each(
    ("option", "bad"),
    [(name, bad) for name, values in PIN_OPTIONS.items() for bad in values],
    ids=shown,
)
def test_an_option_of_the_pins_with_it(driver: str, option: str, bad: Any) -> None:
    with pytest.raises(errors.InvalidArgument, match=option):
        wheelwire.open_driver(driver, **{option: bad})


@each("bad", [*NO_NUMBERS, 28, -1], ids=shown)
def test_an_invalid_pin_is_refused(bad: Any) -> None:
    with pytest.raises(errors.ConfigurationError, match="GPIO"):
        wheelwire.Pins(left_enc_a=bad)


@each(("option", "bad"), [("realtime", 1), ("parameters", 5), ("store", 5), ("host", 5)])
def test_an_option_of_the_simulated_robot_with_it(option: str, bad: Any) -> None:
    with pytest.raises(errors.InvalidArgument, match=option):
        wheelwire.open_driver("mock", **{option: bad})


@each("bad", [None, 5, [], {}])
def test_a_driver_that_has_no_name(bad: Any) -> None:
    with pytest.raises(errors.DriverUnavailable):
        wheelwire.open_driver(bad)


def test_numbers_of_other_types_are_numbers(driver: SerialDriver) -> None:
    driver.set_velocity(np.float32(0.1), 0, ttl=np.int64(1))
    stop_and_stand(driver)
    assert driver.parameters.set("counts_per_revolution", np.int32(360)) == 360
    assert driver.parameters.set("estop_input_enabled", False) == 0


def test_a_path_is_a_port(tmp_path: Path) -> None:
    with (
        PtyDevice(tmp_path / "robot") as robot,
        SerialDriver(robot.path, baud_rate=115_200.0, stream_rate_hz=np.int64(50)) as driver,  # type: ignore[arg-type]
    ):
        assert driver.info.port == str(robot.path)
        assert driver.info.baud_rate == 115_200
        assert isinstance(driver.info.baud_rate, int)
        assert [m.rate_hz for m in robot.device.asked(SetStreamRate)] == [50]


@each("bad", NO_NUMBERS, ids=shown)
def test_the_numbers_of_a_robot(bad: Any) -> None:
    with pytest.raises(errors.ParameterOutOfRange):
        wheelwire.DifferentialDrive(bad, 0.033, 360)
    with pytest.raises(errors.ParameterOutOfRange):
        wheelwire.DifferentialDrive(0.2, 0.033, 360, max_velocity_mps=-1)
    with pytest.raises(errors.InvalidArgument):
        wheelwire.PoseCovariance(bad, 0.0)


@each("bad", [None, 5, "x", ()])
def test_odometry_of_something_else(bad: Any) -> None:
    with pytest.raises(errors.InvalidArgument, match="geometry"):
        wheelwire.Odometry(bad)
    odometry = wheelwire.Odometry(wheelwire.DifferentialDrive(0.2, 0.033, 360))
    with pytest.raises(errors.InvalidArgument, match="read"):
        odometry.update(bad)


@each("bad", [5, [], b"x", "no\0file", "/"])
def test_an_invalid_file_is_refused(bad: Any) -> None:
    with pytest.raises(errors.ConfigurationError):
        wheelwire.load_config(bad)
