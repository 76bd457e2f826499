"""`wheelwire doctor ROBOT`: a simulated robot with each of the defects that its checks name."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from support.attached import wait_for_holder
from support.command import run
from support.own_board import OWN_BOARD
from support.simulator_on_line import GOOD, simulator_on
from wheelwire.cli.address import Address
from wheelwire.cli.doctor import _of_robot
from wheelwire.doctor import Finding, examine_robot, robot
from wheelwire.drivers.serial import SerialDriver
from wheelwire.files.bad_line import load_profile
from wheelwire.files.board import load_board
from wheelwire.peripherals import BatteryLevels, DigitalInput, Pull
from wheelwire.simulation.impaired_simulator import ImpairedSimulator
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.codec import BY_TYPE
from wheelwire_protocol.codes import Group, ResetReason
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.sensors import PeripheralKind, Place
from wheelwire_protocol.types import GROUP_HASHES, BoardWrite

BUMPER = DigitalInput(PeripheralKind.BUMPER, Place.REAR, 39, pull=Pull.EXTERNAL)


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with simulator_on(GOOD) as simulator:
        yield simulator


def examined(simulator: Simulator) -> dict[str, Finding]:
    """By name; the robot's own alone, whatever this computer is like."""
    with SerialDriver(simulator.port) as driver:
        return {found.name: found for found in examine_robot(driver, "ROBOT")}


def only(found: dict[str, Finding], name: str) -> Finding:
    assert list(found) == [name]
    return found[name]


def test_a_sound_robot_has_nothing(simulator: Simulator) -> None:
    assert examined(simulator) == {}


@pytest.mark.parametrize(
    ("library", "is_older"), [("99.0.0", True), ("0.0.1", False), ("unknown", False)]
)
def test_a_firmware_that_is_older_than_the_library(
    simulator: Simulator, monkeypatch: pytest.MonkeyPatch, library: str, *, is_older: bool
) -> None:
    monkeypatch.setattr(robot, "library_version", lambda: library)
    found = examined(simulator)
    if not is_older:
        assert found == {}
        return
    finding = only(found, "firmware")
    assert "older than this library, 99.0.0" in finding.problem
    assert finding.cure == "wheelwire flash ROBOT with the image of release 99.0.0"


