"""`wheelwire board write` and `read` on a simulated device behind a pseudo-terminal."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from support.command import check_error, run, run_json
from support.own_board import OWN_BOARD
from support.typing_terminal import TypingTerminal
from support.waiting import keep_driving, wait_until
from wheelwire import aio, errors, open_driver
from wheelwire.board import DigitalInput, Pull
from wheelwire.drivers.mock import MockDriver
from wheelwire.drivers.serial import SerialDriver
from wheelwire.robot import calls as requests
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.files.board import board_mapping, load_board, parse_board, shipped_boards
from wheelwire.tools.setup.questions import KEEP, Question
from wheelwire.tools.setup.setup import choose_board
from wheelwire_protocol.codes import (
    Chip,
    ConfigurationState,
    Fault,
    Group,
    PeripheralKind,
    Place,
)
from wheelwire_protocol.types import GROUP_HASHES, GroupGet

WITH_BUMPERS = replace(
    OWN_BOARD,
    peripherals=tuple(
        DigitalInput(PeripheralKind.BUMPER, place, pin, pull=Pull.EXTERNAL)
        for place, pin in ((Place.FRONT_LEFT, 36), (Place.REAR, 39))
    ),
)
OF_ESP32 = [name for name in shipped_boards() if load_board(name).chip is Chip.ESP32]


@pytest.fixture
def simulator(tmp_path: Path) -> Iterator[Simulator]:
    with Simulator(store=tmp_path / "store") as simulator:
        yield simulator


def fresh_chip() -> Simulator:
    """A chip with an unconfirmed board; a new one also after a stalled test."""
    return Simulator(settings={"board_unwritten": 1})


def test_a_fresh_chip_drives_once_its_board_is_confirmed() -> None:
    with fresh_chip() as fresh:
        refused = run("drive", fresh.port, "--linear", "0.2", "--seconds", "0.5")
        assert refused.returncode == errors.DeviceRefused.exit_code
        assert "wheelwire board confirm" in refused.stderr
        info = run_json("info", fresh.port)
        assert any("wheelwire board confirm" in warning for warning in info["warnings"])
        assert fresh.get("true.distance_m") == 0.0

        unasked = run("board", "confirm", fresh.port)
        assert unasked.returncode == errors.InvalidArgument.exit_code
        assert "--yes" in unasked.stderr
        assert run_json("board", "read", fresh.port)["state"] == "BUILT_IN"

        for was_confirmed in (False, True):
            assert run_json("board", "confirm", fresh.port, "--yes") == {
                "board": "L298N, ESP32-DevKitC",
                "confirmed": True,
                "was_confirmed": was_confirmed,
            }
        drive = run("drive", fresh.port, "--linear", "0.2", "--seconds", "0.5")
        assert drive.returncode == 0, drive.stderr
        fresh.reset()
        assert run_json("board", "read", fresh.port)["state"] == "STORED"
        assert run_json("info", fresh.port)["warnings"] == []


def test_a_robot_on_another_board_than_the_named_one_is_not_driven(
    simulator: Simulator, tmp_path: Path
) -> None:
    with pytest.raises(errors.BoardMismatch, match=f"is {OWN_BOARD.name}, not TB6612FNG"):
        open_driver("serial", port=simulator.port, board="tb6612")
    inputs = {"bumper_front": {"pin": 36, "pull": "external"}}
    board = parse_board({**board_mapping(OWN_BOARD), "inputs": inputs})
    with pytest.raises(errors.BoardMismatch, match="with other pins or sensors"):
        open_driver("serial", port=simulator.port, board=board)
    # A robot with sensors is not refused because a file names none.
    open_driver("serial", port=simulator.port, board=OWN_BOARD).close()
    config = tmp_path / "robot.yaml"
    config.write_text(f"driver: serial\nboard: tb6612\nserial:\n  port: {simulator.port}\n")
    refused = run("drive", str(config), "--linear", "0.2", "--seconds", "0.5")
    assert refused.returncode == errors.BoardMismatch.exit_code
    assert simulator.get("true.distance_m") == 0.0
    assert run("board", "write", str(config), "tb6612").returncode == 0
    assert run("drive", str(config), "--linear", "0.2", "--seconds", "0.5").returncode == 0
    with open_driver("serial", port=simulator.port, board="tb6612") as robot:
        keep_driving(robot)


def test_what_a_simulated_robot_has_is_a_file_for_it(simulator: Simulator, tmp_path: Path) -> None:
    file = tmp_path / "read.yaml"
    file.write_text(run("board", "read", simulator.port).stdout)
    own = load_board(file)
    assert replace(own, peripherals=()) == OWN_BOARD
    assert len(own.peripherals) == 4
    assert run("board", "check", str(file)).returncode == 0
    result = run("board", "write", simulator.port, str(file))
    assert result.stdout == f"{own.name}: written, tried and confirmed\n", result.stderr
    read = run_json("board", "read", simulator.port)
    assert read == {"state": "STORED", "board": board_mapping(own)}
    for _ in range(2):
        with SerialDriver(simulator.port) as robot:
            assert robot.board.read() == (ConfigurationState.STORED, own)
            assert robot.imu.read(timeout=5.0).acceleration[2] == pytest.approx(9.81, abs=0.5)
            assert robot.power.read(timeout=5.0).voltage_v == pytest.approx(7.4, abs=0.05)
            simulator.set("bumper.front_left", 1)
            wait_until(lambda: robot.inputs.read().triggered == ("bumper.front_left",))
            simulator.set("bumper.front_left", 0)
            # A drive that begins before the robot knows is refused, and must begin again.
            wait_until(lambda: robot.inputs.read().triggered == ())
            keep_driving(robot)
        simulator.reset()


def test_a_wrong_board_is_refused_before_anything_is_written(
    simulator: Simulator, tmp_path: Path
) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text(json.dumps(board_mapping(load_board("l298n")) | {"led": 36}))
    result = run("board", "write", simulator.port, str(file))
    assert result.returncode == errors.ConfigurationError.exit_code
    assert "led = 36: GPIO 36 of the ESP32 is an input only" in result.stderr
    line = check_error(run("board", "write", simulator.port, "esp32s3"), errors.DeviceRefused)
    assert "L298N, ESP32-S3-DevKitC is for the ESP32S3, not for this chip" in line
    assert run_json("board", "read", simulator.port)["board"]["name"] == OWN_BOARD.name


def test_a_reset_that_erases_the_board_too_is_asked_for(simulator: Simulator) -> None:
    simulator.set("board_unwritten", 1)  # as a chip: with an empty flash it is on the image's board
    simulator.set("flash_unreadable", Fault.STORE_UNREADABLE)
    simulator.reset()
    run("clear", simulator.port)  # nor can it be read whether an e-stop was latched
    wide = {"COLUMNS": "500"}
    with TypingTerminal("params", "reset", simulator.port, environment=wide) as person:
        person.wait_for("nothing drives until `wheelwire board write`")
        person.press(b"n\n")
        assert person.wait() == errors.InvalidArgument.exit_code
    assert run_json("info", simulator.port)["faults"] == ["STORE_UNREADABLE", "NO_BOARD"]
    assert run_json("params", "reset", simulator.port, "--yes")["reset"] is True
    run("clear", simulator.port)
    simulator.reset()
    refused = run("drive", simulator.port, "--linear", "0.2", "--seconds", "0.5")
    assert refused.returncode == errors.DeviceRefused.exit_code
    assert run("board", "write", simulator.port, "l298n").returncode == 0
    # Where the flash can be opened the board stays.
    assert run_json("params", "reset", simulator.port, "--yes")["reset"] is True
    drive = run("drive", simulator.port, "--linear", "0.2", "--seconds", "0.5")
    assert drive.returncode == 0, drive.stderr


@pytest.mark.parametrize("device_has", ["others", "none"])
def test_a_device_with_other_messages_about_boards_drives_all_the_same(
    simulator: Simulator, monkeypatch: pytest.MonkeyPatch, device_has: str
) -> None:
    group = Group.CONFIGURATION if device_has == "others" else 77
    monkeypatch.setitem(GROUP_HASHES, Group.CONFIGURATION, 0x0BADBEEF)
    monkeypatch.setattr(
        requests,
        "GroupGet",
        lambda s, r, asked: GroupGet(s, r, group if asked is Group.CONFIGURATION else asked),
    )
    with open_driver("serial", port=simulator.port) as robot:
        assert robot.has_device
        keep_driving(robot)
        assert robot.read().left_mps > 0.05
        robot.stop()
        words = "the device has none" if device_has == "none" else "the device's have 0x"
        with pytest.raises(errors.GroupUnavailable, match=f"0x0badbeef, {words}"):
            robot.board.read()
        keep_driving(robot)


class Chooser:
    """Answers with one board."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.asked: list[Question] = []

    def answer(self, question: Question) -> str:
        self.asked.append(question)
        return question.parse(self.name)


