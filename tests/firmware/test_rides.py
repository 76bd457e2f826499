"""Resets, unpluggings and wraps while driving: no tick is lost or invented, no pose jumps."""

from __future__ import annotations

import pytest

from support.rides import (
    FIRST_WRAP_US,
    TOP_MPS,
    Account,
    Ride,
    across_the_tick_wrap,
    across_the_time_wrap,
    ride,
)
from wheelwire.simulation.impairment import load_profile, shipped_profiles


def check(account: Account) -> None:
    assert account.samples > 0
    assert account.wrong == 0
    assert account.jumps == 0
    assert account.unaccounted == 0


@pytest.mark.parametrize("seed", [1, 2])
def test_resets_and_unpluggings_while_driving(seed: int) -> None:
    riding = ride(60, seed)
    account = riding.finish()
    check(account)
    assert riding.robot.resets == len(account.unseen) > 10
    for unseen in account.unseen:
        assert abs(unseen.distance_m) <= 1.2 * TOP_MPS * unseen.milliseconds / 1e3 + 0.001


@pytest.mark.parametrize("name", shipped_profiles())
def test_driving_on_a_bad_line(name: str) -> None:
    profile = load_profile(name)
    riding = Ride(4, profile).open()
    for _ in range(100):
        riding.drive(200)
    check(riding.finish())
    struck = {incident.what for incident in profile.incidents}
    assert (riding.robot.resets > 0) == ("reset" in struck)
    assert (riding.robot.unplugs > 0) == ("unplug" in struck)


def test_the_device_time_wraps_while_driving() -> None:
    riding = across_the_time_wrap(1)
    check(riding.finish())
    assert riding.newest.t_us > FIRST_WRAP_US


def test_the_tick_counts_wrap() -> None:
    riding = across_the_tick_wrap(1)
    check(riding.finish())
    assert riding.newest.left_ticks < 0


def test_samples_come_soon_after_the_port_is_back() -> None:
    riding = Ride(3).open()
    for away_ms in (1, 50, 500, 3000):
        began_ms = riding.robot.now_us // 1000
        riding.unplug(away_ms)
        assert riding.robot.now_us // 1000 - began_ms - away_ms < 50
