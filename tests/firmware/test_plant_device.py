"""The simulated board: names, clock, resets, and the same run for the same seed."""

from __future__ import annotations

import math

import pytest

from support.virtual import VirtualRobot
from wheelwire.simulation.libfwsim import FwSim, FwSimError, Status
from wheelwire_protocol.codes import Fault, ResetReason, SupervisorState


def run_of(seed: int) -> tuple[list[tuple[int, int, float]], float, float]:
    robot = VirtualRobot(seed, **{"left.encoder_error_ticks": 0.3}).open()
    robot.drive(0.2, 0.3, 2.0)
    samples = [(s.t_us, s.left_ticks, s.left_mps) for s in robot.samples]
    return samples, robot.sim.get("true.x_m"), robot.sim.get("boot_id")


@pytest.fixture
def sim() -> FwSim:
    return FwSim()


def test_a_seed_gives_the_same_run_and_another_one_another() -> None:
    assert run_of(1) == run_of(1)
    assert run_of(1) != run_of(2)


@pytest.mark.parametrize("ppm", [-200.0, 0.0, 150.0])
def test_the_devices_clock_drifts(sim: FwSim, ppm: float) -> None:
    sim.set("clock_ppm", ppm)
    sim.advance(1000.0)
    assert sim.get("device_us") == pytest.approx(1e9 * (1 + ppm * 1e-6), abs=1)
    assert sim.get("t_us") == 1e9


def test_a_reset_cuts_the_drive_and_restarts(robot: VirtualRobot) -> None:
    robot.drive(0.3, 0.3, 1.0)
    boot_id = robot.sim.get("boot_id")
    robot.sim.reset(ResetReason.BROWNOUT)
    assert not robot.sim.get("drive_on")
    assert robot.sim.get("device_us") == 0
    assert robot.sim.get("boot_id") != boot_id
    assert robot.sim.get("state") == SupervisorState.BOOT
    robot.sim.advance_us(int(robot.sim.get("boot_time_us")) - 1)
    assert robot.sim.get("state") == SupervisorState.BOOT
    robot.sim.advance_us(1)
    assert robot.sim.get("state") == SupervisorState.IDLE
    assert robot.sim.get("true.left_mps") > 0.0  # it rolls on


def test_a_peripheral_that_does_not_start_is_a_fault_until_the_next_reset(sim: FwSim) -> None:
    sim.set("driver_failed", 1)
    sim.advance(0.1)
    assert sim.get("faults") == Fault.DRIVER_FAILED
    sim.set("driver_failed", 0)
    sim.advance(0.1)
    assert sim.get("faults") == Fault.DRIVER_FAILED
    sim.reset()
    sim.advance(0.1)
    assert sim.get("faults") == 0


def test_every_variable_can_be_read_and_set_to_what_it_is(sim: FwSim) -> None:
    for variable in sim.variables():
        value = sim.get(variable.name)
        if variable.settable:
            assert variable.minimum <= value <= variable.maximum
            sim.set(variable.name, value)
            assert sim.get(variable.name) == value


@pytest.mark.parametrize(
    ("name", "value", "status"),
    [
        ("left.color", 1.0, Status.UNKNOWN_NAME),
        ("true.x_m", 1.0, Status.READ_ONLY),
        ("mass_kg", math.nan, Status.OUT_OF_RANGE),
        ("mass_kg", math.inf, Status.OUT_OF_RANGE),
        ("mass_kg", -1.0, Status.OUT_OF_RANGE),
        ("counts_per_revolution", 360.5, Status.OUT_OF_RANGE),
        ("motor.supply_v", 1.0, Status.OUT_OF_RANGE),  # less than the bridge's drop
    ],
)
def test_a_bad_setting_is_refused_and_changes_nothing(
    sim: FwSim, name: str, value: float, status: Status
) -> None:
    before = [sim.get(variable.name) for variable in sim.variables()]
    with pytest.raises(FwSimError) as refused:
        sim.set(name, value)
    assert refused.value.status is status
    assert [sim.get(variable.name) for variable in sim.variables()] == before


def test_an_unknown_name_cannot_be_read_and_time_does_not_run_backwards(sim: FwSim) -> None:
    with pytest.raises(FwSimError, match="UNKNOWN_NAME"):
        sim.get("nothing")
    with pytest.raises(FwSimError, match="BAD_ARGUMENT"):
        sim.advance_us(-1)
