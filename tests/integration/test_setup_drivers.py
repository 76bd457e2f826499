"""The set-up by the driver of this computer's pins."""

from __future__ import annotations

from pathlib import Path
from tempfile import mkdtemp

import pytest

from support.gpio_chip_process import GpioChip
from wheelwire.board import Configuration
from wheelwire.drivers.l298n import L298NDriver
from wheelwire.pi.pins import Pins
from wheelwire.tools.setup.questions import SKIP, Question
from wheelwire.tools.setup.setup import set_up
from wheelwire.tools.setup.wiring import Wiring

PATIENT = {"overrun_limit_us": 1e6}
"""A busy test machine must not cause a fault."""
WIRING = Wiring(encoders_swapped=True, left_motor_reversed=True, right_encoder_reversed=True)
FIRST, SECOND = "left backward", "forward"


def wired_wrongly() -> Configuration:
    """The pins to which the driver thinks its robot is wired, which is wired to others."""
    left, right = Pins().left, Pins().right
    return Pins(
        left_dir1=left.in2 or 0,
        left_dir2=left.in1 or 0,
        left_enc_a=right.encoder_b or 0,
        left_enc_b=right.encoder_a or 0,
        right_enc_a=left.encoder_a or 0,
        right_enc_b=left.encoder_b or 0,
    )


class Person:
    def answer(self, question: Question) -> str:
        answers = {"imu": "no", "raised": "yes", "first": FIRST, "second": SECOND, "tune": "no"}
        default = SKIP if question.turn else question.default
        return question.parse(answers.get(question.key, default))


def test_l298n(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[str] = []
    with GpioChip(Path(mkdtemp(dir=tmp_path))) as chip:
        for name, value in chip.environment.items():
            monkeypatch.setenv(name, value)
        with L298NDriver(
            pins=wired_wrongly(),
            parameters=PATIENT,
            pwm_directory=chip.pwm_directory,
            core_timeout_ms=5000,
        ) as robot:
            findings = set_up(robot, Person(), lines.append)
    assert findings.wiring == WIRING, lines
    assert findings.is_complete, lines
