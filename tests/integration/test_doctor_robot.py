"""`wheelwire doctor ROBOT`: a simulated robot with each of the defects that its checks name."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from support.attached import wait_for_holder
from support.cases import each
from support.command import check_error, run, run_json
from support.own_board import OWN_BOARD
from support.simulator_on_line import GOOD, simulator_on
from wheelwire import errors
from wheelwire.board import BatteryLevels, DigitalInput, Pull
from wheelwire.cli.address import Address
from wheelwire.cli.doctor import _of_robot
from wheelwire.drivers.mock import MockDriver
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.impaired_simulator import ImpairedSimulator
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.doctor import Finding, examine_robot, robot
from wheelwire.tools.files.bad_line import load_profile
from wheelwire.tools.files.board import load_board
from wheelwire_protocol.codes import Fault, Group, PeripheralKind, Place, ResetReason
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import GROUP_HASHES

BUMPER = DigitalInput(PeripheralKind.BUMPER, Place.REAR, 39, pull=Pull.EXTERNAL)


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with simulator_on(GOOD) as simulator:
        yield simulator


@pytest.fixture
def mock(monkeypatch: pytest.MonkeyPatch) -> Iterator[MockDriver]:
    """In virtual time, in which the doctor watches the link, too."""
    with MockDriver(realtime=False) as mock:
        monkeypatch.setattr("wheelwire.tools.doctor.robot.time.sleep", mock.advance)
        yield mock


def examined(robot: Simulator | MockDriver) -> dict[str, Finding]:
    """By name; the robot's own alone, whatever this computer is like."""
    if isinstance(robot, MockDriver):
        return {found.name: found for found in examine_robot(robot, "ROBOT")}
    with SerialDriver(robot.port) as driver:
        return {found.name: found for found in examine_robot(driver, "ROBOT")}


def only(found: dict[str, Finding], name: str) -> Finding:
    assert list(found) == [name]
    return found[name]


@each(("library", "is_older"), [("99.0.0", True), ("0.0.1", False), ("unknown", False)])
def test_a_firmware_that_is_older_than_the_library(
    mock: MockDriver, monkeypatch: pytest.MonkeyPatch, library: str, *, is_older: bool
) -> None:
    assert examined(mock) == {}  # a sound robot
    with monkeypatch.context() as patch:
        patch.setattr(robot, "library_version", lambda: library)
        found = examined(mock)
    if not is_older:
        assert found == {}
        return
    finding = only(found, "firmware")
    assert "older than this library, 99.0.0" in finding.problem
    assert finding.cure == "wheelwire flash ROBOT with the image of release 99.0.0"


@pytest.mark.parametrize("fault", [Fault.STORE_UNREADABLE, Fault.STORE_OUTDATED])
def test_parameters_that_cannot_be_used(simulator: Simulator, fault: Fault) -> None:
    simulator.set("store_unreadable", fault)
    simulator.reset()
    finding = only(examined(simulator), "store")
    assert "Nothing drives." in finding.problem
    assert finding.cure == (
        "`wheelwire params import ROBOT FILE --save`, or `wheelwire params reset ROBOT` for the "
        "defaults, then `wheelwire clear ROBOT`"
    )
    (warning,) = run_json("info", simulator.port)["warnings"]
    reset = f"wheelwire params reset {simulator.port}"
    assert reset in warning
    line = check_error(
        run("drive", simulator.port, "--linear", "0.2", "--seconds", "0.5"), errors.DeviceRefused
    )
    assert reset in line
    for command in (reset, f"wheelwire clear {simulator.port}"):
        yes = ["--yes"] * ("reset" in command)
        result = run(*command.split()[1:], *yes)
        assert result.returncode == 0, result.stderr
    assert examined(simulator) == {}


def kept_by_a_robot(store: Path) -> None:
    """What a robot keeps that has saved its parameters and its board."""
    with MockDriver(realtime=False, store=store) as robot:
        robot.parameters.save()
        robot.board.take_up(load_board("drv8833"))


def damage(file: Path, *slots: int) -> None:
    content = bytearray(file.read_bytes())
    for slot in slots:
        content[4 + 1024 * slot + 10] ^= 1
    file.write_bytes(content)


