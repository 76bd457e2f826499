"""Resets, unpluggings and wraps while driving: no tick is lost or invented, no pose jumps."""

from __future__ import annotations

import pytest

from support.endurance import (
    FIRST_WRAP_US,
    TOP_MPS,
    Account,
    EnduranceRun,
    across_the_tick_wrap,
    across_the_time_wrap,
    drive_and_interrupt,
)
from wheelwire.simulation.impairment import load_profile, shipped_profiles


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
    assert run.robot.resets == len(account.unseen) > 10
    for unseen in account.unseen:
        assert abs(unseen.distance_m) <= 1.2 * TOP_MPS * unseen.milliseconds / 1e3 + 0.001


@pytest.mark.parametrize("name", shipped_profiles())
def test_driving_on_a_bad_line(name: str) -> None:
    profile = load_profile(name)
    run = EnduranceRun(4, profile).open()
    for _ in range(100):
        run.drive(200)
    check(run.finish())
    incidents = {incident.what for incident in profile.incidents}
    assert (run.robot.resets > 0) == ("reset" in incidents)
    assert (run.robot.unplugs > 0) == ("unplug" in incidents)


def test_the_device_time_wraps_while_driving() -> None:
    run = across_the_time_wrap(1)
    check(run.finish())
    assert run.newest.t_us > FIRST_WRAP_US


def test_the_tick_counts_wrap() -> None:
    run = across_the_tick_wrap(1)
    check(run.finish())
    assert run.newest.left_ticks < 0


def test_samples_come_soon_after_the_port_is_back() -> None:
    run = EnduranceRun(3).open()
    for away_ms in (1, 50, 500, 3000):
        began_ms = run.robot.now_us // 1000
        run.unplug(away_ms)
        assert run.robot.now_us // 1000 - began_ms - away_ms < 50
