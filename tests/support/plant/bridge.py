"""Driver boards as their data sheets describe them; the library's own tables are not used."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field

from .wheel import SimulatedWheel

Inputs = Mapping[str, float]
"""Duty of each input, 0..1: 0 is low, 1 is high."""


@dataclass(frozen=True)
class Wiring:
    """Which GPIO leads to which input of which kind of board.

    Attributes:
        stage: A key of `BRIDGES`.
        left: The left wheel's GPIOs, by input.
        right: The right wheel's.
        standby: Low: the board is off.
    """

    stage: str = "enable_in1_in2"
    left: dict[str, int] = field(
        default_factory=lambda: {
            "enable": 18,
            "in1": 23,
            "in2": 24,
        }
    )
    right: dict[str, int] = field(
        default_factory=lambda: {
            "enable": 19,
            "in1": 5,
            "in2": 6,
        }
    )
    standby: int | None = None

    @classmethod
    def of_json(cls, text: str) -> Wiring:
        return cls(**json.loads(text))

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    def apply(self, duty: Callable[[int], float], wheels: tuple[SimulatedWheel, ...]) -> None:
        """Set the wheels' bridges; `duty` is that of a GPIO."""
        awake = self.standby is None or duty(self.standby) > 0
        for wheel, gpios in zip(wheels, (self.left, self.right), strict=True):
            direction, enable = BRIDGES[self.stage]({n: duty(g) for n, g in gpios.items()})
            wheel.set_inputs(direction > 0, direction < 0)
            wheel.set_enable(enable if awake else 0.0)


def _l298n(at: Inputs) -> tuple[int, float]:
    return _sign(at["in1"], at["in2"]), at["enable"]


def _tb6612(at: Inputs) -> tuple[int, float]:
    direction = _sign(at["in1"], at["in2"])
    if direction and at["pwm"]:
        return direction, at["pwm"]
    both_low = not at["in1"] and not at["in2"]
    return 0, 0.0 if both_low else 1.0


def _drv8833(at: Inputs) -> tuple[int, float]:
    if at["in1"] and at["in2"]:
        return 0, 1.0
    return (1, at["in1"]) if at["in1"] else (-1, at["in2"])


def _bts7960(at: Inputs) -> tuple[int, float]:
    if not at["enable"]:
        return 0, 0.0
    direction = _sign(at["in1"], at["in2"])
    return (direction, max(at["in1"], at["in2"])) if direction else (0, 1.0)


def _mdd10a(at: Inputs) -> tuple[int, float]:
    return (1 if at["dir"] else -1, at["pwm"]) if at["pwm"] else (0, 1.0)


def _sign(in1: float, in2: float) -> int:
    return (in1 > 0) - (in2 > 0)


BRIDGES: dict[str, Callable[[Inputs], tuple[int, float]]] = {
    "enable_in1_in2": _l298n,
    "pwm_in1_in2": _tb6612,
    "in_in": _drv8833,
    "half_bridges": _bts7960,
    "pwm_dir": _mdd10a,
}
"""Each gives direction (0: none) and duty: of the drive, or without a direction of the brake."""