def test_a_board_that_is_damaged(tmp_path: Path) -> None:
    store = tmp_path / "store"
    kept_by_a_robot(store)
    damage(tmp_path / "store.board", 0, 1)
    with Simulator(store=store) as simulator:
        finding = only(examined(simulator), "store")
        assert finding.cure == (
            "`wheelwire board write ROBOT FILE` with the file of its board, then "
            "`wheelwire clear ROBOT`"
        )
        info = run_json("info", simulator.port)
        assert info["link"]["board"]["state"] == "DAMAGED"
        write = f"wheelwire board write {simulator.port} FILE"
        assert any(write in warning for warning in info["warnings"])
        shown = run("info", simulator.port).stdout
        assert "DAMAGED: The stored configuration cannot be used" in shown
        written = run("board", "write", simulator.port, "drv8833")
        assert written.returncode == 0, written.stderr
        run("clear", simulator.port)
        simulator.reset()  # a power-on is not a stop
        assert examined(simulator) == {}


@pytest.mark.parametrize(
    ("name", "words"),
    [("store", "the saved parameters"), ("store.board", "stored copies of the configuration")],
)
def test_a_copy_that_is_lost(tmp_path: Path, name: str, words: str) -> None:
    kept_by_a_robot(tmp_path / "store")
    damage(tmp_path / name, 1)
    with Simulator(store=tmp_path / "store") as simulator:
        finding = only(examined(simulator), "store-copy")
        assert words in finding.problem
        assert "if it recurs" in finding.cure
        assert [finding.problem] == run_json("info", simulator.port)["warnings"]


def test_a_battery_that_is_low(mock: MockDriver) -> None:
    levels = BatteryLevels(warn_v=7.6, limit_v=6.8, stop_v=6.6)
    mock.board.take_up(replace(OWN_BOARD, peripherals=(levels,)))
    finding = examined(mock)["battery"]  # beside the restart with the new list
    assert "battery: low" in finding.problem
    assert "7.4" in finding.cure


def reset(mock: MockDriver, reason: ResetReason) -> None:
    mock.simulator.reset(reason)
    mock.advance(2.0)


def has(name: str, value: float = 1) -> Callable[[MockDriver], object]:
    """Something of the simulated robot is so."""
    return lambda mock: mock.simulator.set(name, value)


def has_no_contact(mock: MockDriver) -> None:
    mock.parameters.set("estop_input_enabled", 0)


def crashed_before(mock: MockDriver) -> None:
    mock.simulator.set("core_dump", 1)
    reset(mock, ResetReason.EXTERNAL)


@pytest.mark.parametrize(
    ("play", "name", "problem", "cure"),
    [
        (has("imu.absent"), "sensor", "imu cannot be used: STALE, ABSENT", "ABSENT"),
        (has("imu.freeze"), "sensor", "imu cannot be used: STALE, FROZEN", "FROZEN"),
        (has("battery_v", 0), "sensor", "battery cannot be used: STALE, ZERO", "ZERO"),
        (has("bumper.front_left"), "triggered", "bumper.front_left has triggered", "wire"),
        (crashed_before, "core-dump", "core dump is in flash", ""),
        (has_no_contact, "estop-input", "pressing it does nothing", "_enabled 1 --save"),
    ],
)
def test_what_is_wrong_is_named_with_its_cure(
    mock: MockDriver, play: Callable[[MockDriver], object], name: str, problem: str, cure: str
) -> None:
    play(mock)
    finding = only(examined(mock), name)
    assert problem in finding.problem
    assert cure in finding.cure


