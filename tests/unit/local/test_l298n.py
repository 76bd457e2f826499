"""The l298n driver's PWM: the kernel's, the library's, and neither."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from gpiozero import Device
from gpiozero.pins.mock import MockFactory, MockPin

from support.gpio_robot import GpioRobot
from support.waiting import wait_until
from wheelwire.drivers.l298n import L298NDriver
from wheelwire.errors import DriverUnavailable
from wheelwire.local.pins import Pins


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[GpioRobot]:
    with GpioRobot(tmp_path / "pwm") as robot:
        monkeypatch.setattr(Device, "pin_factory", robot.factory)
        yield robot


def text(robot: GpioRobot, file: str) -> str:
    assert robot.pwm
    return (robot.pwm.chip / file).read_text().strip()


def test_kernel_pwm_has_the_period_asked_for_and_ends_low(robot: GpioRobot) -> None:
    assert robot.pwm
    with L298NDriver(pwm_directory=robot.pwm.root) as driver:
        driver.set_duty(0.25, -0.5)
        wait_until(lambda: text(robot, "pwm0/duty_cycle") == "12500")
        wait_until(lambda: text(robot, "pwm1/duty_cycle") == "25000")
        assert text(robot, "pwm0/period") == "50000"
        assert text(robot, "pwm0/enable") == "1"
        assert not any("PWM at" in limit for limit in driver.limits)
    assert text(robot, "pwm0/duty_cycle") == text(robot, "pwm0/enable") == "0"
    assert text(robot, "pwm1/duty_cycle") == text(robot, "pwm1/enable") == "0"


def test_a_pi_5_has_its_gpios_on_other_channels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chip = tmp_path / "pwmchip2"
    for channel in (2, 3):
        directory = chip / f"pwm{channel}"
        directory.mkdir(parents=True)
        for name in ("duty_cycle", "period", "enable"):
            (directory / name).write_text("0\n")
    (chip / "npwm").write_text("4\n")
    monkeypatch.setattr(Device, "pin_factory", MockFactory())
    with L298NDriver(pwm_directory=tmp_path):
        assert (chip / "pwm2" / "period").read_text() == "50000\n"
        assert (chip / "pwm3" / "period").read_text() == "50000\n"


def test_several_chips_are_a_question(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in (0, 2):
        (tmp_path / f"pwmchip{number}").mkdir()
        (tmp_path / f"pwmchip{number}" / "npwm").write_text("4\n")
    monkeypatch.setattr(Device, "pin_factory", MockFactory())
    with pytest.raises(DriverUnavailable, match=r"pwmchip0, pwmchip2.*pwm_chip"):
        L298NDriver(pwm_directory=tmp_path)
    with pytest.raises(DriverUnavailable, match="no pwmchip7"):
        L298NDriver(pwm_directory=tmp_path, pwm_chip=7)


def test_without_the_kernels_pwm_the_librarys_limit_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with GpioRobot(tmp_path, kernel_pwm=False) as robot:
        monkeypatch.setattr(Device, "pin_factory", robot.factory)
        with L298NDriver(pwm_directory=tmp_path / "none") as driver:
            assert "1000 Hz instead of 20000 Hz" in driver.limits[0]
            assert "1000 Hz instead of 20000 Hz" in caplog.text
            assert robot.factory.pin(18).frequency == 1000
            driver.set_duty(0.5, 0.5)
            wait_until(lambda: driver.get_encoder_ticks()[0] > 10)


def test_a_factory_without_pwm_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Device, "pin_factory", MockFactory(pin_class=MockPin))
    with pytest.raises(DriverUnavailable, match="pwm-2chan"):
        L298NDriver(pwm_directory=tmp_path)


def test_no_pins_at_all_say_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Device, "pin_factory", None)
    monkeypatch.setenv("GPIOZERO_PIN_FACTORY", "no such factory")
    with pytest.raises(DriverUnavailable, match=r"wheelwire\[gpio\]"):
        L298NDriver()


def test_an_open_estop_contact_stops_and_is_cleared_when_closed(robot: GpioRobot) -> None:
    assert robot.pwm
    robot.factory.pin(26).drive_low()
    with L298NDriver(pins=Pins(estop=26), pwm_directory=robot.pwm.root) as driver:
        wait_until(lambda: driver.read().state.name == "IDLE")
        robot.factory.pin(26).drive_high()
        wait_until(lambda: driver.read().state.name == "ESTOPPED")
        robot.factory.pin(26).drive_low()
        driver.clear_estop()
        wait_until(lambda: driver.read().state.name == "IDLE")
