"""Questions, and answers from a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from wheelwire.errors import ConfigurationError, InvalidArgument
from wheelwire.tools.setup.questions import (
    NO,
    SKIP,
    WHEEL_AND_WAY,
    YES,
    AnswersFile,
    HandTurn,
    Question,
)

FIRST = Question("first", "Which", (*WHEEL_AND_WAY, "none"), "again")
SAVE = Question("save", "Save", (YES, NO), NO)
RADIUS = Question("wheel_radius", "Radius", (), "0.033", "wheel_radius")
COUNTS = Question(
    "counts_per_revolution", "Counts", ("hand", "tt-1-48"), "hand", "counts_per_revolution"
)


@pytest.mark.parametrize("given", ["left backward", "Left_Backward", " left-backward ", "lb"])
def test_an_answer_may_be_written_in_several_ways(given: str) -> None:
    assert FIRST.parse(given) == "left backward"
    assert COUNTS.parse("TT-1-48") == "tt-1-48"


def test_yes_and_no_are_words_and_booleans() -> None:
    assert [SAVE.parse(given) for given in (True, False, "yes", "n")] == [YES, NO, YES, NO]


def test_a_number_is_one_that_the_parameter_takes() -> None:
    assert RADIUS.parse("0.04") == "0.04"
    assert COUNTS.parse(1440) == "1440.0"
    with pytest.raises(InvalidArgument, match="33 mm"):
        RADIUS.parse(33)
    with pytest.raises(InvalidArgument, match=r"answer with hand, tt-1-48, a number"):
        COUNTS.parse("many")


def test_an_unknown_answer_is_refused_with_the_choices() -> None:
    with pytest.raises(InvalidArgument, match="first = 'up': answer with left forward, "):
        FIRST.parse("up")


def answers(tmp_path: Path, text: str) -> AnswersFile:
    file = tmp_path / "answers.yaml"
    file.write_text(text)
    return AnswersFile(file)


def test_a_file_answers_and_the_defaults_do_the_rest(tmp_path: Path) -> None:
    file = answers(tmp_path, "first: right forward\nsave: yes\nwheel_radius: 0.04\n")
    assert file.answer(FIRST) == "right forward"
    assert file.answer(SAVE) == YES
    assert float(file.answer(RADIUS)) == 0.04
    turn = Question("hand_left", "Turn", ("turned", SKIP), "turned", turn=HandTurn(0, 0.5))
    assert file.answer(turn) == SKIP
    assert file.answer(Question("resume", "Go on", (YES, NO), YES)) == NO


def test_a_file_lifts_no_robot_unless_it_says_that_somebody_does(tmp_path: Path) -> None:
    imu = Question("imu", "Find it", (YES, NO), YES)
    assert answers(tmp_path, "save: yes\n").answer(imu) == NO
    assert answers(tmp_path, "imu: yes\n").answer(imu) == YES


def test_what_only_a_person_can_see_must_be_in_the_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="no answer `first`: add it; it is one of left f"):
        answers(tmp_path, "save: no\n").answer(FIRST)


def test_a_scripted_robot_keeps_its_counts_where_the_file_has_none(tmp_path: Path) -> None:
    assert answers(tmp_path, "raised: yes\n").answer(COUNTS) == "hand"
