"""`connect`: one address, for both APIs."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import wheelwire
from support.cases import each
from wheelwire import aio
from wheelwire.connect import driver_at
from wheelwire.errors import (
    ConfigurationError,
    InvalidArgument,
    PortUnavailable,
    RobotNotNamed,
    WheelwireError,
)
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.files import robot as robot_file

opening = import_module("wheelwire.connect")
"""The module, beside the function that `wheelwire` has of that name."""

NO_PORT = "/dev/no-such-port"


def use_with(robot: Any) -> str:
    """Open a robot by `with`, and say what it is."""
    with wheelwire.connect(robot) as driver:
        driver.set_velocity(0.0, 0.0)
        driver.stop()
        return repr(driver)


def use_async_with(robot: Any) -> str:
    async def run() -> str:
        async with aio.connect(robot) as driver:
            driver.set_velocity(0.0, 0.0)
            await driver.stop()
            return repr(driver)

    return asyncio.run(run())


@pytest.mark.parametrize("use", [use_with, use_async_with])
def test_mock_and_a_port_are_addresses(simulator: Simulator, use: Callable[[Any], str]) -> None:
    assert use("mock") == "<MockDriver mock: open>"
    assert ": open>" in use(simulator.port)
    assert ": open>" in use(Path(simulator.port))


def test_a_file_is_an_address(tmp_path: Path) -> None:
    with Simulator() as simulator:
        file = tmp_path / "my robot.yml"
        file.write_text(
            f"driver: serial\nserial:\n  port: {simulator.port}\n  stream_rate_hz: 50\n"
            "  connect_timeout: 3\n  any_board: true\n"
        )
        assert ": open>" in use_with(file)
        assert ": open>" in use_async_with(str(file))


def test_a_boards_id_is_an_address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "BOARD_PORTS", f"{tmp_path}/tty*,{tmp_path}/none*")
    with Simulator() as simulator, Simulator():
        (tmp_path / "ttyUSB0").symlink_to(simulator.port)
        with wheelwire.connect(simulator.port) as robot:
            assert isinstance(robot, wheelwire.SerialDriver)
            board_id = robot.info.device.board_id
        assert "ttyUSB0: open>" in use_with(board_id)
        assert "ttyUSB0: open>" in use_async_with(board_id.upper())
        with pytest.raises(PortUnavailable, match=f"board 0123456789ab was not found.*{board_id}"):
            use_with("0123456789ab")
        file = tmp_path / "robot.yaml"
        text = "driver: serial\nserial: {port: '%s/tty*', board_id: '%s'}\n"
        file.write_text(text % (tmp_path, board_id))
        assert ": open>" in use_async_with(file)


def test_sockets_and_any_other_url_are_ports() -> None:
    for port in ("socket://robot:5000", "unix:/run/wheelwire.sock", "rfc2217://robot:2217"):
        assert driver_at(port) == ("serial", {"port": port})
        assert driver_at(port, baud_rate=9600)[1] == {"port": port, "baud_rate": 9600}


@pytest.mark.parametrize("use", [use_with, use_async_with])
def test_the_environment_names_the_robot(
    use: Callable[[Any], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WHEELWIRE_ROBOT", "mock")
    assert use(None) == "<MockDriver mock: open>"
    monkeypatch.setenv("WHEELWIRE_ROBOT", "")
    with pytest.raises(RobotNotNamed, match="set WHEELWIRE_ROBOT"):
        use(None)
    monkeypatch.delenv("WHEELWIRE_ROBOT")
    with pytest.raises(RobotNotNamed, match=r"a recording \(.mcap\) or mock"):
        use(None)


@each(
    ("robot", "error", "said"),
    [
        ("", InvalidArgument, "ROBOT is empty"),
        (3, InvalidArgument, "ROBOT = 3"),
        (NO_PORT, PortUnavailable, "there is no such port"),
        ("null", PortUnavailable, r"did you mean /dev/null\?"),
        ("COM3", PortUnavailable, "Windows"),
        ("L298N", InvalidArgument, "name the port of the ESP32.*did you mean l298n as"),
        ("esp32", InvalidArgument, "name the port of the ESP32"),
        ("/dev/null/x.yaml", ConfigurationError, "/dev/null/x.yaml"),
        ("unix:/tmp/no-such-socket", PortUnavailable, "no such port"),
        ("/", InvalidArgument, "neither a port nor a robot's file"),
        (__file__, InvalidArgument, "neither a port nor a robot's file"),
    ],
)
def test_an_address_that_is_no_robot_is_refused(
    robot: Any, error: type[WheelwireError], said: str
) -> None:
    for use in (use_with, use_async_with):
        with pytest.raises(error, match=said):
            use(robot)


@each(
    ("text", "error", "said"),
    [
        (f"driver: serial\nserial: {{port: {NO_PORT}}}", PortUnavailable, NO_PORT),
        ("chip: esp32\nstage: l298n", ConfigurationError, "robot.yaml: this is a board's file"),
        (
            "driver: serial\nserial:\n  board_id: '12'",
            ConfigurationError,
            "line 3: serial.board_id = '12': give its 12 hex digits",
        ),
        (
            "driver: serial\nserial: {stream_rate_hz: 0}",
            ConfigurationError,
            "line 2: serial.stream_rate_hz = 0: give a whole number from 1",
        ),
        ("driver: acme\nacme: {}", ConfigurationError, "line 1: driver = 'acme': no driver"),
        ("driver: acme\nacmee: {x: 1}", ConfigurationError, "did you mean acme"),
        ("driver: acme\nacme: 3", ConfigurationError, "acme = 3: it must be names with values"),
    ],
)
def test_an_error_names_what_is_wrong_with_a_file(
    text: str, error: type[WheelwireError], said: str, tmp_path: Path
) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(text)
    for use in (use_with, use_async_with):
        with pytest.raises(error, match=said):
            use(file)


def test_a_file_gives_the_serial_driver_all_its_options(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: dict[str, Any] = {}
    monkeypatch.setattr(opening, "driver_class", lambda _: lambda **given: made.update(given))
    file = tmp_path / "robot.yaml"
    file.write_text(
        "driver: serial\nboard: tb6612\nserial: {port: /dev/x, baud_rate: 9600, any_board: true,"
        " connect_timeout: 2, stream_rate_hz: 20, board_id: 0123456789ab}\n"
        "parameters: {max_duty: 0.5}\n"
    )
    wheelwire.connect(file)
    assert made == {
        "port": "/dev/x",
        "baud_rate": 9600,
        "connect_timeout": 2,
        "stream_rate_hz": 20,
        "board_id": "0123456789ab",
        "tap": True,
        "any_board": True,
        "board": "tb6612",
        "parameters": {"max_duty": 0.5},
    }


def test_a_plug_in_driver_takes_its_options_from_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opening, "_plug_ins", lambda: {"acme": "builtins:dict"})
    file = tmp_path / "robot.yaml"
    file.write_text("driver: acme\nacme:\n  host: bot\n  gears: [1, 2]\n")
    robot: Any = wheelwire.connect(file)
    assert robot == {"host": "bot", "gears": [1, 2]}
    file.write_text("driver: acme\nparameters: {max_duty: 0.5}\nstore: kept\nacme:\n")
    robot = wheelwire.connect(file)
    assert robot == {"parameters": {"max_duty": 0.5}, "store": Path("kept")}
    file.write_text("driver: acme\nboard: mine.yaml\n")
    robot = wheelwire.connect(file)
    assert robot["board"] == str(tmp_path / "mine.yaml")


def test_a_plug_in_driver_that_lacks_an_option_of_the_file_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opening, "_plug_ins", lambda: {"acme": "acme:robot"})
    monkeypatch.setattr(robot_file, "driver_class", lambda _: lambda *, host="": host)
    file = tmp_path / "robot.yaml"
    file.write_text("driver: acme\nacme: {hots: bot}\n")
    with pytest.raises(ConfigurationError, match=r"robot.yaml.*no option 'hots'.*mean 'host'"):
        wheelwire.connect(file)
