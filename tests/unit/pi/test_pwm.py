"""PWM channels of the kernel, on a directory that refuses what the kernel refuses."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from wheelwire.errors import DriverUnavailable
from wheelwire.pi.gpio import pwm
from wheelwire.pi.gpio.pwm import KernelPwm, find_channels

PERIOD_NS = 50_000


@pytest.fixture
def chip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A chip with an exported channel, number 0, that was never used."""
    channel = tmp_path / "pwmchip0" / "pwm0"
    channel.mkdir(parents=True)
    (channel.parent / "npwm").write_text("2\n")
    for name in ("duty_cycle", "period", "enable"):
        (channel / name).write_text("0\n")

    def write(file: Path, value: int) -> None:
        period, duty = (int((channel / name).read_text()) for name in ("period", "duty_cycle"))
        if file.name == "period":
            period = value
        elif file.name == "duty_cycle":
            duty = value
        if period == 0 or duty > period:
            raise OSError(errno.EINVAL, "Invalid argument")
        file.write_text(f"{value}\n")

    monkeypatch.setattr(pwm, "_write", write)
    return channel.parent


def state(chip: Path) -> dict[str, int]:
    return {file.name: int(file.read_text()) for file in (chip / "pwm0").iterdir()}


def test_a_channel_that_was_never_used_is_opened(chip: Path) -> None:
    KernelPwm(chip, 0).open(1e9 / PERIOD_NS)
    assert state(chip) == {"duty_cycle": 0, "period": PERIOD_NS, "enable": 1}


def test_a_channel_that_another_program_left_on_is_opened_low(chip: Path) -> None:
    channel = KernelPwm(chip, 0)
    channel.open(0.5e9 / PERIOD_NS)
    channel.set(1.0)
    channel.open(1e9 / PERIOD_NS)
    assert state(chip) == {"duty_cycle": 0, "period": PERIOD_NS, "enable": 1}


@pytest.mark.parametrize(
    ("gpios", "found"), [((18, 19), True), ((12, 13), True), ((12, 18), False), ((18, 20), False)]
)
def test_each_input_needs_a_channel_of_its_own(
    chip: Path, gpios: tuple[int, int], found: bool
) -> None:
    channels = find_channels(chip.parent, None, gpios)
    assert (channels is not None) == found


def with_chips(directory: Path, *numbers: int) -> Path:
    """A computer with chips of four channels, as a Pi 5's."""
    for number in numbers:
        (directory / f"pwmchip{number}").mkdir()
        (directory / f"pwmchip{number}" / "npwm").write_text("4\n")
    return directory


def test_a_pi_5_has_its_gpios_on_other_channels(tmp_path: Path) -> None:
    channels = find_channels(with_chips(tmp_path, 2), None, (18, 19))
    assert channels is not None
    assert [one._directory for one in channels] == [
        tmp_path / "pwmchip2" / f"pwm{number}" for number in (2, 3)
    ]


def test_several_chips_are_a_question(tmp_path: Path) -> None:
    directory = with_chips(tmp_path, 0, 2)
    with pytest.raises(DriverUnavailable, match=r"pwmchip0, pwmchip2.*pwm_chip"):
        find_channels(directory, None, (18, 19))
    with pytest.raises(DriverUnavailable, match="no pwmchip7"):
        find_channels(directory, 7, (18, 19))
