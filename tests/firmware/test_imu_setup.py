"""The IMU's part of a set-up over the firmware's core, with a hand at the simulated robot."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import islice
from statistics import fmean

import pytest

from wheelwire.board import ImuSensor
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import LinkLost
from wheelwire.tools.files.board import load_board
from wheelwire.tools.setup import imu as imu_setup
from wheelwire.tools.setup.imu import set_up_imu
from wheelwire.tools.setup.questions import Question, SimulatedPerson
from wheelwire.tools.setup.setup import Options, set_up
from wheelwire_protocol.codes import ConfigurationState
from wheelwire_protocol.peripherals import Axis

BIAS_RADPS = 0.02
COUNT_RADPS = 0.0003
"""One count of the gyroscope, which is also what rounding and noise leave of its bias."""
ASKED = ["imu", "imu_rest", "imu_front", "imu_left", "imu_turn"]
SHORT_S = 3.0
"""How long setup waits for a hand that does nothing."""


class Hand(SimulatedPerson):
    """A person who is asked, and does by hand what `moves` says in place of what was asked.

    Each move serves once: asked again, this person does it right.
    """

    def __init__(
        self,
        robot: MockDriver,
        moves: Mapping[str, Callable[[MockDriver], None]] | None = None,
        answers: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(robot, answers)
        self.robot = robot
        self.asked: list[str] = []
        self.questions: list[Question] = []
        self._moves = dict(moves or {})

    def answer(self, question: Question) -> str:
        self.asked.append(question.key)
        self.questions.append(question)
        return super().answer(question)

    def move(self, key: str) -> None:
        move = self._moves.pop(key, None)
        if move is None:
            super().move(key)
        else:
            move(self.robot)


class Run:
    """One set-up of an IMU, and what it reported."""

    def __init__(self, robot: MockDriver, person: Hand, *, keeps: bool = True) -> None:
        self.said: list[str] = []
        self.problems: list[str] = []
        self.found = set_up_imu(robot, person, self.said.append, self.problems.append, keeps=keeps)


@pytest.fixture
def patient_robot() -> Iterator[MockDriver]:
    with MockDriver(realtime=False) as robot:
        yield robot


@pytest.fixture
def robot(patient_robot: MockDriver, monkeypatch: pytest.MonkeyPatch) -> MockDriver:
    """As setup takes less time for it."""
    monkeypatch.setattr(imu_setup, "_REST_S", 0.5)
    monkeypatch.setattr(imu_setup, "_HOLD_S", 0.2)
    return patient_robot


def settings(robot: MockDriver, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        robot.simulator.set(name, value)


def mount(robot: MockDriver, forward: Axis, up: Axis) -> None:
    settings(robot, {"imu.forward": forward, "imu.up": up, "imu.bias": BIAS_RADPS})


def entry_of(robot: MockDriver) -> ImuSensor:
    state, board = robot.board.read()
    assert board is not None
    assert state is ConfigurationState.STORED
    (entry,) = (one for one in board.peripherals if isinstance(one, ImuSensor))
    return entry


def means(robot: MockDriver) -> tuple[list[float], list[float]]:
    """What the IMU measures, in the robot's axes."""
    robot.sensors.start(200)
    samples = list(islice(robot.imu.samples(), 200))
    gyro, acceleration = (
        [fmean(axis) for axis in zip(*vectors, strict=True)]
        for vectors in ([s.gyro for s in samples], [s.acceleration for s in samples])
    )
    return gyro, acceleration


def tilt(robot: MockDriver, roll_rad: float = 0.0, pitch_rad: float = 0.0) -> None:
    settings(robot, {"tilt.roll_rad": roll_rad, "tilt.pitch_rad": pitch_rad})


def nothing(_robot: MockDriver) -> None:
    """What a person does who was not listening."""


# --- found ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("forward", "up"),
    [
        (Axis.X, Axis.Z),
        (Axis.MINUS_Z, Axis.Y),
        (Axis.Y, Axis.MINUS_X),
        (Axis.MINUS_Y, Axis.MINUS_Z),
    ],
)
def test_a_mounting_is_found_saved_and_right(
    patient_robot: MockDriver, forward: Axis, up: Axis
) -> None:
    robot = patient_robot
    mount(robot, forward, up)
    person = Hand(robot)
    run = Run(robot, person)
    assert run.problems == []
    assert run.found is not None
    assert run.found.saved
    entry = entry_of(robot)
    assert (entry.forward, entry.up) == (forward, up)
    bias = [0.0, 0.0, 0.0]
    bias[up % 3] = BIAS_RADPS if up < Axis.MINUS_X else -BIAS_RADPS
    assert entry.bias == pytest.approx(bias, abs=COUNT_RADPS)
    assert run.found.bias == pytest.approx(bias, abs=COUNT_RADPS)
    assert person.asked == [*ASKED, "save"]
    # From now on a sample is in the robot's axes, without the bias.
    gyro, acceleration = means(robot)
    assert gyro == pytest.approx([0, 0, 0], abs=COUNT_RADPS)
    assert acceleration == pytest.approx([0, 0, 9.81], abs=0.05)
    tilt(robot, pitch_rad=-0.5)
    robot.advance(1.0)
    assert means(robot)[1] == pytest.approx(
        [9.81 * math.sin(0.5), 0, 9.81 * math.cos(0.5)], abs=0.05
    )


