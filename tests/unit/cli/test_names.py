"""A robot is found by each of its names, and a name that is nearly right is asked back."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from support.attached import wait_for_holder
from support.cases import each
from support.command import check_error, output, run, run_json
from support.core_device import CoreDevice
from support.pty_device import PtyDevice
from support.usb_ports import plug_in
from wheelwire import connect, errors, open_driver
from wheelwire.cli import local
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.ports import SerialPort
from wheelwire.link.sharing_folder import DIRECTORY_VARIABLE
from wheelwire_protocol.codes import SupervisorState

NAMES = ("s1", "./s1", "DEVICE", "ABSOLUTE", "~/s1", "other/link", "robot.yaml", "BOARD")


@pytest.fixture
def device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[PtyDevice]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(tmp_path / "taps"))
    with PtyDevice(tmp_path / "s1", CoreDevice()) as device:
        (tmp_path / "other").mkdir()
        (tmp_path / "other" / "link").symlink_to(device.path)
        (tmp_path / "robot.yaml").write_text("driver: serial\nserial: {port: ~/s1}\n")
        yield device


def written(name: str, device: PtyDevice, board_id: str = "") -> str:
    return {
        "DEVICE": str(device.path.resolve()),
        "ABSOLUTE": str(device.path),
        "BOARD": board_id,
    }.get(name, name)


@pytest.mark.parametrize("held", [name for name in NAMES if name != "BOARD"])
def test_a_robot_that_a_program_holds_is_found_by_each_of_its_names(
    held: str, device: PtyDevice
) -> None:
    with connect(written(held, device)) as robot:
        assert robot.has_device
        board_id = robot.info.device.board_id
        wait_for_holder(str(device.path))
        for name in NAMES:
            address = written(name, device, board_id)
            run_json("info", address)
            said = run("estop", address)
            assert said.returncode == 0, (name, said.stderr)
            assert "attached to the link of" in said.stderr
            assert device.device.supervisor is SupervisorState.ESTOPPED
            robot.clear_estop()


def test_a_port_that_this_program_holds_itself(device: PtyDevice) -> None:
    """A notebook's cell, for example, that is run again."""
    with (
        SerialDriver(str(device.path)),
        pytest.raises(errors.PortUnavailable, match="this program has it open already") as raised,
    ):
        SerialDriver(str(device.path.resolve()))
    assert "Ctrl-C" not in str(raised.value)


@each(
    ("words", "kind", "hint"),
    [
        ("info ttyUSB0", errors.PortUnavailable, "did you mean /dev/ttyUSB0?"),
        ("info L298N", errors.InvalidArgument, "did you mean l298n as"),
        ("info Mock", errors.InvalidArgument, "did you mean mock,"),
        ("info tb6612fng", errors.InvalidArgument, "did you mean tb6612 as"),
        ("board show L298N", errors.ConfigurationError, "did you mean l298n?"),
        ("params set mock wheel_radius 0,03", errors.ParameterOutOfRange, "did you mean 0.03?"),
        ("sim --set mass_kg=0,2", errors.InvalidArgument, "did you mean 0.2?"),
        ("info comma.yaml", errors.ConfigurationError, "decimal point"),
        ("info text.yaml", errors.ConfigurationError, "did you mean 0.03?"),
        ("info driver.yaml", errors.ConfigurationError, "did you mean l298n?"),
    ],
)
def test_a_nearly_right_answer_is_asked_back(
    words: str,
    kind: type[errors.WheelwireError],
    hint: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("comma.yaml").write_text("driver: serial\nparameters: {wheel_radius: 0,03}\n")
    Path("text.yaml").write_text("driver: serial\nparameters:\n  wheel_radius: 0,03\n")
    Path("driver.yaml").write_text("driver: L298N\n")
    assert hint in check_error(run(*words.split()), kind)


def test_options_and_drivers_are_asked_back() -> None:
    assert "did you mean 0.2?" in run("drive", "mock", "--linear", "0,2").stderr
    with pytest.raises(errors.DriverUnavailable, match="did you mean 'l298n'"):
        open_driver("L298N")
    with pytest.raises(errors.InvalidArgument, match=r"did you mean 0\.5\?"):
        open_driver("mock", realtime=False).advance("0,5")  # type: ignore[arg-type]


def test_a_tilde_is_the_home_folder_in_every_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    monkeypatch.chdir(folder)
    (tmp_path / "robot.yaml").write_text("driver: mock\nstore: ~/store\n")
    assert run("info", "~/robot.yaml").returncode == 0
    with connect("~/robot.yaml") as robot:
        robot.parameters.set("proportional_gain", 0.5)
        robot.parameters.save("proportional_gain")
    with open_driver("mock", record="~/day.mcap") as robot:
        robot.read()
    run_json("log", "record", "mock", "~/two.mcap", "--seconds", "0.2")
    assert run_json("log", "info", "~/day.mcap")["complete"]
    assert output("log", "plot", "~/day.mcap", "--output=~/day.svg")
    with open_driver("replay", file="~/day.mcap"):
        pass
    made = {one.name for one in tmp_path.iterdir()}
    assert {"store", "day.mcap", "two.mcap", "day.svg"} <= made
    assert not list(folder.iterdir())


def test_ports_says_that_no_usb_adapter_is_plugged_in(monkeypatch: pytest.MonkeyPatch) -> None:
    plug_in(monkeypatch)
    assert "no serial ports" in output("ports")
    plug_in(monkeypatch, "/dev/ttyUSB0")
    assert "No USB adapter" not in output("ports")
    soldered = SerialPort("/dev/ttyS0", None, "n/a", None, None, None, False, "", None)
    monkeypatch.setattr(local, "serial_ports", lambda: [soldered])
    assert "No USB adapter is plugged in" in output("ports")


@each("words", ["drive", "params set", "board", "log record"])
def test_help_of_a_command(words: str) -> None:
    assert output("help", *words.split()) == output(*words.split(), "--help")


def test_help_of_an_unknown_name_suggests_a_command() -> None:
    assert "did you mean drive?" in run("help", "dirve").stderr
    assert "did you mean params set?" in run("help", "params", "sett").stderr
    assert output("help", "doctor").startswith("# ")  # a page comes first
