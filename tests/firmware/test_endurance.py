"""Resets, unpluggings and wraps while driving: no tick is lost or invented, no pose jumps."""

from __future__ import annotations

import pytest

from support.endurance import (
    FIRST_WRAP_US,
    TOP_MPS,
    Account,
    EnduranceRun,
    across_the_time_wrap,
    drive_and_interrupt,
)
from support.host_samples import remeasured
from support.library_robot import LibraryRobot
from wheelwire.link.sample_stream import LatestSample
from wheelwire.tools.files.bad_line import load_profile, shipped_profiles

TICKS_A_STEP = 15_000
"""Less than half of the hardware counters' range."""


def check(account: Account) -> None:
    assert account.samples > 0
    assert account.wrong == 0
    assert account.jumps == 0
    assert account.unaccounted == 0


@pytest.mark.parametrize("seed", [1, 2])
def test_resets_and_unpluggings_while_driving(seed: int) -> None:
    run = drive_and_interrupt(60, seed)
    account = run.finish()
    check(account)
    assert run.resets == len(account.unseen) > 10
    for unseen in account.unseen:
        assert abs(unseen.distance_m) <= 1.2 * TOP_MPS * unseen.milliseconds / 1e3 + 0.001


@pytest.mark.whole
@pytest.mark.parametrize("name", shipped_profiles())
def test_driving_on_a_bad_line(name: str) -> None:
    profile = load_profile(name)
    run = EnduranceRun(4, profile).open()
    for _ in range(70):  # 14 s: the last incident of a profile is at 12
        run.drive_at_random(200)
    check(run.finish())
    incidents = {incident.what for incident in profile.incidents}
    assert (run.resets > 0) == ("reset" in incidents)
    assert (run.unplugs > 0) == ("unplug" in incidents)


@pytest.mark.whole
def test_the_device_time_wraps_while_driving() -> None:
    run = across_the_time_wrap(1)
    check(run.finish())
    assert run.sample.t_us > FIRST_WRAP_US


def test_the_tick_counts_wrap() -> None:
    """By the core alone; `make reliability` turns the simulated wheels, edge by edge."""
    robot, latest_sample = LibraryRobot().start(), LatestSample()

    def turn() -> None:
        robot.left_ticks += TICKS_A_STEP
        robot.right_ticks -= TICKS_A_STEP
        robot.step()

    while robot.left_ticks < (1 << 31) - 3 * TICKS_A_STEP:
        turn()
    begin = robot.connect().samples[-1]
    for _ in range(6):
        turn()
    robot.run_until(lambda: robot.samples[-1].t_us >= robot.now_us - robot.outputs.period_us)
    for sample in robot.samples:
        latest_sample.put(remeasured(sample))
    end = robot.samples[-1]
    assert begin.right_ticks < 0 < begin.left_ticks
    assert end.left_ticks < 0 < end.right_ticks
    assert latest_sample.ticks(0.0) == (robot.left_ticks, robot.right_ticks)


def test_samples_come_soon_after_the_port_is_back() -> None:
    run = EnduranceRun(3).open()
    for away_ms in (1, 50, 500, 3000):
        began_ms = run.now_us // 1000
        run.unplug_for(away_ms)
        assert run.now_us // 1000 - began_ms - away_ms < 50