# --- the second day ------------------------------------------------------------------------------


def test_a_second_time_it_is_left_as_it_is_or_found_the_same(robot: MockDriver) -> None:
    mount(robot, Axis.X, Axis.MINUS_Z)
    Run(robot, Hand(robot))
    before = entry_of(robot)
    person = Hand(robot)
    left = Run(robot, person)
    assert person.asked == ["imu"]
    assert "is mounted, again?" in person.questions[0].text
    assert (left.found, left.problems) == (None, [])
    assert entry_of(robot) == before
    again = Run(robot, Hand(robot, answers={"imu": "yes"}))
    assert again.found is not None
    assert (again.found.forward, again.found.up) == ("x", "-z")
    # The bias that was saved is not taken off once more.
    assert again.found.bias == pytest.approx(before.bias, abs=COUNT_RADPS)
    assert entry_of(robot).bias == pytest.approx(before.bias, abs=COUNT_RADPS)


def test_without_a_yes_nothing_is_written(robot: MockDriver) -> None:
    mount(robot, Axis.X, Axis.Z)
    before, boot = entry_of(robot), robot.simulator.get("boot_id")
    run = Run(robot, Hand(robot, answers={"save": "no"}))
    assert run.found is not None
    assert (run.found.forward, run.found.saved) == ("x", False)
    assert "not saved" in run.said
    assert entry_of(robot) == before
    assert robot.simulator.get("boot_id") == boot


# --- people --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "move", "sentence"),
    [
        ("imu_rest", partial(tilt, pitch_rad=0.5), "the robot stands tilted by 29 degrees"),
        ("imu_front", partial(tilt, roll_rad=0.5), "which is the same line: lift the front first"),
        ("imu_front", partial(tilt, pitch_rad=0.5), "one of them was the rear or the right side"),
        ("imu_left", partial(tilt, roll_rad=-0.5), "one of them was the rear or the right side"),
        ("imu_left", partial(tilt, pitch_rad=-0.5), "which is the same line: lift the front first"),
        ("imu_front", partial(tilt, pitch_rad=-0.5, roll_rad=0.5), "was between two axes"),
        ("imu_front", partial(tilt, pitch_rad=-1.3), "lift was 7. degrees: lift the robot by"),
    ],
)
def test_a_wrong_movement_is_reported_and_the_question_repeated(
    robot: MockDriver, key: str, move: Callable[[MockDriver], None], sentence: str
) -> None:
    mount(robot, Axis.Y, Axis.Z)
    person = Hand(robot, {key: move})
    run = Run(robot, person)
    assert [line for line in run.said if re.search(sentence, line)]
    assert person.asked.count(key) == 2
    assert run.problems == []
    assert (entry_of(robot).forward, entry_of(robot).up) == (Axis.Y, Axis.Z)


def to_the_right(robot: MockDriver) -> None:
    robot.simulator.set("push.turn_radps", -1.0)


def test_a_turn_to_the_right_contradicts_and_nothing_is_saved(robot: MockDriver) -> None:
    class AlwaysToTheRight(Hand):
        def move(self, key: str) -> None:
            if key == "imu_turn":
                to_the_right(self.robot)
            else:
                super().move(key)

    mount(robot, Axis.X, Axis.Z)
    before = entry_of(robot)
    person = AlwaysToTheRight(robot)
    run = Run(robot, person)
    assert person.asked == [*ASKED, "imu_turn", "imu_turn"]
    assert run.found is None
    (problem,) = run.problems
    assert "measured a turn to the right, by 60 degrees" in problem
    assert "contradict each other" in problem
    assert entry_of(robot) == before


