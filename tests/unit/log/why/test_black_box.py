"""Black boxes as the only witness: the staged stops as the device alone saw them."""

from __future__ import annotations

import pytest

from support.staged_stops import STAGED, StagedRobot
from wheelwire.log.why.black_box import stops_of_box
from wheelwire_protocol.black_box import Box

SILENCE = "program_paused or host_killed or host_frozen or cable_pulled or line_corrupt"
NOT_COUNTING = "encoder_dead or wheel_blocked"
OTHERWISE: dict[str, str | None] = {
    # Without a sample at rest the supply shows nothing but a stalled motor, or one without current.
    "encoder dead": NOT_COUNTING,
    "encoder dead, right": NOT_COUNTING,
    "program frozen": SILENCE,
    "port gone": SILENCE,
    "line corrupt": SILENCE,
    "zero": None,
    "program killed": None,  # it drives on until the deadline
    "unarmed": "estop_by_session",
}
ALIKE = (
    *("wheel blocked", "motor's wire off", "encoder dead, stiff supply"),
    *("wheel blocked, stiff supply", "encoder dead from rest", "blocked from rest"),
    *("one channel", "one channel while it turns", "reversed", "late step"),
    *("contact, still open", "contact, closed again"),
    *("estop of this program", "estop of another one"),
    *("stop of this program", "stop of another one", "robot closed while it drives"),
    *("another session", "trial", "program pauses", "setpoints too late"),
)
STOPS = {name: STAGED[name].stops[0] for name in ALIKE} | OTHERWISE
"""What a box alone says: in part as all that crossed the link does."""


def box_of(name: str) -> Box:
    return Box(STAGED[name].play().sim.black_box())


@pytest.mark.parametrize("name", STOPS)
def test_a_box_alone_names_the_cause(name: str) -> None:
    stops = stops_of_box(box_of(name))
    cause = STOPS[name]
    assert [stop.cause for stop in stops] == ([] if cause is None else [cause])
    for stop in stops:
        assert set(STAGED[name].stops[0].split(" or ")) & set(stop.causes)


def test_a_late_step_is_named_with_how_late_it_was() -> None:
    (stop,) = stops_of_box(box_of("late step"))
    assert "a step came 40.0 ms late" in stop.evidence


def test_a_box_that_begins_in_the_drive_does_not_say_that_the_wheel_never_counted() -> None:
    robot = StagedRobot(1)
    robot.open()
    robot.drive(0.2, 0.2, 1.0)
    robot.sim.set("left.encoder_dead", 1)
    # Too slowly for the firmware to tell a dead encoder, and longer than a box.
    robot.drive(0.0, 0.0, 4.0)
    robot.until(lambda: bool(robot.sample.faults))
    (stop,) = stops_of_box(Box(robot.sim.black_box()))
    assert stop.causes == ("encoder_dead", "wheel_blocked", "motor_open")
    assert "not one tick in the box, which begins in the drive" in stop.evidence


@pytest.mark.parametrize("side", ["left", "right"])
def test_swapped_encoders_are_seen_through(side: str) -> None:
    robot = StagedRobot(1, supply_ohm=0.4, encoders_swapped=1)
    robot.open()
    robot.set_parameter("encoders_swapped", 1)
    robot.drive(0.2, 0.2, 1.0)
    robot.sim.set(f"{side}.blocked", 1)
    robot.until(lambda: bool(robot.sample.faults))
    (stop,) = stops_of_box(Box(robot.sim.black_box()))
    assert stop.cause == "wheel_blocked"
    assert stop.sentence.startswith(side.capitalize())
