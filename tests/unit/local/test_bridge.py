"""The output stage's truth table and order, as the firmware's."""

from collections.abc import Callable

from wheelwire.local.bridge import L298nStage
from wheelwire.local.hardware import BridgePins

Change = tuple[str, object]


class Recorder(BridgePins):
    """Notes every change of a pin."""

    def __init__(self) -> None:
        self.changes: list[Change] = []

    def set_inputs(self, in1: bool, in2: bool) -> None:
        self.changes.append(("inputs", (in1, in2)))

    def set_enable(self, duty: float) -> None:
        self.changes.append(("enable", duty))

    def take(self) -> list[Change]:
        taken, self.changes = self.changes, []
        return taken


def test_forward_reverse_brake_coast() -> None:
    cases: list[tuple[Callable[[L298nStage], None], tuple[bool, bool], float]] = [
        (lambda stage: stage.drive(0.4), (True, False), 0.4),
        (lambda stage: stage.drive(-0.4), (False, True), 0.4),
        (lambda stage: stage.brake(), (False, False), 1.0),
    ]
    for action, inputs, enable in cases:
        pins = Recorder()
        action(L298nStage(pins))
        assert pins.take() == [("inputs", inputs), ("enable", enable)]
    pins = Recorder()
    L298nStage(pins).coast()
    assert pins.take() == [("enable", 0.0)]


def test_no_duty_coasts() -> None:
    pins = Recorder()
    L298nStage(pins).drive(0.0)
    assert pins.take() == [("enable", 0.0)]


def test_a_reversal_spends_one_step_with_en_low_before_the_inputs_change() -> None:
    pins = Recorder()
    stage = L298nStage(pins)
    stage.drive(0.5)
    pins.take()
    stage.drive(-0.5)
    assert pins.take() == [("enable", 0.0)]
    stage.drive(-0.5)
    assert pins.take() == [("inputs", (False, True)), ("enable", 0.5)]


def test_a_brake_from_driving_does_too() -> None:
    pins = Recorder()
    stage = L298nStage(pins)
    stage.drive(0.5)
    pins.take()
    stage.brake()
    assert pins.take() == [("enable", 0.0)]
    stage.brake()
    assert pins.take() == [("inputs", (False, False)), ("enable", 1.0)]