def test_groups_that_are_off(mock: MockDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    mock.parameters.set("proportional_gain", 0.8)
    monkeypatch.setitem(GROUP_HASHES, Group.STORE, 0x0BADBEEF)
    assert examined(mock) == {}  # firmware that cannot tell what it has saved
    monkeypatch.setitem(GROUP_HASHES, Group.CONFIGURATION, 0x0BADBEEF)
    finding = only(examined(mock), "groups")
    assert "configuration messages do not work" in finding.problem
    assert "wheelwire flash ROBOT" in finding.cure


def on_a_line(folder: Path, profile: str) -> dict[str, Finding]:
    file = folder / "line.yaml"
    file.write_text(profile)
    with ImpairedSimulator(load_profile(str(file))) as simulator:
        return examined(simulator)


def test_a_line_that_loses_frames_or_is_late(tmp_path: Path) -> None:
    found = on_a_line(tmp_path, "{seed: 1, to_host: {loss: 0.1}}")["loss"]
    assert "of the robot's frames were lost in the last second" in found.problem
    assert "shorter cable" in found.cure
    late = "{seed: 1, to_host: {delay_us: 30000}, to_device: {delay_us: 30000}}"
    found = only(on_a_line(tmp_path, late), "clock-error")
    assert "another USB socket" in found.cure


def test_parameters_that_contradict_each_other() -> None:
    presets = {"control_rate_hz": 100, "stream_rate_hz": 200}  # another firmware's defaults
    arguments = [
        f"--preset={PARAMETER_BY_NAME[name].id}={value}" for name, value in presets.items()
    ]
    with simulator_on(GOOD, arguments=arguments) as simulator:
        finding = only(examined(simulator), "contradiction")
    assert "stream_rate_hz" in finding.problem
    assert finding.problem.endswith(": nothing drives.")
    assert finding.cure


def test_parameters_that_were_not_saved(simulator: Simulator, tmp_path: Path) -> None:
    with SerialDriver(simulator.port) as driver:
        driver.parameters.set("proportional_gain", 0.8)
        driver.parameters.set("ttl_max_s", 0.5)
    finding = only(examined(simulator), "unsaved")
    assert "the next reset changes proportional_gain, ttl_max_s" in finding.problem
    # A robot file that names them sets them in each session.
    file = tmp_path / "robot.yaml"
    file.write_text(
        f"driver: serial\nserial: {{port: {simulator.port}}}\nparameters: {{ttl_max_s: 0.5}}\n"
    )
    found = {item.name: item for item in _of_robot(Address(str(file)))}
    assert "the next reset changes proportional_gain:" in only(found, "unsaved").problem
    # Its cure is a command that cures it.
    cure = finding.cure.replace("ROBOT", simulator.port).split()
    assert run(*cure[1:]).returncode == 0
    assert examined(simulator) == {}
    simulator.reset()
    assert examined(simulator) == {}


def test_a_robot_that_drives_is_not_asked_what_it_has_saved(mock: MockDriver) -> None:
    mock.parameters.set("proportional_gain", 0.8)
    mock.set_velocity(0.1, 0.0, 1.0)
    mock.advance(0.1)
    assert [*robot._unsaved(mock, "ROBOT", ())] == []
    mock.stop()
    assert [found.name for found in robot._unsaved(mock, "ROBOT", ())] == ["unsaved"]


def test_what_holds_the_robot(mock: MockDriver) -> None:
    mock.estop()
    finding = only(examined(mock), "stopped")
    assert "wheelwire why ROBOT" in finding.cure
    mock.clear_estop()
    assert examined(mock) == {}
    reset(mock, ResetReason.BROWNOUT)
    found = examined(mock)
    assert set(found) == {"stopped", "ledger"}
    assert "supply" in found["stopped"].problem
    assert "BROWNOUT 1" in found["ledger"].problem


def test_beside_a_program_that_holds_the_robot(simulator: Simulator) -> None:
    """Attached, it finds the same, and leaves the program alone."""
    with SerialDriver(simulator.port) as holder:
        wait_for_holder(simulator.port)
        holder.parameters.set("estop_input_enabled", 0)
        holder.estop()
        result = run("doctor", simulator.port, "--json")
        names = {finding["name"] for finding in json.loads(result.stdout)}
        assert {"estop-input", "stopped"} <= names
        assert holder.sessions == 1
        assert result.returncode == 30


def test_a_robot_that_goes_away_half_way_is_a_finding(
    simulator: Simulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    with SerialDriver(simulator.port) as driver:
        driver.estop()
    monkeypatch.setattr("wheelwire.tools.doctor.robot.time.sleep", lambda _: simulator.close())
    monkeypatch.setattr(robot, "_link", lambda driver: driver.device_counters())
    found = _of_robot(Address(simulator.port))
    assert [finding.name for finding in found] == ["stopped", "no-answer"]
