"""The power stages, each with its truth table: what a wheel's motor gets from its inputs.

A new one is a row of `STAGES`, and a board's file in `boards/`. The core's tables are generated.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

from .codes import DocumentedEnum

OUTPUTS = ("enable", "in1", "in2", "pwm", "dir")
"""What a wheel's power stage may have for inputs."""


class Stage(DocumentedEnum):
    """What stands between the chip's pins and a motor."""

    ENABLE_IN1_IN2 = 0, "An enable with the PWM and two direction inputs: L298N, L293D."
    PWM_IN1_IN2 = 1, "A PWM input, whose low level brakes, and two direction inputs: TB6612FNG."
    IN_IN = 2, "Two inputs, the PWM on one of them: DRV8833, DRV8871, MX1508."
    HALF_BRIDGES = 3, "Two half bridges with a common enable: BTS7960 (IBT-2)."
    PWM_DIR = 4, "A PWM and a direction input: Cytron MD10C, MDD10A."


class Level(enum.Enum):
    """What an input of a power stage gets."""

    LOW = "low"
    HIGH = "high"
    PWM = "PWM"
    KEEP = "as before"


class Action(enum.Enum):
    """What a wheel is to do: a row of a truth table."""

    COAST = "coast"
    FORWARD = "forward"
    REVERSE = "reverse"
    BRAKE = "brake"


class Module(NamedTuple):
    """What is printed on a module with such a stage, for its picture."""

    title: str
    left: tuple[str, ...]
    """The left wheel's inputs, in the order of the table."""
    right: tuple[str, ...]
    outputs: tuple[str, str, str, str]
    supply: str
    note: str = ""
    standby: str = ""
    logic: str = ""
    """Its own supply's pin, from 3.3 V of the chip."""
    one_each: bool = False
    """A module for each wheel."""


@dataclass(frozen=True, kw_only=True)
class StageTable:
    """A power stage as data.

    In a row of `coast` each input is low or as before: it is the state of a chip that starts. An
    input that the stage itself does not hold low is one of `pull_downs`.

    Attributes:
        parts: Integrated circuits and modules with such inputs.
        rows: The level of each input for each action.
        pull_downs: Inputs that nothing in the stage holds low.
        max_frequency_hz: Highest frequency of the PWM.
        frequency_source: Where that limit is from.
        can_coast: Whether the motor can turn freely while the stage is supplied.
        has_standby: Whether one more input switches both wheels' outputs off. It may be left
            unconnected to the chip, tied high.
        coast, brake, release, dead_time: What these mean on it, in sentences.
        floating: What the motors do while no input is driven, in sentences.
        module: A module of this kind.
    """

    parts: str
    rows: Mapping[Action, Mapping[str, Level]]
    pull_downs: tuple[str, ...] = ()
    max_frequency_hz: int
    frequency_source: str
    can_coast: bool = True
    coast: str
    brake: str
    release: str
    dead_time: str
    floating: str
    has_standby: bool = False
    module: Module

    @property
    def inputs(self) -> tuple[str, ...]:
        """The inputs of each wheel: each row has them all."""
        return tuple(self.rows[Action.COAST])

    @property
    def pwm_inputs(self) -> tuple[str, ...]:
        """The inputs that ever take a duty; each needs a PWM output of the chip."""
        rows = self.rows.values()
        return tuple(pin for pin in OUTPUTS if any(r.get(pin) is Level.PWM for r in rows))


def _rows(inputs: tuple[str, ...], **rows: str) -> Mapping[Action, Mapping[str, Level]]:
    # One letter an input, so that a row can be compared with a data sheet's table at a glance.
    letters = {"0": Level.LOW, "1": Level.HIGH, "p": Level.PWM, "-": Level.KEEP}
    return MappingProxyType(
        {
            Action(name): MappingProxyType(
                {pin: letters[letter] for pin, letter in zip(inputs, row, strict=True)}
            )
            for name, row in rows.items()
        }
    )


_ONE_PERIOD = "One control period in coast, between two directions, and before a brake."
_BUILT_IN = "The part keeps its two switches apart by itself. "

