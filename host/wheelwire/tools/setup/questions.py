"""The questions of a set-up, and the sources of their answers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

from ...drivers.mock import MockDriver
from ...errors import ConfigurationError, InvalidArgument, ParameterOutOfRange
from ...parameters import checked_value
from ..files.board import shipped_boards
from ..files.plant import shipped_plants
from ..files.reading import Section, reading
from .driving import SIDES

Say = Callable[[str], None]
"""Called with a line on what is done and found."""

YES, NO = "yes", "no"
AGAIN = "again"
WHEEL_AND_WAY = tuple(f"{side} {way}" for side in SIDES for way in ("forward", "backward"))
NONE, BOTH = "none", "both"
HAND = "hand"
TURNED, HELD, SKIP = "turned", "held", "skip"
READY = "ready"
KEEP = "keep"

_SEEN_TURNS = 0.005
"""A person does not see a smaller turn."""
_HAND_LIMIT_S = 1.5
"""How long a hand pushes a wheel that does not give way."""
_MOVING = ("tilt.pitch_rad", "tilt.roll_rad", "push.turn_radps")
_MOVED = ("true.pitch_rad", "true.roll_rad", "true.yaw_rate_radps")
_LIFT_RAD = 0.5
_TURN_RADPS = 1.0


class HandTurn(NamedTuple):
    """A wheel to be turned by hand, forward positive."""

    side: int
    turns: float


@dataclass(frozen=True)
class Question:
    """A question.

    Attributes:
        key: Its name.
        text: As a person is asked.
        choices: The answers that are words.
        default: What Enter means; empty if a script has to give it.
        parameter: An answer may also be a value of this parameter.
        turn: What to do by hand before the answer.
    """

    key: str
    text: str
    choices: tuple[str, ...]
    default: str
    parameter: str = ""
    turn: HandTurn | None = None

    def parse(self, answer: object) -> str:
        """The answer as one of `choices`, or as a number's text.

        Raises:
            InvalidArgument: It is neither. The message lists the allowed answers.
        """
        # YAML makes booleans of yes and no. Without the type check 1 would be yes: 1 == True.
        words = {True: YES, False: NO}.get(answer, answer) if isinstance(answer, bool) else answer
        text = " ".join(str(words).lower().replace("_", " ").replace("-", " ").split())
        for choice in self.choices:
            plain = choice.replace("-", " ")
            initials = "".join(word[0] for word in plain.split())
            if text in (plain, initials):
                return choice
        try:
            number = float(str(words))
        except ValueError:
            number = math.nan
        # For a number the message has the bounds; for a word, what may be given.
        if self.parameter and math.isfinite(number):
            try:
                return repr(checked_value(self.parameter, number))
            except ParameterOutOfRange as error:
                raise InvalidArgument(str(error)) from error
        expected = [*self.choices, *(["a number"] if self.parameter else [])]
        raise InvalidArgument(f"{self.key} = {answer!r}: answer with {', '.join(expected)}")


def yes_or_no(key: str, text: str, default: str = NO) -> Question:
    """A question whose answer is `YES` or `NO`."""
    return Question(key, text, (YES, NO), default)


def _forms() -> dict[str, Question]:
    """The questions that a file may answer, by key."""
    seen = (*WHEEL_AND_WAY, NONE, BOTH, AGAIN)
    words = {
        "first": seen,
        "second": ("forward", "backward", *seen),
        "board": (*shipped_boards(), KEEP),
        **dict.fromkeys(("raised", "imu", "tune", "save"), (YES, NO)),
    }
    numbers = {
        "counts_per_revolution": (HAND, *shipped_plants()),
        "wheel_radius": (),
        "wheel_separation": (),
    }
    return {
        key: Question(key, "", choices, "", key if key in numbers else "")
        for key, choices in (words | numbers).items()
    }


class Person(Protocol):
    """Who answers."""

    def answer(self, question: Question) -> str:
        """One of the question's choices, or a number's text; see `Question.parse`."""


class AnswersFile:
    """Answers from a YAML file; another one answers what the file does not.

    Args:
        file: With answers by the key of their question.
        otherwise: Answers the rest. None: the defaults are taken.

    Raises:
        ConfigurationError: The file or one of its answers is invalid. Raised before anything moves.
    """

    def __init__(self, file: Path, otherwise: Person | None = None) -> None:
        self._file = file
        self._otherwise = otherwise
        forms = _forms()
        with reading(file, "answers") as content:
            self._answers = Section({} if content is None else content, forms).values
            for key, answer in self._answers.items():
                forms[key].parse(answer)

    def answer(self, question: Question) -> str:
        """As the file says.

        Raises:
            ConfigurationError: The answer is not one of the choices, or is missing and has no
                default.
        """
        if question.key in self._answers:
            try:
                return question.parse(self._answers[question.key])
            except InvalidArgument as error:
                raise ConfigurationError(f"{self._file}: {error}") from error
        if self._otherwise is not None:
            return self._otherwise.answer(question)
        # No default would be safe for these: only a person at the robot knows.
        if question.key in ("raised", "first", "second"):
            raise ConfigurationError(
                f"{self._file} has no answer `{question.key}`: add it; it is one of "
                f"{', '.join(choice for choice in question.choices if choice != AGAIN)}"
            )
        if question.turn is not None:
            return SKIP
        if question.key == "floor":
            return YES  # the option says so
        # A script's options say all that it wants. They do not include another run's results, or a
        # person who lifts the robot.
        return NO if question.key in ("resume", "imu") else question.default


class SimulatedPerson:
    """Answers by the truth of a simulated robot, turns its wheels, lifts it and turns it.

    Args:
        robot: In virtual time, which passes while a wheel is turned, or the robot is put down.
        answers: Given as they are, by the question's key.
    """

    def __init__(self, robot: MockDriver, answers: Mapping[str, str] | None = None) -> None:
        self._robot = robot
        self._answers = dict(answers or {})
        self._turns = self._true_turns()

    def answer(self, question: Question) -> str:
        """As the simulated robot is."""
        # A person sees what has turned since the last question.
        before, self._turns = self._turns, self._true_turns()
        if question.key in self._answers:
            return question.parse(self._answers[question.key])
        if question.turn is not None:
            return self._turn(question.turn)
        self._put_down()
        if question.key.startswith("imu_"):
            self.move(question.key)
        if question.key == "raised":
            return YES if self._get("wheels_free") else NO
        if question.key == "floor":
            return NO if self._get("wheels_free") else YES
        if question.key in ("first", "second"):
            return _seen(before, self._turns, question)
        if question.key in ("wheel_radius", "wheel_separation"):
            return repr(self._get(f"{question.key}_m"))
        return YES if question.key == "save" else question.default

    def move(self, key: str) -> None:
        """Begin what the question about the IMU asks for. The robot stands on the floor."""
        name, value = {
            "imu_rest": ("tilt.pitch_rad", 0.0),
            "imu_front": ("tilt.pitch_rad", -_LIFT_RAD),
            "imu_left": ("tilt.roll_rad", _LIFT_RAD),
            "imu_turn": ("push.turn_radps", _TURN_RADPS),
        }[key]
        self._robot.simulator.set(name, value)

    def _put_down(self) -> None:
        if not any(map(self._get, _MOVING)):
            return
        for name in _MOVING:
            self._robot.simulator.set(name, 0.0)
        while any(map(self._get, _MOVED)):
            self._robot.advance(0.1)

    def _turn(self, turn: HandTurn) -> str:
        name = f"{SIDES[turn.side]}.hand_turns"
        sim = self._robot.simulator
        sim.set(name, turn.turns)
        left = abs(turn.turns)
        patience_s = _HAND_LIMIT_S
        while left > 0.0 and patience_s > 0.0:
            self._robot.advance(0.1)
            now = abs(self._get(name))
            # Only a wheel that does not give way uses up the patience.
            patience_s = _HAND_LIMIT_S if now < left else patience_s - 0.1
            left = now
        sim.set(name, 0.0)
        # This turn of the wheel must not be mistaken for the next pulse's.
        self._turns = self._true_turns()
        return TURNED if left == 0.0 else HELD

    def _true_turns(self) -> tuple[float, float]:
        return self._get("true.left_turns"), self._get("true.right_turns")

    def _get(self, name: str) -> float:
        return self._robot.simulator.get(name)


def _seen(before: tuple[float, float], after: tuple[float, float], question: Question) -> str:
    moved = [b - a for a, b in zip(before, after, strict=True)]
    seen = [side for side in (0, 1) if abs(moved[side]) > _SEEN_TURNS]
    if len(seen) != 1:
        return question.parse(BOTH if seen else NONE)
    way = "forward" if moved[seen[0]] > 0 else "backward"
    both_words = f"{SIDES[seen[0]]} {way}"
    return both_words if both_words in question.choices else way
