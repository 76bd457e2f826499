import math
from dataclasses import replace

import pytest

from support.host_samples import sample, wrap
from wheelwire.motion.kinematics import DifferentialDrive
from wheelwire.motion.odometry import Odometry, Pose

FINE = DifferentialDrive(wheel_separation=0.2, wheel_radius=0.033, counts_per_revolution=200_000)


def finely_integrated(v: float, w: float, seconds: float) -> Pose:
    """Euler's rule in ten thousand steps: no formula in common with the odometry's."""
    steps = 10_000
    x = y = heading = 0.0
    for _ in range(steps):
        x += v * math.cos(heading) * seconds / steps
        y += v * math.sin(heading) * seconds / steps
        heading += w * seconds / steps
    return Pose(x, y, heading)


@pytest.fixture
def odometry() -> Odometry:
    return Odometry(FINE)


@pytest.mark.parametrize("w", [-2.0, -0.3, 0.0, 1e-9, 0.3, 1.0])
def test_an_arc_equals_a_finely_integrated_one(w: float) -> None:
    arc = Pose().advance(0.4 * 2.0, w * 2.0)
    assert arc == pytest.approx(finely_integrated(0.4, w, 2.0), abs=2e-4)


def test_the_midpoint_rule_meets_the_arc_where_they_change_over() -> None:
    below = Pose(heading_rad=0.7).advance(1.0, 0.999e-6)
    above = Pose(heading_rad=0.7).advance(1.0, 1.001e-6)
    assert math.dist(below[:2], above[:2]) < 2e-9


def test_samples_become_a_pose_and_a_twist_on_the_devices_clock(odometry: Odometry) -> None:
    odometry.update(sample(t_us=0, stamp=0.0))
    ticks = round(0.1 / FINE.metres_per_tick)
    update = odometry.update(sample(t_us=100_000, left_ticks=ticks, right_ticks=ticks, stamp=9.0))
    assert update.pose == pytest.approx((0.1, 0.0, 0.0), abs=1e-6)
    assert update.twist == pytest.approx((1.0, 0.0), abs=1e-5)
    assert update.dt_s == 0.1


def test_the_first_sample_does_not_move_the_robot(odometry: Odometry) -> None:
    assert odometry.update(sample(left_ticks=77, right_ticks=99)).pose == Pose()


def test_a_counter_wrap_is_no_jump(odometry: Odometry) -> None:
    start = 2**31 - 5
    odometry.update(sample(left_ticks=start, right_ticks=start))
    end = wrap(start + 10)
    pose = odometry.update(sample(left_ticks=end, right_ticks=end, t_us=1)).pose
    assert pose.x_m == pytest.approx(10 * FINE.metres_per_tick)


def test_a_device_reset_causes_no_jump_and_is_reported(odometry: Odometry) -> None:
    odometry.update(sample(left_ticks=50_000, right_ticks=50_000))
    before = odometry.update(sample(left_ticks=60_000, right_ticks=60_000, t_us=10_000)).pose
    update = odometry.update(sample(boot_id=2, t_us=5))
    assert update.rebased
    assert update.pose == before
    assert odometry.rebases == 1
    after = odometry.update(sample(boot_id=2, left_ticks=10, right_ticks=10, t_us=105))
    assert after.pose.x_m - before.x_m == pytest.approx(10 * FINE.metres_per_tick)
    assert not after.rebased


def test_reset_moves_the_pose_and_keeps_the_counters(odometry: Odometry) -> None:
    odometry.update(sample(left_ticks=100, right_ticks=100))
    odometry.reset(Pose(1.0, 2.0, 0.5))
    assert odometry.update(sample(left_ticks=100, right_ticks=100, t_us=1)).pose == (1.0, 2.0, 0.5)


@pytest.mark.parametrize(("side", "turn"), [("left", -0.05), ("right", 0.05)])
def test_a_larger_wheel_travels_further_by_the_same_ticks(side: str, turn: float) -> None:
    odometry = Odometry(replace(FINE, **{f"{side}_radius_multiplier": 1.05}))
    odometry.update(sample())
    update = odometry.update(sample(left_ticks=1000, right_ticks=1000, t_us=1))
    travel_m = 1000 * FINE.metres_per_tick
    assert update.distance_m == pytest.approx(1.025 * travel_m)
    assert update.turn_rad == pytest.approx(turn * travel_m / FINE.wheel_separation)


def test_across_a_reset_each_wheel_may_have_gone_on_at_its_own_speed() -> None:
    odometry = Odometry(DifferentialDrive(0.2, 0.033, 360))
    odometry.update(sample(boot_id=1, left_mps=0.3, right_mps=-0.1, stamp=10.0))
    # By hand: 2 s at each of the speeds; and no more than 5 s, however long it was.
    for stamp, expected in ((12.0, (0.6, -0.2)), (100.0, (1.5, -0.5))):
        again = Odometry(odometry.drive)
        again.update(sample(boot_id=1, left_mps=0.3, right_mps=-0.1, stamp=10.0))
        update = again.update(sample(boot_id=2, left_mps=0.7, right_mps=0.7, stamp=stamp))
        assert update.rebased
        assert (update.unseen_left_m, update.unseen_right_m) == pytest.approx(expected)
    same_boot = odometry.update(sample(boot_id=1, stamp=12.0))
    assert (same_boot.unseen_left_m, same_boot.unseen_right_m) == (0.0, 0.0)