def offer(simulator: Simulator, person: Chooser) -> list[str]:
    """What a set-up says of the board."""
    said: list[str] = []
    with open_driver("serial", port=simulator.port) as robot:
        choose_board(robot, person, said.append)
    return said


def test_a_set_up_offers_the_built_in_boards_until_one_is_chosen() -> None:
    with fresh_chip() as fresh:
        person = Chooser("tb6612")
        assert offer(fresh, person) == ["TB6612FNG: written, tried and confirmed"]
        (question,) = person.asked
        assert set(question.choices) == {*OF_ESP32, KEEP}
        # By its picture: keeping it confirms it.
        assert "keep: it is L298N, ESP32-DevKitC, docs/boards/l298n.svg" in question.text
        assert run_json("board", "read", fresh.port)["state"] == "STORED"
        assert offer(fresh, person) == ["board: TB6612FNG"]
        assert len(person.asked) == 1


def test_peripherals_are_taken_up_in_virtual_time(tmp_path: Path) -> None:
    store = tmp_path / "store"
    with MockDriver(realtime=False, store=store) as robot:
        assert robot.board.read()[1] != WITH_BUMPERS
        began_s = robot.simulator.get("t_us") / 1e6
        robot.board.take_up(WITH_BUMPERS)
        assert robot.board.read() == (ConfigurationState.STORED, WITH_BUMPERS)
        assert robot.simulator.get("t_us") / 1e6 - began_s < 2.0
        robot.simulator.set("bumper.rear", 1)
        assert robot.inputs.read().triggered == ("bumper.rear",)
        # A number that is rounded does not make another board.
        measured = replace(load_board("tb6612"), battery=34, battery_divider=5.70049)
        robot.board.take_up(replace(measured, peripherals=WITH_BUMPERS.peripherals))
    with MockDriver(realtime=False, store=store) as again:
        state, found = again.board.read()
        assert found is not None
        assert state is ConfigurationState.STORED
        assert (found.name, len(found.peripherals)) == ("TB6612FNG", 2)
        # A chip that does not come back is not waited for in real time.
        again.simulator.set("boot_time_us", 60e6)
        with pytest.raises(errors.LinkLost, match="did not come back within 8 s"):
            again.board.restart()