def test_groups_that_are_off(simulator: Simulator, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(GROUP_HASHES, Group.BOARD, 0x0BADBEEF)
    finding = only(examined(simulator), "groups")
    assert "board messages do not work" in finding.problem
    assert "wheelwire flash ROBOT" in finding.cure


def test_a_list_of_sensors_of_another_board(simulator: Simulator) -> None:
    with SerialDriver(simulator.port) as driver:
        driver.board.take_up(replace(OWN_BOARD, peripherals=(BUMPER,)))
        # As a program of a release without sensors does it.
        other = load_board("tb6612")
        fields = BY_TYPE[BoardWrite].unpack(bytes(9) + other.packed() + bytes(4))
        driver._link.request(BoardWrite(0, 0, *fields[2:]))
        driver.board.restart()
        driver.board.confirm(other)
    found = examined(simulator)["peripherals"]
    assert "not for TB6612FNG: nothing drives" in found.problem
    assert found.cure.startswith("wheelwire board write ROBOT ")
    assert run("board", "write", simulator.port, "tb6612").returncode == 0
    assert "peripherals" not in examined(simulator)


@pytest.mark.parametrize(
    ("variable", "value", "words"),
    [
        ("imu.absent", 1, "imu cannot be used: STALE, ABSENT"),
        ("imu.freeze", 1, "imu cannot be used: STALE, FROZEN"),
        ("battery_v", 0, "battery cannot be used: STALE, ZERO"),
    ],
)
def test_a_sensor_that_cannot_be_used(
    simulator: Simulator, variable: str, value: float, words: str
) -> None:
    simulator.set(variable, value)
    finding = only(examined(simulator), "sensor")
    assert finding.problem.startswith(words)
    assert words.split()[-1] in finding.cure


def test_a_bumper_that_is_pressed(simulator: Simulator) -> None:
    simulator.set("bumper.front_left", 1)
    finding = only(examined(simulator), "triggered")
    assert "bumper.front_left has triggered" in finding.problem
    assert "wire" in finding.cure


def test_a_battery_that_is_low(simulator: Simulator) -> None:
    levels = BatteryLevels(warn_v=7.6, limit_v=6.8, stop_v=6.6)
    with SerialDriver(simulator.port) as driver:
        driver.board.take_up(replace(OWN_BOARD, peripherals=(levels,)))
    finding = examined(simulator)["battery"]  # beside the restart with the new list
    assert "battery: low" in finding.problem
    assert "7.4" in finding.cure


def test_beside_a_program_sensors_are_those_that_it_asked_for(simulator: Simulator) -> None:
    simulator.set("imu.absent", 1)
    with SerialDriver(simulator.port) as holder:
        wait_for_holder(simulator.port)
        assert '"sensor"' not in run("doctor", simulator.port, "--json").stdout
        holder.sensors.start(50)
        assert "ABSENT" in run("doctor", simulator.port, "--json").stdout


def test_a_core_dump(simulator: Simulator) -> None:
    simulator.set("core_dump", 1)
    simulator.reset(ResetReason.EXTERNAL)
    finding = only(examined(simulator), "core-dump")
    assert "core dump is in flash" in finding.problem
    simulator.set("core_dump", 0)
    simulator.reset()
    assert examined(simulator) == {}


def preset(**values: float) -> Sequence[str]:
    """Another firmware's defaults."""
    return [f"--preset={PARAMETER_BY_NAME[name].id}={value}" for name, value in values.items()]


def test_parameters_that_contradict_each_other() -> None:
    arguments = preset(control_rate_hz=100, stream_rate_hz=200)
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
    found = {item.name: item for item in _of_robot(Address(str(file)), None, as_json=True)}
    assert "the next reset changes proportional_gain:" in only(found, "unsaved").problem
    # Its cure is a command that cures it.
    cure = finding.cure.replace("ROBOT", simulator.port).split()
    assert run(*cure[1:]).returncode == 0
    assert examined(simulator) == {}
    simulator.reset()
    assert examined(simulator) == {}


def test_a_robot_that_drives_is_not_asked_what_it_has_saved(simulator: Simulator) -> None:
    with SerialDriver(simulator.port) as driver:
        driver.parameters.set("proportional_gain", 0.8)
        driver.set_velocity(0.1, 0.0, 1.0)
        assert "unsaved" not in {found.name for found in robot._unsaved(driver, "ROBOT", ())}
        driver.stop()
        assert [found.name for found in robot._unsaved(driver, "ROBOT", ())] == ["unsaved"]


def test_firmware_that_cannot_tell_what_it_has_saved(
    simulator: Simulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    with SerialDriver(simulator.port) as driver:
        driver.parameters.set("proportional_gain", 0.8)
    monkeypatch.setitem(GROUP_HASHES, Group.STORE, 0x0BADBEEF)
    assert examined(simulator) == {}


def test_a_contact_that_does_nothing(simulator: Simulator) -> None:
    with SerialDriver(simulator.port) as driver:
        driver.parameters.set("estop_input_enabled", 0)
    finding = only(examined(simulator), "estop-input")
    assert "estop_input_enabled is 0: pressing it does nothing" in finding.problem
    # Its cure is a command that cures it.
    cure = finding.cure.replace("ROBOT", simulator.port).split()
    assert run(*cure[1:]).returncode == 0
    assert examined(simulator) == {}


def test_what_holds_the_robot(simulator: Simulator) -> None:
    with SerialDriver(simulator.port) as driver:
        driver.estop()
    finding = only(examined(simulator), "stopped")
    assert "wheelwire why ROBOT" in finding.cure
    run("clear", simulator.port)
    assert examined(simulator) == {}
    simulator.reset(ResetReason.BROWNOUT)
    found = examined(simulator)
    assert set(found) == {"stopped", "ledger"}
    assert "supply" in found["stopped"].problem
    assert "BROWNOUT 1" in found["ledger"].problem


def on_a_line(folder: Path, profile: str) -> dict[str, Finding]:
    file = folder / "line.yaml"
    file.write_text(profile)
    with ImpairedSimulator(load_profile(str(file))) as simulator:
        return examined(simulator)


def test_a_line_that_loses_frames(tmp_path: Path) -> None:
    found = on_a_line(tmp_path, "{seed: 1, to_host: {loss: 0.1}}")
    assert "of the robot's frames were lost in the last second" in found["loss"].problem
    assert "shorter cable" in found["loss"].cure


def test_a_line_that_is_late(tmp_path: Path) -> None:
    profile = "{seed: 1, to_host: {delay_us: 30000}, to_device: {delay_us: 30000}}"
    found = only(on_a_line(tmp_path, profile), "clock-error")
    assert "is known to" in found.problem
    assert "another USB socket" in found.cure


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
    monkeypatch.setattr("wheelwire.doctor.robot.time.sleep", lambda _: simulator.close())
    monkeypatch.setattr(robot, "_link", lambda driver: driver.device_counters())
    found = _of_robot(Address(simulator.port), None, as_json=False)
    assert [finding.name for finding in found] == ["stopped", "no-answer"]
