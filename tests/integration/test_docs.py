"""What the site shows is run, on a simulated robot: `support.pages` says which blocks, and how."""

from __future__ import annotations

import io
import re
import shlex
import shutil
import signal
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from typer.main import get_command

from support.command import PROGRAM, TIMEOUT_S
from support.pages import PAGES, REASONS, ROOT, Block, blocks, code_in_rows, count
from support.processes import talking
from support.typing_terminal import TypingTerminal
from support.waiting import undisturbed
from wheelwire import WheelwireError
from wheelwire.cli.app import application, run
from wheelwire.drivers.mock import MockDriver
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.parameters import PARAMETER_BY_NAME

RUN = [page for page in PAGES if any(not b.excuse and not b.test for b in blocks(page))]
ROBOT = {"counts_per_revolution": 1440}
"""The simulated robot is the one that the tutorial measures."""
PORTS = re.compile(r"/dev/ttyUSB[01]|/tmp/wheelwire\b|\bROBOT\b")
SHORTER = {
    "tune": "--yes --seconds 1",
    "monitor": "--seconds 0.5",
    "log record": "--seconds 0.5",
    "drive": "--seconds 0.5",
}
"""Commands that go on until Ctrl-C, or that a page lets drive for long."""
SUCCESS = {"doctor": (0, 30)}
"""A finding on the computer that runs the tests is not a failure of the page."""
OWN_FILES = {
    "my-profile.yaml": "host/wheelwire/simulation/profiles/noisy.yaml",
    "my-board.yaml": "boards/tb6612.yaml",
}


@pytest.fixture(scope="module")
def tutorial() -> Iterator[Simulator]:
    """Page after page on one robot, as a reader does."""
    with Simulator(settings=ROBOT) as simulator:
        # Page 5 asks a person to find it.
        for name, value in ROBOT.items():
            code, output = command_line(
                f"wheelwire params set {simulator.port} {name} {value} --save"
            )
            assert code == 0, output
        yield simulator


