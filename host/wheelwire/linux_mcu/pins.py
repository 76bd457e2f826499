"""The wiring: which GPIO has which function."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

from wheelwire_protocol.board import Stage
from wheelwire_protocol.codes import Board as Chip

from ..board import BoardDescription, WheelPins
from ..errors import ConfigurationError, shown

PWM_CHANNEL = {12: 0, 18: 0, 13: 1, 19: 1}
"""Channel of the PWM hardware by GPIO; two GPIOs of one channel carry the same signal."""
LAST_GPIO = 27
"""Of the 40-pin header of every Raspberry Pi since the B+; BCM numbers, not pin positions."""


@dataclass(frozen=True)
class Pins:
    """GPIOs by BCM number. The defaults are those of the wiring guide for a Raspberry Pi 4B.

    Attributes:
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

    left_pwm: int = 18
    left_dir1: int = 23
    left_dir2: int = 24
    right_pwm: int = 19
    right_dir1: int = 5
    right_dir2: int = 6
    left_enc_a: int = 17
    left_enc_b: int = 27
    right_enc_a: int = 22
    right_enc_b: int = 10
    estop: int | None = None

    def __post_init__(self) -> None:
        names: dict[int, str] = {}
        for name, pin in self.assigned():
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

    def board(self) -> BoardDescription:
        """This wiring as a board with an L298N. Its bridge is assumed to have its pull-downs."""
        return BoardDescription(
            name="L298N, these pins",
            chip=Chip.LINUX,
            stage=Stage.ENABLE_IN1_IN2,
            left=WheelPins(
                enable=self.left_pwm,
                in1=self.left_dir1,
                in2=self.left_dir2,
                encoder_a=self.left_enc_a,
                encoder_b=self.left_enc_b,
            ),
            right=WheelPins(
                enable=self.right_pwm,
                in1=self.right_dir1,
                in2=self.right_dir2,
                encoder_a=self.right_enc_a,
                encoder_b=self.right_enc_b,
            ),
            estop=self.estop,
            pulldowns=frozenset({self.left_pwm, self.right_pwm}),
        )

    def assigned(self) -> Iterator[tuple[str, int]]:
        """The name and GPIO of each function that is wired."""
        for field in fields(self):
            pin = getattr(self, field.name)
            if pin is not None:
                yield field.name, pin

    def check_hardware_pwm(self) -> None:
        """Raise `ConfigurationError` unless each wheel has its own PWM channel."""
        for name, pin in (("left_pwm", self.left_pwm), ("right_pwm", self.right_pwm)):
            if pin not in PWM_CHANNEL:
                raise ConfigurationError(
                    f"pins.{name} = {pin}: hardware PWM is on GPIO 12, 13, 18 and 19 only"
                )
        if PWM_CHANNEL[self.left_pwm] == PWM_CHANNEL[self.right_pwm]:
            raise ConfigurationError(
                f"pins.right_pwm = {self.right_pwm}: it shares a PWM channel with pins.left_pwm = "
                f"{self.left_pwm}; the pairs 12 and 18, 13 and 19 do"
            )
