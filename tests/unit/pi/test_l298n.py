"""The l298n driver's PWM: the kernel's, the library's, and neither; and its e-stop contact."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from support.gpio_chip_process import GpioChip
from support.pin_drivers import l298n_on
from support.waiting import wait_until
from wheelwire.drivers.l298n import L298NDriver
from wheelwire.errors import DeviceRefused, DriverUnavailable
from wheelwire.pi.pins import Pins


@pytest.fixture
def chip(tmp_path: Path) -> Iterator[GpioChip]:
    with GpioChip(tmp_path) as chip:
        yield chip


def text(chip: GpioChip, file: str) -> str:
    return (chip.pwm_directory / "pwmchip0" / file).read_text().strip()


def test_kernel_pwm_has_the_period_asked_for_and_ends_low(chip: GpioChip) -> None:
    with pytest.raises(DriverUnavailable, match="no pwmchip7"), l298n_on(chip, pwm_chip=7):
        pass
    with l298n_on(chip) as driver:
        driver.set_duty(0.25, -0.25, ttl=1.0)
        wait_until(lambda: text(chip, "pwm0/duty_cycle") == "12500")
        wait_until(lambda: text(chip, "pwm1/duty_cycle") == "12500")
        assert text(chip, "pwm0/period") == "50000"
        assert text(chip, "pwm0/enable") == "1"
        assert not any("PWM at" in limit for limit in driver.limits)
    assert text(chip, "pwm0/duty_cycle") == text(chip, "pwm0/enable") == "0"
    assert text(chip, "pwm1/duty_cycle") == text(chip, "pwm1/enable") == "0"


def test_without_kernel_pwm_the_librarys_limit_is_reported(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with GpioChip(tmp_path, kernel_pwm=False) as chip, l298n_on(chip) as driver:
        assert "1000 Hz instead of 20000 Hz" in driver.limits[0]
        assert "1000 Hz instead of 20000 Hz" in caplog.text
        driver.set_duty(0.5, 0.5)
        wait_until(lambda: driver.get_encoder_ticks()[0] > 10)


def test_a_factory_without_pwm_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GPIOZERO_PIN_FACTORY", "mock")
    with pytest.raises(DriverUnavailable, match="pwm-2chan"):
        L298NDriver(pwm_directory=tmp_path)


def test_no_pins_at_all_say_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GPIOZERO_PIN_FACTORY", "no such factory")
    with pytest.raises(DriverUnavailable, match=r"no such factory.*wheelwire\[pi\]"):
        L298NDriver()


@pytest.mark.whole
def test_a_program_that_has_the_pins_keeps_them(chip: GpioChip) -> None:
    with l298n_on(chip) as driver:
        driver.set_velocity(0.2, 0.0, ttl=1.0)
        with (
            pytest.raises(DriverUnavailable, match="another program uses one of the pins"),
            l298n_on(chip),
        ):
            pass
        driver.set_velocity(0.2, 0.0)
        wait_until(lambda: bool(chip.truth()["driven"]))


@pytest.mark.whole
def test_an_open_estop_contact_stops_and_is_cleared_when_closed(chip: GpioChip) -> None:
    chip.command("level 26 0")
    with l298n_on(chip, pins=Pins(estop=26)) as driver:
        wait_until(lambda: driver.read().state.name == "IDLE")
        chip.command("level 26 1")
        wait_until(lambda: driver.read().state.name == "ESTOPPED")
        chip.command("level 26 0")
        wait_until(lambda: cleared(driver))
        wait_until(lambda: driver.read().state.name == "IDLE")


def cleared(driver: L298NDriver) -> bool:
    try:
        driver.clear_estop()
    except DeviceRefused:  # the contact's level has not arrived yet
        return False
    return True
