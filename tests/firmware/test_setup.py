"""The set-up of a robot over the firmware's core, in virtual time."""

from __future__ import annotations

import random
from dataclasses import replace
from functools import cache
from itertools import count
from pathlib import Path

import pytest

from support.commissioning import plant_robot
from support.defects import DEFECTS, DefectiveRobot, named
from support.wiring_runs import (
    UNTUNED,
    Case,
    Condition,
    InterruptedRobot,
    Watched,
    between_corners,
    cases,
    check,
    check_wiring,
    corners,
    raised_robot,
    set_up_raised,
)
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import CommissioningFailed, DeviceRefused, LinkLost, WheelwireError
from wheelwire.samples import WheelSample
from wheelwire.tools.files.parameters import load_parameter_file
from wheelwire.tools.files.plant import load_plant, shipped_plants
from wheelwire.tools.setup import problems, setup, wiring
from wheelwire.tools.setup.driving import Pair, pulse
from wheelwire.tools.setup.identification import Identification, identify
from wheelwire.tools.setup.questions import Question, SimulatedPerson
from wheelwire.tools.setup.setup import CHANGED, TUNED, Findings, Options, Progress, set_up
from wheelwire.tools.setup.wiring import Wiring, check_wheels
from wheelwire.tools.tune import before_after
from wheelwire_protocol.codes import Fault

WRONG = {"motors_swapped": 1, "left.motor_reversed": 1, "right.encoder_reversed": 1}
WIRING = Wiring(motors_swapped=True, left_motor_reversed=True, right_encoder_reversed=True)
NO_IMU = {"imu": "no"}
"""Answers, where the motors alone are set up."""
SAMPLE = random.Random(7).sample(list(cases()), 12)


@pytest.mark.parametrize("case", SAMPLE, ids=str)
def test_any_wiring_is_named_and_mended(case: Case) -> None:
    assert check(case) == []


# TT motors that started to turn at a duty near `reversal_duty`; then those that start last.
HARD = (
    Condition(6.0, 1.0, 1.0, 0.05),
    Condition(5.0, 1.0, 1.0, 0.05, measured=False),
    Condition(7.4, 1.5, 1.0, 0.05),
    Condition(4.8, 2.0, 2.0, 0.1),
    Condition(4.8, 1.0, 2.0, 0.0, measured=False),
)


@pytest.mark.whole
@pytest.mark.parametrize(
    "case",
    [
        *(
            Case((0, 0, 0, 0, *reversed_), "tt-1-48", 2496, condition)
            for condition in HARD
            for reversed_ in ((1, 0), (0, 1))
        ),
        *random.Random(8).sample(list(corners()), 12),
        *between_corners(9, 10),
    ],
    ids=str,
)
def test_any_wiring_is_found_whatever_supply_friction_and_play_are(case: Case) -> None:
    assert check_wiring(case) == []


def test_thresholds_that_it_raises_meanwhile_are_back_afterwards() -> None:
    watched = {"reversal_duty": 0.25, "rolling_velocity_mps": 0.2}
    with raised_robot(WRONG) as robot:
        for name, value in watched.items():
            robot.parameters.set(name, value)
        assert set_up(robot, SimulatedPerson(robot, UNTUNED), lambda _: None).saved
        robot.parameters.refresh()
        assert {name: robot.parameters[name] for name in watched} == watched