STAGES: Mapping[Stage, StageTable] = MappingProxyType(
    {
        Stage.ENABLE_IN1_IN2: StageTable(
            parts="L298N, L293D",
            rows=_rows(
                ("enable", "in1", "in2"), coast="0--", forward="p10", reverse="p01", brake="100"
            ),
            pull_downs=("enable",),
            max_frequency_hz=40_000,
            frequency_source="L298 data sheet, commutation frequency",
            coast="EN low: all four switches are off. So is the off time of the PWM.",
            brake="EN high, both inputs low: the motor is shorted through the lower switches.",
            release="EN low.",
            dead_time=_ONE_PERIOD,
            floating=(
                "With the resistors they coast. Without them its inputs float high, which brakes; "
                "a disturbed one drives at full duty."
            ),
            module=Module(
                "L298N",
                ("ENA", "IN1", "IN2"),
                ("ENB", "IN3", "IN4"),
                ("OUT1", "OUT2", "OUT3", "OUT4"),
                "12 V in",
                note="EN jumpers off, 5V-EN on",
            ),
        ),
        Stage.PWM_IN1_IN2: StageTable(
            parts="TB6612FNG",
            rows=_rows(
                ("pwm", "in1", "in2"), coast="000", forward="p10", reverse="p01", brake="011"
            ),
            max_frequency_hz=100_000,
            frequency_source="TB6612FNG data sheet, switching frequency",
            coast="Both inputs low. PWM low alone brakes.",
            brake="Both inputs high, or PWM low, as in the PWM's off time.",
            release="Both inputs low, and standby if it is connected.",
            dead_time=_BUILT_IN + _ONE_PERIOD,
            floating=(
                "They coast, also with standby tied high: the part holds its inputs low, with "
                "200 kΩ each."
            ),
            has_standby=True,
            module=Module(
                "TB6612FNG",
                ("PWMA", "AIN1", "AIN2"),
                ("PWMB", "BIN1", "BIN2"),
                ("AO1", "AO2", "BO1", "BO2"),
                "VM",
                standby="STBY",
                logic="VCC",
            ),
        ),
        Stage.IN_IN: StageTable(
            parts="DRV8833, DRV8871, MX1508",
            rows=_rows(("in1", "in2"), coast="00", forward="p0", reverse="0p", brake="11"),
            max_frequency_hz=50_000,
            frequency_source="our limit, below the 200 kHz of the DRV8871's data sheet",
            coast="Both inputs low. So is the off time of the PWM.",
            brake="Both inputs high.",
            release="Both inputs low, and nSLEEP (standby) if it is connected.",
            dead_time=_BUILT_IN + _ONE_PERIOD,
            floating=(
                "They coast, also with nSLEEP tied high: the part holds its inputs low, a DRV8833 "
                "with 150 kΩ."
            ),
            has_standby=True,
            module=Module(
                "DRV8833",
                ("AIN1", "AIN2"),
                ("BIN1", "BIN2"),
                ("AOUT1", "AOUT2", "BOUT1", "BOUT2"),
                "VM",
                standby="nSLEEP",
            ),
        ),
        Stage.HALF_BRIDGES: StageTable(
            parts="BTS7960 (IBT-2)",
            rows=_rows(
                ("enable", "in1", "in2"), coast="000", forward="1p0", reverse="10p", brake="100"
            ),
            pull_downs=("enable",),
            max_frequency_hz=25_000,
            frequency_source="BTS7960 data sheet, up to 25 kHz",
            coast="Enable (R_EN and L_EN together) low: both half bridges are off.",
            brake="Enable high, both inputs low: so the off time of the PWM brakes.",
            release="Enable low.",
            dead_time=_BUILT_IN + _ONE_PERIOD,
            floating=(
                "With the resistors they coast. Without them the motors may drive at full duty, "
                "either way."
            ),
            module=Module(
                "BTS7960",
                ("R_EN + L_EN", "RPWM", "LPWM"),
                ("R_EN + L_EN", "RPWM", "LPWM"),
                ("M+", "M-", "M+", "M-"),
                "B+",
                note="one each",
                logic="VCC",
                one_each=True,
            ),
        ),
        Stage.PWM_DIR: StageTable(
            parts="Cytron MD10C, MDD10A",
            rows=_rows(("pwm", "dir"), coast="0-", forward="p1", reverse="p0", brake="00"),
            pull_downs=("pwm",),
            max_frequency_hz=20_000,
            frequency_source="Cytron MDD10A user's manual",
            can_coast=False,
            coast="There is none: PWM low shorts the motor.",
            brake="PWM low.",
            release="PWM low, which brakes.",
            dead_time=_BUILT_IN + _ONE_PERIOD,
            floating=(
                "With the resistors they brake. Without them the motors may drive at full duty, "
                "either way."
            ),
            module=Module(
                "MDD10A",
                ("PWM1", "DIR1"),
                ("PWM2", "DIR2"),
                ("M1A", "M1B", "M2A", "M2B"),
                "POWER +",
                note="it cannot coast",
            ),
        ),
    }
)
