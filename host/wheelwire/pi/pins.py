"""The pin names of other packages' files, as a robot's file has them below `pins:`."""

from __future__ import annotations

from inspect import signature

from wheelwire_protocol.codes import Chip
from wheelwire_protocol.power_stages import Stage

from ..board import Configuration, WheelPins
from ..errors import ConfigurationError, shown
from .gpio.base import PWM_CHANNEL

LAST_GPIO = 27
"""The last GPIO on the header of every Raspberry Pi since the B+; BCM numbers, not positions."""


def Pins(  # noqa: N802 - it makes an object, as a class does
    left_pwm: int = 18,
    left_dir1: int = 23,
    left_dir2: int = 24,
    right_pwm: int = 19,
    right_dir1: int = 5,
    right_dir2: int = 6,
    left_enc_a: int = 17,
    left_enc_b: int = 27,
    right_enc_a: int = 22,
    right_enc_b: int = 10,
    estop: int | None = None,
) -> Configuration:
    """The board of an L298N, assumed to have pull-downs, on a Raspberry Pi's header.

    The defaults are those of the wiring guide for a Raspberry Pi 4B.

    Args:
        left_pwm: EN of the left half of the bridge; GPIO 12 or 18 for hardware PWM.
        left_dir1: IN1; high alone means forward.
        left_dir2: IN2.
        right_pwm: EN of the right half; GPIO 13 or 19, so that each wheel has its own channel.
        right_dir1: IN3.
        right_dir2: IN4.
        left_enc_a: Channel A; leads B when the wheel turns forward.
        left_enc_b: Channel B.
        right_enc_a: As `left_enc_a`.
        right_enc_b: As `left_enc_b`.
        estop: A normally-closed contact to ground; None if none is fitted.

    Raises:
        ConfigurationError: A number is not a GPIO of the header, or is used twice.
    """
    given = {name: pin for name, pin in locals().items() if (name, pin) != ("estop", None)}
    names: dict[int, str] = {}
    for name, pin in given.items():
        # Not isinstance: True is an int, too.
        if type(pin) is not int or not 0 <= pin <= LAST_GPIO:
            raise ConfigurationError(
                f"pins.{name} = {shown(pin)}: it must be a GPIO, 0 to {LAST_GPIO}"
            )
        if pin in names:
            raise ConfigurationError(
                f"pins.{name} = {pin}: pins.{names[pin]} is on this GPIO; choose another one"
            )
        names[pin] = name
    return Configuration(
        name="L298N, these pins",
        chip=Chip.LINUX,
        stage=Stage.ENABLE_IN1_IN2,
        left=WheelPins(
            enable=left_pwm,
            in1=left_dir1,
            in2=left_dir2,
            encoder_a=left_enc_a,
            encoder_b=left_enc_b,
        ),
        right=WheelPins(
            enable=right_pwm,
            in1=right_dir1,
            in2=right_dir2,
            encoder_a=right_enc_a,
            encoder_b=right_enc_b,
        ),
        estop=estop,
        pulldowns=frozenset({left_pwm, right_pwm}),
    )


PIN_NAMES = tuple(signature(Pins).parameters)


def check_hardware_pwm(pins: Configuration) -> None:
    """Raise `ConfigurationError` unless each wheel has its own channel of the PWM hardware."""
    left, right = pins.left.enable, pins.right.enable
    for name, pin in (("left_pwm", left), ("right_pwm", right)):
        if pin not in PWM_CHANNEL:
            raise ConfigurationError(
                f"pins.{name} = {pin}: hardware PWM is on GPIO 12, 13, 18 and 19 only"
            )
    if PWM_CHANNEL.get(left or 0) == PWM_CHANNEL.get(right or 0):
        raise ConfigurationError(
            f"pins.right_pwm = {right}: it shares a PWM channel with pins.left_pwm = "
            f"{left}; the pairs 12 and 18, 13 and 19 do"
        )