def test_wheels_turned_by_hand_are_no_robot_that_rolls_away(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with raised_robot({"counts_per_revolution": 2496}) as robot:
        assert set_up(robot, SimulatedPerson(robot, UNTUNED), lambda _: None).saved
    assert not [record for record in caplog.records if "rolls" in record.getMessage()]


@pytest.mark.parametrize("robot", DEFECTS, ids=lambda robot: str(dict(robot.settings)))
def test_a_defect_is_named_in_words(robot: DefectiveRobot) -> None:
    assert named(robot).startswith(robot.name)


def test_every_defect_is_tried() -> None:
    assert {robot.defect for robot in DEFECTS} == set(problems.DEFECTS)
    assert len(problems.DEFECTS) >= 12


@pytest.mark.parametrize("plant", shipped_plants())
@pytest.mark.parametrize("volts", [6.5, 12.6])
def test_a_wheel_whose_encoder_is_dead_turns_little(plant: str, volts: float) -> None:
    settings = {**load_plant(plant).settings, "supply_v": volts, "left.encoder_dead": 1}
    with raised_robot(settings) as robot:
        pulse(robot, 0)
        assert 0.1 < robot.simulator.get("true.left_turns") < 1.5


@pytest.mark.whole
def test_all_of_a_robot_is_found_by_hand_and_saved() -> None:
    plant = load_plant("tt-1-48").settings
    with raised_robot({**plant, **WRONG}) as robot:
        findings = set_up(robot, SimulatedPerson(robot), lambda _: None)
        robot.simulator.reset()
        robot.advance(1.0)
        robot.parameters.refresh()
        values = {name: robot.parameters[name] for name in CHANGED}
    assert findings.wiring == WIRING
    assert findings.counts_per_revolution == 2496
    assert findings.problems == ()
    assert findings.saved
    assert findings.rms_before_mps is not None
    assert findings.rms_after_mps is not None
    assert findings.rms_after_mps < 0.5 * findings.rms_before_mps
    expected = {
        **WIRING.corrections,
        "counts_per_revolution": 2496,
        "wheel_radius": 0.0325,
        "wheel_separation": 0.14,
        "velocity_feedforward": findings.velocity_feedforward,
        "static_feedforward": findings.static_feedforward,
    }
    assert {name: values[name] for name in expected} == expected
    assert values["proportional_gain"] != 1.2


@cache
def identified() -> Identification:
    """The motors of a robot, for tests of what comes after their measurement."""
    with raised_robot({}) as robot:
        return identify(robot, lambda _: None, on_the_floor=False)


BLOCKED = {"left.blocked": 1.0, "right.blocked": 1.0}


def against_a_wall(robot: MockDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its wheels are stuck from the test drives on."""

    def measured(*_: object, **_options: object) -> Identification:
        for name, value in BLOCKED.items():
            robot.simulator.set(name, value)
        return identified()

    monkeypatch.setattr(setup, "identify", measured)


@pytest.mark.whole
@pytest.mark.parametrize("raised", [1, 0])
def test_test_drives_that_end_in_a_fault_are_no_success(
    monkeypatch: pytest.MonkeyPatch, raised: int
) -> None:
    said: list[str] = []
    with raised_robot({"wheels_free": raised}) as robot:
        against_a_wall(robot, monkeypatch)
        before = {name: robot.parameters[name] for name in CHANGED}
        options = Options(on_the_floor=not raised)
        findings = set_up(robot, SimulatedPerson(robot, NO_IMU), said.append, options)
        robot.parameters.refresh()
        assert {name: robot.parameters[name] for name in CHANGED} == before
    assert not findings.is_complete
    assert not findings.saved
    (problem,) = findings.problems
    assert problem.startswith("a drive ended in a fault: with the previous values, too. LEFT_NOT")
    assert "RIGHT_NOT_COUNTING" in problem
    assert not any("track as well" in line for line in said)


@pytest.mark.whole
def test_a_fault_with_the_previous_values_is_reported_and_corrected() -> None:
    said: list[str] = []
    with raised_robot({"left.motor_scale": 0.5, "right.motor_scale": 0.5}) as robot:
        robot.parameters.set("plausibility_margin", 0.1)
        findings = set_up(robot, SimulatedPerson(robot, NO_IMU), said.append)
    assert findings.rms_before_mps is None
    assert findings.rms_after_mps is not None
    assert findings.saved
    (line,) = (line for line in said if line.startswith("with the previous values a fault ended"))
    assert "_ENCODER_IMPLAUSIBLE: " in line  # of either wheel: both are equally weak


@pytest.mark.parametrize("raised", [1, 0])
def test_a_fault_while_the_motors_are_measured_is_named(raised: int) -> None:
    with raised_robot({"wheels_free": raised}) as robot:

        def say(text: str) -> None:
            if text.startswith("step response"):
                robot.simulator.set("left.blocked", 1)

        findings = set_up(
            robot, SimulatedPerson(robot, NO_IMU), say, Options(on_the_floor=not raised)
        )
    assert (findings.is_complete, findings.saved) == (False, False)
    assert findings.problems[-1].startswith("a drive ended in a fault: LEFT_NOT_COUNTING: ")


def test_a_wheel_that_stops_while_both_are_compared_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def blocked_first(robot: MockDriver, *given: object) -> object:
        robot.simulator.set("left.encoder_dead", 1)
        return check_wheels(robot, *given)  # type: ignore[arg-type]

    monkeypatch.setattr(wiring, "check_wheels", blocked_first)
    with raised_robot(load_plant("tt-1-48").settings) as robot:
        findings = set_up(robot, SimulatedPerson(robot, UNTUNED), lambda _: None)
    assert (findings.is_complete, findings.saved) == (False, False)
    assert findings.problems[0].startswith("a drive ended in a fault: LEFT_NOT_COUNTING: ")


@pytest.mark.parametrize("plant", shipped_plants())
@pytest.mark.parametrize("raised", [1, 0])
def test_an_empty_battery_is_no_weak_motor(plant: str, raised: int) -> None:
    empty = {"supply_v": 3.0, "battery_v": 3.0}
    with plant_robot(plant, raised=bool(raised), settings=empty) as robot:
        options = Options(on_the_floor=not raised)
        findings = set_up(robot, SimulatedPerson(robot), lambda _: None, options)
    (problem,) = findings.problems
    assert problem.startswith("battery low: it measures 3.0 V, and nominal_supply_v is 7.4: charge")
    assert findings.is_complete == bool(raised)
    assert findings.velocity_feedforward is None


@pytest.mark.whole
def test_a_robot_that_is_meant_for_3_volts_is_measured_with_them() -> None:
    with raised_robot({"supply_v": 3.3, "battery_v": 3.3, "motor.supply_v": 3.3}) as robot:
        robot.parameters.set("nominal_supply_v", 3.3)
        findings = set_up(robot, SimulatedPerson(robot, NO_IMU), lambda _: None)
    assert findings.saved
    assert findings.velocity_feedforward is not None
    assert not any("battery low" in text for text in findings.problems)


@pytest.mark.whole
@pytest.mark.parametrize(
    ("change", "verdict"),
    [(1.0, "the previous values track as well, within the noise of "), (0.7, "track better, by")],
)
def test_gains_that_are_no_better_are_not_saved(
    monkeypatch: pytest.MonkeyPatch, change: float, verdict: str
) -> None:
    said: list[str] = []
    monkeypatch.setattr(setup, "identify", lambda *_, **_options: identified())
    with raised_robot({}) as robot:
        before = {name: robot.parameters[name] for name in TUNED}
        monkeypatch.setattr(
            setup,
            "tuned",
            lambda *_: {**before, "velocity_feedforward": change * before["velocity_feedforward"]},
        )
        findings = set_up(robot, SimulatedPerson(robot, NO_IMU), said.append)
        assert {name: robot.parameters[name] for name in TUNED} == before
    assert findings.rms_after_mps is not None, findings
    assert findings.saved  # the wiring
    assert any(verdict in line for line in said)


@pytest.mark.parametrize("raised", [True, pytest.param(False, marks=pytest.mark.whole)])
def test_late_setpoints_are_named_in_place_of_an_encoder(
    monkeypatch: pytest.MonkeyPatch, *, raised: bool
) -> None:
    with plant_robot("tt-1-48", raised=raised) as robot:
        read, reads = robot.read, count()

        def late(timeout: float = 1.0) -> WheelSample:
            sample = read(timeout)
            if next(reads) % 10:
                return sample
            robot.advance(0.06)
            return read(timeout)

        monkeypatch.setattr(robot, "read", late)
        before = {name: robot.parameters[name] for name in TUNED}
        options = Options(on_the_floor=not raised)
        findings = set_up(robot, SimulatedPerson(robot, NO_IMU), lambda _: None, options)
        assert {name: robot.parameters[name] for name in TUNED} == before
    (problem,) = findings.problems
    assert problem.startswith("setpoints came late: up to 70 ms apart, ")
    assert "repeat the set-up" in problem
    # What was found before the test drives is still good.
    assert (findings.is_complete, findings.saved) == (raised, raised)


def test_values_to_be_saved_are_listed_before_and_after() -> None:
    said: list[str] = []
    with raised_robot(WRONG) as robot:
        set_up(robot, SimulatedPerson(robot, {**UNTUNED, "save": "no"}), said.append)
    listed = said[said.index("To be saved, before -> after:") + 1 : -1]
    *changed, same = listed
    assert changed[0] == "  motors_swapped: 0 -> 1"
    assert ", wheel_radius 0.033 m, " in same
    named = [line.split(":")[0].strip() for line in changed]
    named += [one.split()[0] for one in same.removeprefix("  as before: ").split(", ")]
    assert sorted(named) == sorted(CHANGED[:9])


def test_it_asks_ten_questions_and_on_a_new_board_which_one_it_is() -> None:
    with raised_robot({}) as robot:
        person = Watched(robot)
        assert set_up(robot, person, lambda _: None).saved
    assert len([key for key in person.asked if not key.startswith("imu")]) == 10
    assert len([key for key in person.asked if key.startswith("imu")]) == 5


class Hasty(Watched):
    """A person who presses Enter before a wheel was turned, so many times."""

    def __init__(self, robot: MockDriver, times: int) -> None:
        super().__init__(robot, UNTUNED)
        self._times = times

    def answer(self, question: Question) -> str:
        if question.key in ("counts_left", "counts_right") and self._times:
            self._times -= 1
            self.asked.append(question.key)
            return question.default
        return super().answer(question)


def test_turns_that_were_not_counted_are_asked_for_again(tmp_path: Path) -> None:
    said: list[str] = []
    options = Options(progress=Progress("board", tmp_path))
    with raised_robot(WRONG) as robot:
        person = Hasty(robot, 2)
        findings = set_up(robot, person, said.append, options)
    assert findings.saved
    assert findings.problems == ()
    assert findings.counts_per_revolution == 360
    assert person.asked.count("counts_left") == 3
    again = (
        "the left counter counted 0 and the right one 0: turn the left wheel, forward, and press"
    )
    assert sum(line.startswith(again) for line in said) == 2
    with raised_robot(WRONG) as robot:
        findings = set_up(robot, Hasty(robot, 99), said.append, options)
    assert findings.is_complete
    assert "counts_per_revolution is doubtful: not counted" in findings.problems[0]


@pytest.mark.parametrize("answers", [{"raised": "no"}, {"save": "no"}])
def test_a_wrong_enter_forgets_nothing(tmp_path: Path, answers: dict[str, str]) -> None:
    options = Options(progress=Progress("board", tmp_path))
    with raised_robot(WRONG) as robot:
        with pytest.raises(LinkLost):
            set_up(robot, PullsTheCable(robot), lambda _: None, options)
        robot.plug()
        robot.advance(3.0)
        person = Watched(robot, {**UNTUNED, **answers})
        assert not set_up(robot, person, lambda _: None, replace(options, resume=True)).saved
        person = Watched(robot, UNTUNED)
        assert set_up(robot, person, lambda _: None, replace(options, resume=True)).saved
    assert "first" not in person.asked
    assert Progress("board", tmp_path).load() == {}


def test_no_time_is_left_after_wheels_that_cannot_be_measured() -> None:
    told: list[float] = []
    with raised_robot({"left.winding_scale": 7}) as robot:
        options = Options(left=told.append)
        set_up(robot, SimulatedPerson(robot, {"save": "no"}), lambda _: None, options)
    assert told[-1] == 0.0
    assert max(told) > 30.0


def test_gains_that_are_a_little_better_than_the_noise_say_so() -> None:
    pairs = tuple(Pair(0.1, 0.1) for _ in range(200))
    times = tuple(0.05 * step for step in range(200))

    def trace(left: float, right: float) -> before_after.Trace:
        measured = tuple(Pair(0.1 + left, 0.1 + right) for _ in pairs)
        return before_after.Trace(times, pairs, measured, lag_s=0.1)

    def of(before: before_after.Trace, after: before_after.Trace) -> before_after.Proof:
        course = before_after.there_and_back(0.1, 1.0)
        return before_after.Proof(course, (before, after), (Fault(0), Fault(0)))

    noise = before_after.noise_mps((trace(0.01, 0.01), trace(0.01, 0.01)), 0, 1)
    assert 0.0005 < noise < 0.003
    within = of(trace(0.01, 0.01), trace(0.01 - 0.9 * noise, 0.01 - 0.9 * noise))
    assert not within.better
    within_mmps = 1000 * before_after.noise_mps(within.traces, 0, 1)
    assert f"as well, within the noise of {within_mmps:.1f} mm/s" in within.verdict()
    assert of(trace(0.01, 0.01), trace(0.01 - 1.2 * noise, 0.01 - 1.2 * noise)).better
    one_sided = of(trace(0.02, 0.01), trace(0.001, 0.014))
    assert not one_sided.better
    assert "the right wheel tracks worse" in one_sided.verdict()


def test_wheels_that_cannot_be_tuned_keep_what_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def identify(*_: object, **__: object) -> None:
        raise CommissioningFailed("no line fits")

    monkeypatch.setattr(setup, "identify", identify)
    with raised_robot(WRONG) as robot:
        findings = set_up(robot, SimulatedPerson(robot), lambda _: None)
    assert findings.wiring == WIRING
    assert findings.problems == ("no line fits",)
    assert findings.saved
    with raised_robot({"wheels_free": 0}) as robot:
        options = Options(on_the_floor=True)
        floor = set_up(robot, SimulatedPerson(robot), lambda _: None, options)
    assert not floor.is_complete
    assert floor.problems == ("no line fits",)


def test_on_the_floor_only_the_gains_change() -> None:
    with raised_robot({"wheels_free": 0}) as robot:
        person = Watched(robot)
        options = Options(on_the_floor=True)
        findings = set_up(robot, person, lambda _: None, options)
        assert robot.simulator.get("true.distance_m") < 30
    assert person.asked == ["floor", "tune", "save"]
    assert findings.wiring is None
    assert findings.velocity_feedforward == pytest.approx(1.365, rel=0.02)
    assert findings.saved
    with raised_robot({}) as robot:
        refused = set_up(robot, SimulatedPerson(robot), lambda _: None, options)
        assert not refused.is_complete
        assert refused.problems == ("make room for the robot, then begin again",)


@pytest.mark.parametrize("raised", [1, 0])
def test_without_a_yes_the_robot_keeps_its_values(raised: int) -> None:
    with raised_robot({**WRONG, "wheels_free": raised}) as robot:
        before = {name: robot.parameters[name] for name in CHANGED}
        findings = set_up(robot, SimulatedPerson(robot, {**UNTUNED, "save": "no"}), lambda _: None)
        robot.parameters.refresh()
        assert {name: robot.parameters[name] for name in CHANGED} == before
    assert not findings.saved
    assert findings.is_complete == bool(raised)


def test_a_file_takes_the_values_in_place_of_the_robot(tmp_path: Path) -> None:
    kept = tmp_path / "kept.yaml"
    with raised_robot({**WRONG, "counts_per_revolution": 1440}) as robot:
        person = SimulatedPerson(robot, UNTUNED)
        findings = set_up(robot, person, lambda _: None, Options(keep=kept))
        assert robot.parameters["counts_per_revolution"] == 360
        assert robot.parameters["motors_swapped"] == 0
    assert not findings.saved
    file = load_parameter_file(kept)
    assert file.board == "SIMULATED"
    assert file.values["counts_per_revolution"] == 1440
    assert file.values["motors_swapped"] == 1


class PullsTheCable(Watched):
    """A person who pulls the cable when asked for a size."""

    def answer(self, question: Question) -> str:
        if question.key == "wheel_radius":
            self.robot.unplug()
        return super().answer(question)


@pytest.mark.parametrize("resume", [True, False])
def test_an_interrupted_one_is_resumed_with_what_it_had_found(
    tmp_path: Path, *, resume: bool
) -> None:
    options = Options(progress=Progress("board", tmp_path))
    with raised_robot({**WRONG, "counts_per_revolution": 1440}) as robot:
        with pytest.raises(LinkLost):
            set_up(robot, PullsTheCable(robot), lambda _: None, options)
        robot.plug()
        robot.simulator.reset()
        robot.advance(1.0)
        assert robot.parameters["motors_swapped"] == 0
        person = Watched(robot, UNTUNED)
        findings = set_up(robot, person, lambda _: None, replace(options, resume=resume))
    assert ("first" in person.asked) == (not resume)
    assert ("counts_left" in person.asked) == (not resume)
    assert findings.wiring == WIRING
    assert findings.counts_per_revolution == 1440
    assert findings.saved
    assert Progress("board", tmp_path).load() == {}


@pytest.mark.whole
@pytest.mark.parametrize("kind", ["reset", "unplug"])
@pytest.mark.parametrize("seed", range(6))
def test_interrupted_anywhere_it_leaves_a_robot_that_stands_and_is_as_it_was(
    kind: str, seed: int
) -> None:
    reads = random.Random(seed).randrange(20, 3000)
    robot = InterruptedRobot(kind, reads)
    before = {name: robot.parameters[name] for name in CHANGED}
    with raised_robot({**WRONG, **load_plant("tt-1-48").settings}, robot):
        try:
            findings = set_up(robot, SimulatedPerson(robot), lambda _: None)
        except WheelwireError:
            findings = Findings()
        assert robot.was_interrupted
        assert not findings.saved
        robot.plug()
        robot.advance(3.0)
        assert not robot.simulator.get("drive_on")
        assert robot.simulator.get("stands_still")
        robot.parameters.refresh()
        assert {name: robot.parameters[name] for name in CHANGED} == before


# The last in its test drives; before, nothing is tuned.
@pytest.mark.parametrize(("reads", "tune"), [(30, "no"), (300, "no"), (1000, "no"), (9500, "yes")])
def test_samples_that_are_held_up_cost_a_motion_and_not_the_set_up(reads: int, tune: str) -> None:
    """For longer than `read` waits by itself, and less than a link that counts as lost."""
    robot = InterruptedRobot("hold up", reads)
    with raised_robot({**WRONG, **load_plant("tt-1-48").settings}, robot):
        findings = set_up(robot, SimulatedPerson(robot, {"tune": tune}), lambda _: None)
    assert robot.was_interrupted
    assert not findings.problems
    assert findings.wiring == WIRING
    assert findings.saved


def test_a_wrong_answer_is_found_out() -> None:
    swapped = set_up_raised({}, {"first": "right forward", "second": "forward"})
    assert "answers and hand disagree: the left counter counted 0" in swapped.problems[0]
    backward = set_up_raised({}, {"first": "left backward", "second": "backward"})
    assert "answers and hand disagree: the left counter counted -3600" in backward.problems[0]
    assert not backward.saved


def test_a_wrong_answer_is_not_kept_for_the_next_run(tmp_path: Path) -> None:
    options = Options(progress=Progress("board", tmp_path))
    with raised_robot({}) as robot:
        person = SimulatedPerson(robot, {"first": "left backward", "second": "backward"})
        assert not set_up(robot, person, lambda _: None, options).is_complete
    assert Progress("board", tmp_path).load() == {}


def test_looking_again_and_again_turns_no_wheel_far() -> None:
    for answers in ({"first": "again"}, {"first": "again", "second": "again"}):
        with raised_robot({**load_plant("tt-1-48").settings, "supply_v": 12.6}) as robot:
            person = Watched(robot, answers)
            with pytest.raises(ValueError, match="answer with"):  # no longer an answer
                set_up(robot, person, lambda _: None)
            assert abs(robot.simulator.get("true.left_turns")) < 1.5


def test_an_estop_ends_it() -> None:
    class PressesIt(Watched):
        def answer(self, question: Question) -> str:
            if question.key == "second":
                self.robot.estop()
            return super().answer(question)

    with raised_robot(WRONG) as robot:
        with pytest.raises(DeviceRefused, match="Emergency stop is latched"):
            set_up(robot, PressesIt(robot), lambda _: None)
        assert not robot.simulator.get("drive_on")


def test_contradictions_are_named_before_anything_moves() -> None:
    said: list[str] = []
    with raised_robot({}) as robot:
        # On trial, values are judged at its end, which is later than the set-up.
        with robot.parameters.trial():
            robot.parameters.set("control_rate_hz", 200)
            robot.parameters.set("overrun_limit_us", 2000)
            findings = set_up(robot, SimulatedPerson(robot), said.append)
        assert not robot.simulator.get("true.left_turns")
    assert any("overrun_limit_us is less than 1.5 control periods" in line for line in said)
    assert not findings.is_complete
    assert "contradict each other" in findings.problems[0]