@pytest.fixture
def simulator(page: str, request: pytest.FixtureRequest) -> Iterator[Simulator]:
    if page.startswith("docs/tutorial/"):
        yield request.getfixturevalue("tutorial")
        return
    with Simulator() as simulator:
        yield simulator


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that a reader works in."""
    for name, like in OWN_FILES.items():
        shutil.copy(ROOT / like, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def fragment_names(robot: MockDriver) -> dict[str, object]:
    """What pages take for granted where they show only some lines of a program."""
    return {"robot": robot, "horn": lambda: None, "drives_well": lambda _robot: True}


@pytest.mark.parametrize("page", RUN)
def test_every_block_on_a_page_works(page: str, simulator: Simulator, reader: Path) -> None:
    for block in blocks(page):
        if block.excuse or block.test:
            continue
        if block.language != "python":
            for line in block.commands:
                carry_out(line, simulator.port, reader)
        elif "as robot:" in block.text and "import " in block.text:
            carry_out_program(block, simulator)
        else:
            with MockDriver(realtime=False) as robot:
                exec(compile(block.text, block.place, "exec"), fragment_names(robot))  # noqa: S102


def carry_out_program(block: Block, simulator: Simulator) -> None:
    """Run it; one that drives the simulated robot moves it. All leave it standing."""
    before = simulator.get("true.distance_m")
    program = PORTS.sub(simulator.port, block.text)
    program_output(program, block.place)
    if program != block.text and "robot.set_" in program:
        assert simulator.get("true.distance_m") > before + 0.1, block.place
    assert simulator.get("drive_on") == 0, block.place


def carry_out(line: str, port: str, folder: Path) -> None:
    """Run a command line of a page, shortened where it would go on for long."""
    line = PORTS.sub(port, line.partition("  #")[0])
    words = shlex.split(line)
    assert words[0] == "wheelwire", f"{line}: run it here, or say at the block why not"
    command = " ".join(words[1:3]) if words[1] in {"log", "params", "board"} else words[1]
    if command == "teleop":
        with TypingTerminal(*words[1:]) as terminal:
            terminal.wait_for("m/s  speed")
            terminal.press(b"q")
            assert terminal.wait() == 0, terminal.output
    elif command == "sim":
        simulate(words, folder)
    else:
        line = re.sub(r" --seconds \S+", "", line)
        if command in SHORTER:
            line = line.rstrip() + " " + SHORTER[command]
        code, output = command_line(line)
        assert code in SUCCESS.get(command, (0,)), (line, output)


def simulate(words: list[str], folder: Path) -> None:
    """Start a simulator as the page does, turn a wheel if it does, and end it by Ctrl-C."""
    link = ["--link", str(folder / "robot")]
    turning = words[2:3] == ["turn"]
    options = [] if turning else words[2:]
    with talking(*PROGRAM, "sim", *link, *options) as (process, line):
        assert str(folder / "robot") in line, words
        if turning:
            code, output = command_line(shlex.join([*words[:4], "0.1", *link]))
            assert code == 0, output
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=TIMEOUT_S)


def command_line(line: str) -> tuple[int, str]:
    """Exit code and output of a line of a shell, within this process, which is faster."""
    words, _, file = line.partition(" > ")
    output = io.StringIO()
    with (
        patch("sys.argv", shlex.split(words)),
        patch("sys.stdin", io.StringIO("yes\n")),
        redirect_stdout(output),
        redirect_stderr(output),
    ):
        code = run()
    if file:
        Path(file).write_text(output.getvalue())
    return code, output.getvalue()


def program_output(program: str, place: str) -> str:
    """What it prints, within this process, too; it ends by itself."""
    output = io.StringIO()
    with redirect_stdout(output):
        exec(compile(program, place, "exec"), {"__name__": "__main__"})  # noqa: S102
    return output.getvalue()


@pytest.mark.parametrize("page", PAGES)
def test_a_block_that_is_not_run_says_why(page: str) -> None:
    for block in blocks(page):
        assert not block.excuse or block.excuse in REASONS, block
        if block.test:
            file, _, test = block.test.partition(": ")
            assert f"def {test}(" in (ROOT / file).read_text("utf-8"), block


@pytest.mark.usefixtures("reader")
def test_code_in_rows_works(subtests: pytest.Subtests) -> None:
    found = [one for page in PAGES for one in code_in_rows(page)]
    expressions = {code: place for place, code in found if code.startswith("robot")}
    assert len(expressions) >= 10
    for code, place in expressions.items():
        # Only a robot in real time can be recorded.
        with subtests.test(place), MockDriver(realtime="record(" in code) as robot:
            names = {**fragment_names(robot), "seconds": 0.1}
            exec(compile(code, place, "exec"), names)  # noqa: S102


def test_commands_in_rows_exist(subtests: pytest.Subtests) -> None:
    found = [one for page in PAGES for one in code_in_rows(page)]
    commands = {code: place for place, code in found if code.startswith("wheelwire ")}
    assert len(commands) >= 40
    root: Any = get_command(application())
    for line, place in commands.items():
        with subtests.test(f"{place} {line}"):
            command = root
            words = line.split()[1:]
            if words[0] == "COMMAND":
                continue
            while words and words[0] in getattr(command, "commands", {}):
                command = command.commands[words.pop(0)]
            assert not hasattr(command, "commands") or not words, "no such command"
            options = {name for one in command.params for name in (*one.opts, *one.secondary_opts)}
            assert {word for word in words if word.startswith("--")} <= options


def test_at_least_fifty_blocks_are_run() -> None:
    numbers = count()
    assert set(numbers) <= REASONS | {"run", "run by another test"}
    assert numbers["run"] + numbers["run by another test"] >= 50


def test_every_make_target_on_a_page_exists() -> None:
    targets = set(re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(), re.M))
    asked = {
        (page, target)
        for page in PAGES
        for line in re.findall(r"(?:`|^ *)make ([a-z0-9 -]+)", (ROOT / page).read_text(), re.M)
        for target in line.split()
    }
    assert len(asked) > 20
    assert {use for use in asked if use[1] not in targets} == set()


def python(page: str) -> list[str]:
    return [block.text for block in blocks(page) if block.language == "python"]


@pytest.mark.parametrize("page", ["docs/python.md", "docs/arduino.md"])
def test_without_a_robot_the_program_drives_a_simulated_one(page: str) -> None:
    program = next(text for text in python(page) if "as robot:" in text)
    assert '`"mock"` in place of the port' in (ROOT / page).read_text("utf-8")
    printed = program_output(PORTS.sub("mock", program), page)
    assert "DRIVING" in printed or max(map(int, printed.split())) > 100


def test_the_callbacks_are_used_as_the_page_for_python_says() -> None:
    (program,) = (text for text in python("docs/python.md") if "horn()" in text)
    with MockDriver(realtime=False) as robot:
        rings: list[None] = []
        ring: Callable[[], None] = lambda: rings.append(None)  # noqa: E731
        exec(program, {"robot": robot, "horn": ring})  # noqa: S102
        robot.unplug()
        robot.plug()
        robot.advance(1.0)
        assert robot.parameters["max_duty"] == 0.5
        robot.simulator.set("left.encoder_dead", 1)
        for _ in range(100):
            with suppress(WheelwireError):
                robot.set_velocity(0.2, 0.0)
            robot.advance(0.05)
        assert rings == [None]


@pytest.mark.parametrize(
    ("wired", "says"),
    [
        ({}, "left +0."),
        ({"left.motor_reversed": 1}, "LEFT_REVERSED: "),
        ({"right.encoder_reversed": 1}, "RIGHT_REVERSED: "),
    ],
)
def test_the_way_by_hand_names_the_wheel_that_is_wired_wrongly(
    wired: dict[str, float], says: str
) -> None:
    program, _ = python("docs/tutorial/by-hand.md")
    with Simulator(settings={"wheels_free": 1, **wired}) as simulator:
        program = PORTS.sub(simulator.port, program)
        assert says in program_output(program, "docs/tutorial/by-hand.md")


def test_a_robot_that_drifts_drives_straight_as_the_page_says() -> None:
    (program,) = python("docs/troubleshooting.md")
    unequal = {"left.radius_scale": 0.99, "right.radius_scale": 1.01}

    def end_of(program: str) -> tuple[float, float]:
        with Simulator(settings=unequal) as simulator:
            program_output(PORTS.sub(simulator.port, program), "docs/troubleshooting.md")
            return simulator.get("true.x_m"), simulator.get("true.y_m")

    def corrected() -> tuple[float, float, float]:
        x, drifted = end_of(program)
        assert program.count("2.0, 0.0\n") == 1
        _, straight = end_of(program.replace("2.0, 0.0\n", f"{x}, {drifted}\n"))
        return x, drifted, straight

    # Late setpoints make the two drives differ.
    x, drifted, straight = undisturbed(corrected, lambda ends: abs(ends[2]) < 0.1 * ends[1])
    assert x == pytest.approx(2.0, abs=0.1)
    assert drifted > 0.1
    assert abs(straight) < 0.1 * drifted


def test_the_tutorials_way_to_the_feed_forward_finds_it() -> None:
    (_, program) = python("docs/tutorial/by-hand.md")
    with Simulator() as simulator:  # its counts are the default
        program = PORTS.sub(simulator.port, program)
        printed = program_output(program, "docs/tutorial/by-hand.md")
    found = float(printed.split()[-1])
    assert found == pytest.approx(PARAMETER_BY_NAME["velocity_feedforward"].default, rel=0.03)
