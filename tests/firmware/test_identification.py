"""Motors identified, gains computed and proved: on the simulated plants, in virtual time.

`bench/commissioning.py` does the same for all of them, raised and on the floor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median

import pytest

from support.commissioning import (
    BATTERIES_V,
    NOMINAL_V,
    PLANTS,
    Outcome,
    commission,
    plant_line,
    plant_robot,
    true_breakaway,
    true_time_constant_s,
)
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import CommissioningFailed
from wheelwire.samples import WheelSample
from wheelwire.tools.setup.driving import TTL_S
from wheelwire.tools.setup.gains import FLOOR_INERTIA, tuned
from wheelwire.tools.setup.identification import Identification, WheelIdentification, identify
from wheelwire.tools.tune.before_after import Proof, prove

ROBOTS = [
    (plant, battery_v, (number + step) % 2 == 0)
    for number, plant in enumerate(PLANTS)
    for step, battery_v in enumerate(BATTERIES_V)
]
"""Each plant at each battery, some of them raised and the others on the floor."""


def quiet(_: str) -> None:
    """No report."""


@pytest.mark.whole
@pytest.mark.timeout(1200)
def test_each_robot_is_identified_and_tracks_better(subtests: pytest.Subtests) -> None:
    outcomes: list[Outcome] = []
    for plant, battery_v, raised in ROBOTS:
        with subtests.test(f"{plant}, {battery_v} V, {raised=}"):
            found = commission(plant, battery_v, raised=raised)
            outcomes.append(found)
            # The feed-forward is the line of the true curve.
            assert abs(found.slope_error) < 0.01
            assert abs(found.offset_error) < 0.05
            assert found.found.problems == ()
            # As proved, and on the floor in truth.
            assert found.proof.better
            assert found.ratio < 1
            assert found.true_ratio < 1
    assert median(found.ratio for found in outcomes) < 0.5
    assert median(found.true_ratio for found in outcomes) < 0.5


def tried(robot: MockDriver, *, on_the_floor: bool) -> tuple[Identification, Proof]:
    found = identify(robot, quiet, on_the_floor=on_the_floor)
    values = tuned(found, robot)
    return found, prove(robot, {name: robot.parameters[name] for name in values}, values)


# --- apart from the line -------------------------------------------------------------------------


@pytest.mark.whole
@pytest.mark.parametrize("plant", PLANTS)
def test_breakaway_and_time_constant_are_the_true_ones(plant: str) -> None:
    with plant_robot(plant, raised=False) as robot:
        breakaway, time_constant_s = true_breakaway(robot), true_time_constant_s(robot)
        found = identify(robot, quiet, on_the_floor=True)
    for wheel in (found.left, found.right):
        assert wheel.breakaway == pytest.approx(breakaway, abs=0.012)
        assert wheel.breakaway > wheel.static_feedforward
    assert found.time_constant_s == pytest.approx(time_constant_s, rel=0.1)
    assert found.delay_s == pytest.approx(0.013, abs=0.003)  # that of the measured velocity


def test_a_curve_that_no_line_fits_is_reported_and_gets_no_gains() -> None:
    with plant_robot("tt-1-48", raised=True, settings={"bridge.chopped": 1}) as robot:
        found = identify(robot, quiet, on_the_floor=False)
        values = tuned(found, robot)
    assert "speed over duty is not a straight line" in found.left.nonlinearity
    assert "pwm_frequency_hz" in found.problems[0]
    assert "proportional_gain" not in values


def test_a_limit_that_the_supply_does_not_reach_is_reported() -> None:
    with plant_robot("tt-1-48", 4.5, raised=False) as robot:
        found = identify(robot, quiet, on_the_floor=True)
    assert found.problems[0].startswith("max_velocity_mps is 0.40, but at 0.90 of duty")


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"left.blocked": 1}, "the left wheel does not start to turn"),
        ({"right.encoder_dead": 1}, "the right wheel does not start to turn"),
        ({"right.encoder_reversed": 1}, "the right wheel counts backward"),
        ({"supply_ohm": 4, "brownout_v": 6}, "the board was reset"),
        ({"estop_open": 1}, "the e-stop is latched"),
    ],
)
def test_what_prevents_measuring_is_reported_and_the_wheels_stand(
    settings: dict[str, float], reason: str
) -> None:
    with plant_robot("tt-1-48", raised=True, settings=settings) as robot:
        robot.advance(0.1)
        with pytest.raises(CommissioningFailed, match=reason):
            identify(robot, quiet, on_the_floor=False)
        robot.advance(0.01)
        assert robot.simulator.get("drive_on") == 0


def busy(robot: MockDriver, monkeypatch: pytest.MonkeyPatch, name: str, every: int) -> None:
    """Each so many setpoints of a kind come half a second late: the computer was busy."""
    original = getattr(robot, name)
    sent = [0]

    def late(*arguments: float) -> None:
        sent[0] += 1
        if sent[0] % every == 0:
            robot.advance(0.5)
        original(*arguments)

    monkeypatch.setattr(robot, name, late)


@pytest.mark.whole
@pytest.mark.parametrize("raised", [True, False])
def test_what_was_measured_while_a_setpoint_ran_out_is_measured_again(
    monkeypatch: pytest.MonkeyPatch, raised: bool
) -> None:
    truth = plant_line("25ga-1440", NOMINAL_V)
    with plant_robot("25ga-1440", raised=raised) as robot:
        busy(robot, monkeypatch, "set_duty", 400)
        found = identify(robot, quiet, on_the_floor=not raised)
        busy(robot, monkeypatch, "set_wheel_velocity", 1600)  # a drive takes 1100
        values = tuned(found, robot)
        proof = prove(robot, {name: robot.parameters[name] for name in values}, values)
    assert found.velocity_feedforward == pytest.approx(truth.velocity_feedforward, rel=0.005)
    assert found.static_feedforward == pytest.approx(truth.static_feedforward, rel=0.02)
    _, rms_after_mps = proof.rms_mps(0, 1)
    assert rms_after_mps is not None
    assert rms_after_mps < 0.007


def test_an_always_busy_computer_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    with plant_robot("25ga-1440", raised=True) as robot:
        busy(robot, monkeypatch, "set_duty", 40)
        with pytest.raises(CommissioningFailed, match="setpoints keep reaching the robot too late"):
            identify(robot, quiet, on_the_floor=False)


# --- safety --------------------------------------------------------------------------------------


def interrupted(robot: MockDriver, after: int) -> Callable[[float], WheelSample]:
    """`read` that raises KeyboardInterrupt once, after so many samples."""
    read, left = robot.read, [after]

    def reading(timeout: float = 1.0) -> WheelSample:
        left[0] -= 1
        if left[0] == 0:
            raise KeyboardInterrupt
        return read(timeout)

    return reading


@pytest.mark.parametrize("after", [300, 1500, 3000])
def test_the_robot_is_stopped_when_it_is_interrupted(
    monkeypatch: pytest.MonkeyPatch, after: int
) -> None:
    with plant_robot("tt-1-48", raised=True) as robot:
        monkeypatch.setattr(robot, "read", interrupted(robot, after))
        with pytest.raises(KeyboardInterrupt):
            identify(robot, quiet, on_the_floor=False)
        robot.advance(0.01)
        assert robot.simulator.get("drive_on") == 0


@pytest.mark.parametrize("after", [200, 700, 1900])
def test_an_interrupted_proof_leaves_the_previous_parameters(
    monkeypatch: pytest.MonkeyPatch, after: int
) -> None:
    before = {"velocity_feedforward": 1.365, "integral_gain": 16.0}
    with plant_robot("tt-1-48", raised=True) as robot:
        monkeypatch.setattr(robot, "read", interrupted(robot, after))
        with pytest.raises(KeyboardInterrupt):
            prove(robot, before, {"velocity_feedforward": 1.2, "integral_gain": 10.0})
        robot.advance(0.01)
        assert robot.simulator.get("drive_on") == 0
        robot.parameters.refresh()
        assert {name: robot.parameters[name] for name in before} == before


def test_setpoints_are_short_and_the_floor_is_a_metre(monkeypatch: pytest.MonkeyPatch) -> None:
    lives: list[float] = []
    way: list[float] = []
    with plant_robot("jgb37-520", 9.0, raised=False) as robot:
        set_duty, set_wheel_velocity, read = robot.set_duty, robot.set_wheel_velocity, robot.read

        def duty(left: float, right: float, ttl: float = math.inf) -> None:
            lives.append(ttl)
            set_duty(left, right, ttl)

        def velocity(left: float, right: float, ttl: float = math.inf) -> None:
            lives.append(ttl)
            set_wheel_velocity(left, right, ttl)

        def reading(timeout: float = 1.0) -> WheelSample:
            way.append(robot.simulator.get("true.x_m"))
            return read(timeout)

        monkeypatch.setattr(robot, "set_duty", duty)
        monkeypatch.setattr(robot, "set_wheel_velocity", velocity)
        monkeypatch.setattr(robot, "read", reading)
        tried(robot, on_the_floor=True)
    assert max(lives) <= TTL_S
    assert max(way) - min(way) < 1
    assert abs(way[-1]) < 0.2


# --- gains ---------------------------------------------------------------------------------------


def found_with(**differences: object) -> Identification:
    wheel = WheelIdentification(0.1, 1.25, 0.15, ((0.2, 0.08),), "", 0.02, 0.1)
    robot = Identification(wheel, wheel, on_the_floor=True, supply_v=7.4, problems=())
    of_wheel = {name: value for name, value in differences.items() if hasattr(wheel, name)}
    of_robot = {name: value for name, value in differences.items() if name not in of_wheel}
    wheel = replace(wheel, **of_wheel)  # type: ignore[arg-type]
    return replace(robot, left=wheel, right=wheel, **of_robot)  # type: ignore[arg-type]


def test_the_gains_are_those_of_the_rule() -> None:
    with plant_robot("tt-1-48", raised=True) as robot:
        values = tuned(found_with(), robot)
        raised = tuned(found_with(on_the_floor=False), robot)
    # A closed loop of 0.04 s: 0.1 / (0.8 * 0.06); an integral time of 0.1 s, less path_gain's 2/s.
    gain = 0.1 / (0.8 * 0.06)
    assert values == {
        "velocity_feedforward": 1.25,
        "static_feedforward": 0.1,
        "nominal_supply_v": 7.4,
        "acceleration_feedforward": 0.125,
        "proportional_gain": pytest.approx(gain, rel=1e-3),
        "integral_gain": pytest.approx(gain * (10 - 2), rel=1e-3),
    }
    assert raised["acceleration_feedforward"] == pytest.approx(FLOOR_INERTIA * 0.125)


# --- proof ---------------------------------------------------------------------------------------


def test_the_better_parameters_are_better_in_one_order_only(tmp_path: Path) -> None:
    good = {"velocity_feedforward": 1.30, "static_feedforward": 0.124}
    bad = {"velocity_feedforward": 0.8, "static_feedforward": 0.0}
    with plant_robot("tt-1-48", raised=True) as robot:
        proof, reverse = prove(robot, bad, good), prove(robot, good, bad)
    assert proof.better
    assert not reverse.better
    assert None not in proof.overshoot(0)
    lines = proof.table().splitlines()
    assert [line.split()[0] for line in lines[1:]] == ["left", "right", "both"]
    proof.plot(tmp_path / "proof.png")
    assert (tmp_path / "proof.png").read_bytes().startswith(b"\x89PNG")


def test_a_drive_that_a_fault_ends_is_worse_than_any(tmp_path: Path) -> None:
    # Half of the duty that the wheels need is implausible to the firmware.
    none = {"velocity_feedforward": 0.0, "static_feedforward": 0.0, "plausibility_margin": 0.05}
    good = {"velocity_feedforward": 1.30, "static_feedforward": 0.124, "plausibility_margin": 0.38}
    with plant_robot("tt-1-48", raised=True) as robot:
        proof, reverse = prove(robot, none, good), prove(robot, good, none)
        assert robot.read().faults == 0
    assert proof.better
    assert proof.rms_mps(0, 1)[0] is None
    assert "fault" in proof.table()
    assert not reverse.better
    reverse.plot(tmp_path / "proof.png")