def test_a_board_that_a_saved_parameter_contradicts_is_not_kept(simulator: Simulator) -> None:
    assert run("board", "write", simulator.port, "tb6612").returncode == 0
    set_30 = ("params", "set", simulator.port, "pwm_frequency_hz", "30000", "--save")
    assert run(*set_30).returncode == 0
    line = check_error(run("board", "write", simulator.port, "mdd10a"), errors.BoardNotKept)
    assert "pwm_frequency_hz is 30000" in line
    assert "pwm_dir, takes 20000 at most" in line
    cure = f"wheelwire params set {simulator.port} pwm_frequency_hz 20000 --save"
    assert f"`{cure}`" in line
    assert run_json("board", "read", simulator.port) == {
        "state": "STORED",
        "board": board_mapping(load_board("tb6612")),
    }
    assert run(*cure.split()[1:]).returncode == 0
    assert run("board", "write", simulator.port, "mdd10a").returncode == 0
    drive = run("drive", simulator.port, "--linear", "0.2", "--seconds", "0.5")
    assert drive.returncode == 0, drive.stderr


async def test_the_same_on_asyncio(simulator: Simulator) -> None:
    async with aio.open_driver("serial", port=simulator.port) as robot:
        # As when its trial ended while somebody compared it with the picture.
        with pytest.raises(errors.BoardNotKept, match=f"the device is now on {OWN_BOARD.name}"):
            await robot.board.accept(load_board("tb6612"))
        await robot.board.take_up(load_board("tb6612"))
        state, board = await robot.board.read()
        assert (state, board) == (ConfigurationState.STORED, load_board("tb6612"))
        await robot.board.write(load_board("drv8833"))
        await robot.board.restart()
        assert (await robot.board.read())[0] is ConfigurationState.TRIAL
        await robot.board.confirm(load_board("drv8833"))
        assert (await robot.board.read())[0] is ConfigurationState.STORED
