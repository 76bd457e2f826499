"""ROBOT: which robot a command means. No robot is opened here."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from support.cases import each
from support.command import check_error, run
from support.usb_ports import plug_in
from wheelwire import errors
from wheelwire.cli import address
from wheelwire.cli.address import Address, Given, looks_like_address
from wheelwire.connect import ENVIRONMENT
from wheelwire.errors import InvalidArgument, RobotNotNamed
from wheelwire.link.ports import SerialPort

USB0, ACM0 = (
    SerialPort(name, None, "", 0x303A, 0x1001, None, True, "native USB", None)
    for name in ("/dev/ttyUSB0", "/dev/ttyACM0")
)
PUT_IN = {
    "info": (),
    "monitor": (),
    "estop": (),
    "stop": (),
    "params list": (),
    "params get": ("wheel_radius",),
    "params set": ("wheel_radius", "0.03"),
    "params save": ("wheel_radius",),
    "params reset": ("--yes",),
    "restart": (),
}
MOVING = {"drive": ("--linear", "0.1"), "clear": (), "tune": ()}


@pytest.fixture
def candidates(monkeypatch: pytest.MonkeyPatch) -> list[SerialPort]:
    """Those that are plugged in; empty at first. No robot is named in the environment."""
    found: list[SerialPort] = []
    monkeypatch.delenv(ENVIRONMENT, raising=False)
    monkeypatch.setattr(address, "likely_boards", lambda: found)
    return found


@pytest.mark.parametrize("moves", [False, True])
def test_the_argument_comes_first_and_the_environment_second(
    candidates: list[SerialPort], monkeypatch: pytest.MonkeyPatch, *, moves: bool
) -> None:
    candidates.append(USB0)
    monkeypatch.setenv(ENVIRONMENT, "robot.yaml")
    assert Given("/dev/ttyS1").resolve(moves=moves) == Address("/dev/ttyS1")
    assert Given().resolve(moves=moves) == Address("robot.yaml")
    monkeypatch.setenv(ENVIRONMENT, "")
    assert Given().resolve(moves=moves, yes=True) == Address("/dev/ttyUSB0")


def test_the_only_candidate_is_taken_and_named(
    candidates: list[SerialPort],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    candidates.append(USB0)
    assert Given().resolve() == Address("/dev/ttyUSB0")
    assert "/dev/ttyUSB0 is the only candidate (native USB)" in capsys.readouterr().err
    monkeypatch.setattr(sys, "argv", ["wheelwire", "info", "--json"])
    Given().resolve()
    assert capsys.readouterr() == ("", "")


def test_none_and_several_candidates_are_errors_that_say_what_to_do(
    candidates: list[SerialPort],
) -> None:
    with pytest.raises(RobotNotNamed, match=r"data cable.*WHEELWIRE_ROBOT"):
        Given().resolve(yes=True)
    candidates += [USB0, ACM0]
    with pytest.raises(
        RobotNotNamed, match=r"/dev/ttyUSB0 \(native USB\), /dev/ttyACM0 \(native USB\); name one"
    ):
        Given().resolve(yes=True)


@each("command", [*PUT_IN, *MOVING, "flash"])
def test_every_command_takes_the_robot_of_argument_environment_and_port(
    command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = (PUT_IN | MOVING).get(command, ())
    yes = ["--yes"] if command in MOVING else []

    def refusal(error: type[errors.WheelwireError], *robot: str, named: str) -> str:
        arguments = [*command.split(), *robot, *words, *(yes if robot or not named else ())]
        result = run(*arguments, "--json", WHEELWIRE_ROBOT=named)
        assert result.returncode == error.exit_code, result.stderr
        return str(json.loads(result.stderr)["message"])

    # The only candidate is not there after all: the error names it.
    plug_in(monkeypatch, "/dev/no-such-port")
    assert "cannot open /dev/no-such-port" in refusal(errors.PortUnavailable, named="")
    assert "ROBOT is empty" in refusal(InvalidArgument, "", named="/dev/no-such-port")
    plug_in(monkeypatch, "/dev/ttyUSB0", "/dev/ttyUSB1")
    refusal(errors.ConfigurationError, named="missing.yaml")
    assert "/dev/ttyUSB0 (CP210x" in refusal(RobotNotNamed, named="")


@pytest.mark.parametrize("command", MOVING)
def test_a_command_that_moves_wheels_refuses_if_nobody_can_be_asked(
    command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    plug_in(monkeypatch, "/dev/no-such-port")
    line = check_error(run(command, *MOVING[command], WHEELWIRE_ROBOT=""), RobotNotNamed)
    assert "/dev/no-such-port" in line
    assert "name the robot" in line


@each(
    ("text", "expected"),
    [
        ("/dev/ttyUSB0", True),
        ("socket://localhost:3333", True),
        ("unix:/run/robot.sock", True),
        ("robot.yaml", True),
        ("mock", True),
        ("here", True),
        ("wheel_radius", False),
        ("wheel_radus", False),
        ("0", False),
    ],
)
def test_an_address_is_distinguished_from_a_parameters_name(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, expected: bool
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "here").write_text("")
    (tmp_path / "wheel_radius").write_text("")
    assert looks_like_address(text) is expected


@each(
    ("words", "message"),
    [
        (("get",), "Missing argument 'NAME'"),
        (("get", "mock"), "Missing argument 'NAME'"),
        (("get", "mock", "max_duty", "1"), "Unexpected argument '1'"),
        (("set",), "Missing argument 'NAME'"),
        (("set", "max_duty"), "Missing argument 'VALUE'"),
        (("set", "/dev/none", "max_duty"), "Missing argument 'VALUE'"),
        (("set", "mock", "max_duty", "1", "2"), "Unexpected argument '2'"),
        (("set", "max_duty", "1", "--svae"), "No such option: --svae"),
    ],
)
def test_forgotten_and_superfluous_arguments_are_named(
    words: tuple[str, ...], message: str
) -> None:
    result = run("params", *words)
    assert result.returncode == 2
    assert result.stderr == f"wheelwire: {message}; see `wheelwire params {words[0]} --help`\n"


@each(
    ("command", "arguments"),
    [
        ("info", "[ROBOT]"),
        ("params get", "[ROBOT] NAME"),
        ("params set", "[ROBOT] NAME VALUE"),
        ("params save", "[ROBOT] [NAME]..."),
    ],
)
def test_help_shows_what_may_be_left_out(command: str, arguments: str) -> None:
    text = " ".join(run(*command.split(), "--help").stdout.split())
    assert f"Usage: wheelwire {command} [OPTIONS] {arguments} " in text
    assert "WHEELWIRE_ROBOT" in text


def test_a_baud_rate_is_of_a_port() -> None:
    for robot in ("mock", "robot.yaml"):
        with pytest.raises(InvalidArgument, match="a baud rate is only for ports"):
            Address(robot, 9600).open()


def robot_file(folder: Path, text: str) -> Address:
    file = folder / "robot.yaml"
    file.write_text(text)
    return Address(str(file))


def test_a_change_that_would_not_hold_is_refused(tmp_path: Path) -> None:
    Address("/dev/ttyUSB0").check_parameters(["max_duty"], save=True)
    Address("mock").check_parameters(["max_duty"], save=False)
    with pytest.raises(InvalidArgument, match="cannot save parameters"):
        Address("mock").check_parameters(["max_duty"], save=True)
    serial = robot_file(tmp_path, "driver: serial\nparameters: {max_duty: 0.5}")
    serial.check_parameters(["wheel_radius"], save=True)
    with pytest.raises(
        InvalidArgument, match=r"robot\.yaml sets max_duty each time .* in that file"
    ):
        serial.check_parameters(["max_duty"], save=False)
    pins = robot_file(tmp_path, "driver: l298n\nparameters: {max_duty: 0.5}")
    pins.check_parameters(["max_duty"], save=False)
    with pytest.raises(InvalidArgument, match="add `store: FILE`"):
        pins.check_parameters(["max_duty"], save=True)
    robot_file(tmp_path, "driver: l298n\nstore: s").check_parameters(["max_duty"], save=True)


def test_firmware_is_written_at_a_serial_port_only(tmp_path: Path) -> None:
    assert Address("/dev/ttyACM0").serial_port() == "/dev/ttyACM0"
    file = robot_file(tmp_path, "driver: serial\nserial: {port: /dev/ttyUSB7}")
    assert file.serial_port() == "/dev/ttyUSB7"
    for other in (Address("mock"), Address("unix:/x"), robot_file(tmp_path, "driver: pigpio")):
        with pytest.raises(InvalidArgument, match="is not a serial port"):
            other.serial_port()


def complete(*words: str) -> list[str]:
    """What bash offers for the last word."""
    result = run(
        _WHEELWIRE_COMPLETE="complete_bash",
        COMP_WORDS=" ".join(["wheelwire", *words]),
        COMP_CWORD=str(len(words)),
    )
    assert result.stderr == ""
    return result.stdout.split()


def test_a_shell_completes_robots_and_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    plug_in(monkeypatch, "/dev/ttyUSB0", "/dev/ttyUSB1")
    assert complete("drive", "") == ["/dev/ttyUSB0", "/dev/ttyUSB1", "mock"]
    assert complete("info", "/dev/t") == ["/dev/ttyUSB0", "/dev/ttyUSB1"]
    assert complete("params", "get", "wheel_") == ["wheel_radius", "wheel_separation"]
    assert "monitor" in complete("")


def test_a_shell_completes_files_by_their_absolute_path(tmp_path: Path) -> None:
    file = tmp_path / "robot [1].yaml"
    file.touch()
    assert str(file) in " ".join(complete("params", "import", "mock", str(tmp_path / "r")))
