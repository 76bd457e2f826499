"""`wheelwire board`: list, show, check, init."""

from __future__ import annotations

import json
from pathlib import Path

from support.command import Result, check_error, run, run_json
from wheelwire import errors
from wheelwire.board import Configuration
from wheelwire.tools.files.board import board_mapping, load_board, shipped_boards

ANSWERS = [
    *("esp32", "pwm_in1_in2", "mine", "any"),
    "y",  # the chip's own pull-ups
    *("25", "26", "27", "18", "19"),  # left: pwm, in1, in2, encoder
    *("33", "32", "4", "23", "13"),  # right
    *("21", "14", "-", "-"),  # standby, e-stop, no LED, no battery
]


def test_the_list_has_all_built_in_boards() -> None:
    listed = run_json("board", "list")
    assert [board["name"] for board in listed] == shipped_boards()
    assert {"esp32", "esp32s3", "esp32c6", "raspberry-pi"} == {b["chip"] for b in listed}
    assert "tb6612" in run("board", "list").stdout


def test_a_board_is_shown_with_its_pins_and_its_truth_table() -> None:
    assert run_json("board", "show", "tb6612") == board_mapping(load_board("tb6612"))
    shown = run("board", "show", "tb6612").stdout
    for text in ("left.pwm", "25", "standby", "brake", "high", "PWM low alone brakes"):
        assert text in shown


def test_a_good_board_is_found_good() -> None:
    result = run("board", "check", "l298n")
    assert (result.returncode, result.stdout) == (0, "l298n: nothing is wrong with this board\n")
    assert run_json("board", "check", "l298n") == {
        "board": "L298N, ESP32-DevKitC",
        "problems": [],
        "warnings": [],
    }


def test_every_problem_has_its_line(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    text = json.dumps(board_mapping(load_board("l298n")) | {"pwm_frequency_hz": 50, "led": 36})
    file.write_text(text)
    result = run("board", "check", str(file))
    assert result.returncode == errors.ConfigurationError.exit_code
    assert len(result.stdout.splitlines()) == 2
    assert f"{file}: led = 36: GPIO 36 of the ESP32 is an input only" in result.stdout
    as_json = run("board", "check", str(file), "--json")
    assert as_json.returncode == errors.ConfigurationError.exit_code
    assert len(json.loads(as_json.stdout)["problems"]) == 2


def made(
    folder: Path, *options: str, answers: list[str], code: int = 0
) -> tuple[Result, Configuration]:
    """What `board init` says, and the board that it has written."""
    file = folder / "mine.yaml"
    typed = "".join(f"{answer}\n" for answer in answers)
    result = run("board", "init", str(file), *options, typed=typed)
    assert result.returncode == code, result.stderr
    return result, load_board(file)


def test_the_answers_make_a_file_that_can_be_used(tmp_path: Path) -> None:
    _, board = made(tmp_path, answers=ANSWERS)
    assert board.problems() == []
    assert (board.name, board.left.pwm, board.standby, board.led) == ("mine", 25, 21, None)


def test_a_pin_that_cannot_be_used_is_asked_for_again(tmp_path: Path) -> None:
    answers = [*ANSWERS[:5], "34", "twelve", "12", *ANSWERS[5:]]
    result, board = made(tmp_path, answers=answers)
    assert "GPIO 34 of the ESP32 is an input only" in result.stderr
    assert "give the number of a GPIO" in result.stderr
    assert "the level of GPIO 12 at reset" in result.stderr
    assert board.left.pwm == 25


def test_a_board_like_another_is_made_by_enter_alone(tmp_path: Path) -> None:
    result, board = made(tmp_path, "--like", "tb6612", "--json", answers=[""] * 30)
    assert json.loads(result.stdout)["board"] == board_mapping(load_board("tb6612"))
    assert board == load_board("tb6612")


def test_a_missing_resistor_is_reported_and_the_answers_are_kept(tmp_path: Path) -> None:
    answers = [""] * 18 + ["n", "n"]  # no resistor on either enable
    code = errors.ConfigurationError.exit_code
    result, board = made(tmp_path, "--like", "l298n", answers=answers, code=code)
    assert result.stdout.count("fit some 10 kOhm to ground") == 2
    assert f"correct it, then run `wheelwire board check {tmp_path / 'mine.yaml'}`" in result.stdout
    assert board.left == load_board("l298n").left


def test_a_file_that_exists_is_not_overwritten(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("mine")
    check_error(run("board", "init", str(file)), errors.ConfigurationError)
    assert file.read_text() == "mine"