def test_a_robot_that_is_never_put_down_is_noticed(
    robot: MockDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Holds(Hand):
        def _put_down(self) -> None:
            if self.asked[-1] != "imu_left" or self.asked.count("imu_left") > 1:
                super()._put_down()

    monkeypatch.setattr(imu_setup, "_PATIENCE_S", SHORT_S)
    person = Holds(robot, {"imu_left": nothing})
    run = Run(robot, person)
    assert "after 3 s the robot still was not level: put it down first" in run.said
    assert run.found is not None


def test_a_robot_that_shakes_is_given_up(
    robot: MockDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(imu_setup, "_SETTLING_S", 4.0)
    settings(robot, {"imu.noise": 10})
    person = Hand(robot)
    run = Run(robot, person)
    assert person.asked == ["imu", "imu_rest", "imu_rest", "imu_rest"]
    (problem,) = run.problems
    assert problem.startswith("the IMU's values stay as they were: the robot moves or shakes")


def test_a_hand_that_lets_go_late_is_waited_for(robot: MockDriver) -> None:
    def turning(robot: MockDriver) -> None:
        robot.simulator.set("push.turn_radps", 0.2)

    mount(robot, Axis.X, Axis.Z)
    said: list[str] = []
    person = Hand(robot, {"imu_rest": turning})
    reads = []

    def read(timeout: float = 1.0) -> object:
        reads.append(timeout)
        if len(reads) == 100:
            robot.simulator.set("push.turn_radps", 0.0)
        return MockDriver.read(robot, timeout)

    robot.read = read  # type: ignore[assignment, method-assign]
    found = set_up_imu(robot, person, said.append, said.append, keeps=True)
    assert person.asked == [*ASKED, "save"]
    assert found is not None
    assert found.bias == pytest.approx((0, 0, BIAS_RADPS), abs=COUNT_RADPS)


# --- robots --------------------------------------------------------------------------------------


def pull_the_imus_plug(robot: MockDriver) -> None:
    robot.simulator.set("imu.absent", 1)


@pytest.mark.parametrize("key", ["imu_rest", "imu_front", "imu_left", "imu_turn"])
def test_an_imu_that_is_unplugged_half_way_ends_its_part(robot: MockDriver, key: str) -> None:
    mount(robot, Axis.X, Axis.Z)
    before = entry_of(robot)
    person = Hand(robot, {key: pull_the_imus_plug})
    run = Run(robot, person)
    assert run.found is None
    (problem,) = run.problems
    assert problem.startswith("IMU STALE, ABSENT: ")
    assert person.asked[-1] == key
    assert entry_of(robot) == before


def reset(robot: MockDriver) -> None:
    robot.simulator.reset()


def test_a_board_that_is_reset_half_way_ends_the_set_up(robot: MockDriver) -> None:
    before = entry_of(robot)
    person = Hand(robot, {"imu_left": reset})
    findings = set_up(robot, person, lambda _: None)
    assert (findings.is_complete, findings.imu) == (False, None)
    (problem,) = findings.problems
    assert problem.startswith("the board was reset meanwhile")
    assert person.asked[-1] == "imu_left"
    assert entry_of(robot) == before
    robot.parameters.refresh()
    assert robot.parameters["rolling_velocity_mps"] == 0.25


@pytest.mark.parametrize("key", ["imu_front", "imu_turn", "save"])
def test_a_pulled_cable_leaves_the_robot_as_it_was(robot: MockDriver, key: str) -> None:
    class PullsTheCable(Hand):
        def answer(self, question: Question) -> str:
            answer = super().answer(question)
            if question.key == key:
                self.robot.unplug()
            return answer

    mount(robot, Axis.X, Axis.Z)
    before = entry_of(robot)
    with pytest.raises(LinkLost):
        Run(robot, PullsTheCable(robot))
    robot.plug()
    robot.advance(3.0)
    assert entry_of(robot) == before
    robot.parameters.refresh()
    assert robot.parameters["rolling_velocity_mps"] == 0.25
    tilt(robot)
    robot.advance(1.0)
    again = Run(robot, Hand(robot)).found
    assert again is not None
    assert (again.forward, again.up, again.saved) == ("x", "z", True)


def test_a_robot_without_an_imu_hears_nothing_of_it(robot: MockDriver) -> None:
    robot.board.take_up(load_board("tb6612"))
    person = Hand(robot)
    run = Run(robot, person)
    assert (run.found, run.said, run.problems, person.asked) == (None, [], [], [])


def test_a_board_that_nobody_confirmed_is_left_alone() -> None:
    with MockDriver(realtime=False) as fresh:
        fresh.simulator.set("board_unwritten", 1)
        fresh.simulator.reset()
        fresh.advance(1.0)
        assert Run(fresh, Hand(fresh)).said == []


# --- the whole set-up ----------------------------------------------------------------------------


def test_it_is_the_first_part_of_a_set_up_which_goes_on(robot: MockDriver) -> None:
    mount(robot, Axis.X, Axis.Z)
    settings(robot, {"wheels_free": 1})
    person = Hand(robot, answers={"tune": "no", "counts_per_revolution": "360"})
    findings = set_up(robot, person, lambda _: None)
    assert findings.imu is not None
    assert findings.imu.saved
    assert findings.saved
    assert findings.problems == ()
    assert person.asked.index("imu_turn") < person.asked.index("raised")
    # Put down again before the wheels turn.
    assert robot.simulator.get("true.roll_rad") == 0
    assert robot.simulator.get("push.turn_radps") == 0


def test_a_stale_imu_is_a_problem_of_a_set_up_that_goes_on(robot: MockDriver) -> None:
    settings(robot, {"wheels_free": 1, "imu.absent": 1})
    robot.advance(0.5)
    person = Hand(robot, answers={"tune": "no", "counts_per_revolution": "360"})
    findings = set_up(robot, person, lambda _: None)
    assert findings.imu is None
    assert findings.saved
    assert findings.is_complete
    (problem,) = findings.problems
    assert problem.startswith("IMU STALE, ABSENT: ")


def test_on_the_floor_it_is_no_part_of_it(robot: MockDriver) -> None:
    person = Hand(robot, answers={"tune": "no"})
    set_up(robot, person, lambda _: None, Options(on_the_floor=True))
    assert person.asked == ["floor", "tune"]
