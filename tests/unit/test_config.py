"""A robot's file: what it accepts, and how it reports what is wrong."""

import logging
import math
import subprocess
import sys
from pathlib import Path

import pytest

import wheelwire
from support.pty_device import PtyDevice
from support.waiting import wait_until
from wheelwire.board import Configuration, ImuSensor
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import ConfigurationError
from wheelwire.pi.pins import Pins
from wheelwire.tools.files.robot import parse_config, service_settings
from wheelwire_protocol.native import NativeMissingError
from wheelwire_protocol.parameters import PARAMETER_BY_NAME


def test_the_shipped_file_is_the_wiring_guides() -> None:
    config = wheelwire.load_config()
    assert config.driver == "pigpio"
    assert config.pins == Pins()
    assert (config.pigpio.host, config.pigpio.port) == ("localhost", 8888)
    assert config.parameters["wheel_separation"] == 0.2
    assert config.parameters["counts_per_revolution"] == 360
    assert config.aliases == {}


def test_other_names_are_taken_and_reported(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        config = parse_config(
            {
                "driver_type": "mock",
                "wheel_base": 0.25,
                "cpr": 1440,
                "max_speed": 0.5,
                "max_rpm": 200,
                "pigpio_host": "robot",
            }
        )
    assert config.driver == "mock"
    assert config.pigpio.host == "robot"
    assert config.parameters == pytest.approx(
        {
            "wheel_separation": 0.25,
            "counts_per_revolution": 1440,
            "max_velocity_mps": 0.5,
            "velocity_feedforward": 1.367,
        },
        rel=1e-3,
    )
    assert config.aliases["wheel_base"] == "parameters.wheel_separation"
    assert "cpr is read as parameters.counts_per_revolution" in caplog.text


def test_a_speed_in_rpm_leaves_what_the_files_own_friction_takes() -> None:
    content = {"driver": "mock", "max_rpm": 200, "parameters": {"static_feedforward": 0.2}}
    no_load_mps = 200 / 60 * 2 * math.pi * PARAMETER_BY_NAME["wheel_radius"].default
    found = parse_config(content).parameters["velocity_feedforward"]
    assert found == pytest.approx((1 - 0.2) / no_load_mps)


def test_a_speed_in_rpm_beside_an_empty_section_of_parameters() -> None:
    config = parse_config({"driver": "mock", "max_rpm": 200, "parameters": None})
    assert config.parameters == pytest.approx({"velocity_feedforward": 1.367}, rel=1e-3)


@pytest.mark.parametrize(("driver", "timeout_ms"), [("l298n", 100), ("pigpio", 1000)])
def test_a_service_gives_its_core_as_long_as_the_driver_does(driver: str, timeout_ms: int) -> None:
    settings = service_settings(parse_config({"driver": driver}), "unix:/run/wheelwire.sock")
    assert settings.core_timeout_ms == timeout_ms


@pytest.mark.parametrize("driver", ["l298n", "pigpio"])
def test_sensors_stand_beside_the_pins(driver: str) -> None:
    imu = {"chip": "mpu6050", "bus": 1, "forward": "y", "up": "z"}
    config = parse_config(
        {"driver": driver, "pins": {"left_enc_a": 25}, "imu": imu, "power": None, "inputs": {}}
    )
    assert config.pins.left.encoder_a == 25
    assert config.driver_options()["pins"] == config.pins
    (found,) = config.pins.peripherals
    assert isinstance(found, ImuSensor)
    assert (found.bus, found.sda) == (1, None)


def test_a_robot_opens_from_its_file(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text("driver: mock\nwheel_base: 0.3\n")
    with wheelwire.open_robot(file) as robot:
        assert isinstance(robot, MockDriver)
        assert robot.geometry.wheel_separation == 0.3


def test_a_file_is_read_without_the_firmwares_rules(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_: object) -> list[str]:
        raise NativeMissingError("the library is missing")

    monkeypatch.setattr(Configuration, "problems", missing)
    assert parse_config({"driver": "l298n"}).driver == "l298n"


def test_a_merged_key_may_be_given_again(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(
        "driver: mock\nparameters: {<<: {wheel_radius: 0.03, max_duty: 0.9}, wheel_radius: 0.04}\n"
    )
    assert wheelwire.load_config(file).parameters == {"wheel_radius": 0.04, "max_duty": 0.9}


def test_the_parameter_file_of_the_ros_node_is_recognised() -> None:
    file = Path(__file__).parents[2] / "ros_node" / "config" / "pi4b_params.yaml"
    with pytest.raises(ConfigurationError, match="ROS parameter file"):
        wheelwire.load_config(file)


def test_a_serial_robot_goes_by_the_files_parameters(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    with PtyDevice(tmp_path / "robot") as device:
        file.write_text(
            f"driver: serial\nserial: {{port: {device.path}}}\nparameters: {{wheel_radius: 0.04}}\n"
        )
        with wheelwire.open_robot(file) as robot:
            assert device.device.value("wheel_radius") == pytest.approx(0.04)
            device.device.reset()
            wait_until(lambda: device.device.value("wheel_radius") == pytest.approx(0.04))
            wait_until(lambda: robot.sessions == 2)


def test_files_are_read_as_utf_8_whatever_the_computers_locale(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text("driver: mock\nstore: M\u00fcllwagen  # \u00fc\n", "utf-8")
    program = (
        "import sys, wheelwire; assert wheelwire.load_config(sys.argv[1]).store == 'M\\xfcllwagen'"
    )
    # Python warns wherever a text file is opened in the locale's encoding.
    strict = [
        "-X",
        "warn_default_encoding",
        "-W",
        "error::EncodingWarning:wheelwire.tools.files.reading",
    ]
    subprocess.run([sys.executable, *strict, "-c", program, str(file)], check=True)
