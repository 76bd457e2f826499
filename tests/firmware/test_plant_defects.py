"""What can be wrong in a workshop: each variable by the truth, and by what the firmware reports."""

from __future__ import annotations

import math
from itertools import pairwise, product

import pytest

from support.virtual import VirtualRobot
from wheelwire.link.session import Phase
from wheelwire.samples import tick_difference
from wheelwire.simulation.libfwsim import FwSim
from wheelwire_protocol.codes import ResetReason, SupervisorState

COUNTS = 360
COUNTER_LIMIT = 32767
FINE = 100_000  # counts per revolution: a turn is three times round the counter


def reported(robot: VirtualRobot) -> tuple[int, int]:
    """The ticks of the newest state frame, signed."""
    sample = robot.sample
    return tick_difference(sample.left_ticks, 0), tick_difference(sample.right_ticks, 0)


def truth(robot: VirtualRobot, name: str) -> tuple[float, float]:
    """A reading of both wheels."""
    return robot.sim.get(f"true.left_{name}"), robot.sim.get(f"true.right_{name}")


def rest(robot: VirtualRobot) -> None:
    """Stop, stand still, and hear of it."""
    robot.stop()
    robot.run_until(lambda: bool(robot.sim.get("stands_still")))
    robot.run(0.05)


def driven(left: float, right: float, seconds: float, **settings: float) -> VirtualRobot:
    """A robot that was driven open loop, and still is."""
    robot = VirtualRobot(**settings).open()
    robot.drive_duty(left, right, seconds)
    return robot


def by_hand(turns: float, **settings: float) -> VirtualRobot:
    """A robot whose left wheel was turned by hand."""
    robot = VirtualRobot(**settings).open()
    robot.sim.set("left.hand_turns", turns)
    robot.run_until(lambda: robot.sim.get("left.hand_turns") == 0.0, timeout_s=20.0)
    robot.run(0.05)
    return robot


# --- the wiring ---------------------------------------------------------------------------------


WIRING = (
    "motors_swapped",
    "encoders_swapped",
    "left.motor_reversed",
    "right.motor_reversed",
    "left.encoder_reversed",
    "right.encoder_reversed",
)


@pytest.mark.parametrize(
    "wired", list(product((0, 1), repeat=6)), ids=lambda w: "".join(map(str, w))
)
def test_each_of_64_wirings_moves_and_counts_as_it_is_wired(wired: tuple[int, ...]) -> None:
    wiring = dict(zip(WIRING, wired, strict=True))
    robot = VirtualRobot(wheels_free=1, **wiring).open()
    robot.drive_duty(0.3, 0.0, 0.04)
    robot.run(0.05)
    moved = wiring["motors_swapped"]
    side = ("left", "right")[moved]
    way = -1 if wiring[f"{side}.motor_reversed"] else 1
    turns = truth(robot, "turns")
    assert way * turns[moved] > 0.01
    assert turns[1 - moved] == 0.0
    counter = moved ^ wiring["encoders_swapped"]
    sign = -way if wiring[f"{side}.encoder_reversed"] else way
    assert sign * reported(robot)[counter] > 3
    assert reported(robot)[1 - counter] == 0


@pytest.mark.parametrize(
    "wired", list(product((0, 1), repeat=6)), ids=lambda w: "".join(map(str, w))
)
def test_parameters_undo_each_of_64_wirings(wired: tuple[int, ...]) -> None:
    wiring = dict(zip(WIRING, wired, strict=True))
    robot = VirtualRobot(wheels_free=1, **wiring).open()
    for variable, value in wiring.items():
        name = variable.replace(".", "_").replace("reversed", "inverted")
        robot.set_parameter(name, value)
    robot.drive_duty(0.3, -0.2, 0.2)
    left, right = truth(robot, "turns")
    assert left > 0.05
    assert right < -0.03
    rest(robot)
    assert reported(robot) == truth(robot, "ticks")


def test_a_reset_counts_nothing_whatever_the_wiring() -> None:
    robot = VirtualRobot(encoders_swapped=1, channels_mixed=1).open()
    robot.sim.set("right.hand_turns", 29.5 / COUNTS)  # both levels are high
    robot.run(0.2)
    robot.sim.reset()
    robot.run(0.1)
    robot.sim.set("left.hand_turns", 1 / COUNTS)  # one edge of A, which is the right counter's
    robot.run(0.2)
    left, right = reported(robot)
    assert (left, abs(right)) == (0, 1)


@pytest.mark.parametrize(("same", "shown"), [(1, 0), (2, 1)])
def test_both_encoders_on_one_wheel_agree(same: int, shown: int) -> None:
    robot = driven(0.3, -0.2, 0.5, encoders_same=same)
    rest(robot)
    assert reported(robot) == (truth(robot, "ticks")[shown],) * 2


def test_channels_of_two_encoders_do_not_count_one_wheel() -> None:
    robot = by_hand(2.0, channels_mixed=1)
    assert truth(robot, "ticks")[0] == pytest.approx(2 * COUNTS, abs=1)
    assert all(abs(count) <= 2 for count in reported(robot))


def test_a_motor_with_a_wire_off_does_not_turn() -> None:
    robot = driven(0.5, 0.5, 0.5, **{"left.motor_open": 1})
    assert robot.sim.get("left.duty") == pytest.approx(0.5, abs=0.01)
    assert robot.sim.get("left.current_a") == 0.0
    assert truth(robot, "turns")[0] == 0.0
    assert reported(robot)[0] == 0
    assert reported(robot)[1] > 100


# --- the wheels ---------------------------------------------------------------------------------


def test_free_wheels_start_sooner_and_the_robot_stays() -> None:
    floor = driven(0.4, 0.4, 0.1)
    free = driven(0.4, 0.4, 0.1, wheels_free=1)
    assert truth(free, "turns")[0] > 2 * truth(floor, "turns")[0] > 0
    assert reported(free)[0] > 1.5 * reported(floor)[0]
    for name in ("true.x_m", "true.y_m", "true.heading_rad", "true.distance_m"):
        assert free.sim.get(name) == 0.0
    assert floor.sim.get("true.distance_m") > 0.0


def test_free_wheels_run_as_fast_in_the_end_and_no_slope_moves_them() -> None:
    floor = driven(0.5, 0.5, 2.0)
    free = driven(0.5, 0.5, 2.0, wheels_free=1)
    assert truth(free, "mps")[0] == pytest.approx(truth(floor, "mps")[0], rel=0.01)
    standing = VirtualRobot(wheels_free=1, slope_rad=0.5).open()
    standing.run(0.5)
    assert truth(standing, "turns") == (0.0, 0.0)


@pytest.mark.parametrize("turns", [10.0, -3.0, 0.25])
def test_a_wheel_turned_by_hand_counts_its_turns(turns: float) -> None:
    robot = by_hand(turns, wheels_free=1)
    assert truth(robot, "turns") == pytest.approx((turns, 0.0))
    assert reported(robot) == pytest.approx((turns * COUNTS, 0), abs=1)
    assert not robot.sim.get("drive_on")
    assert robot.sim.get("true.distance_m") == 0.0
    assert robot.sim.get("stands_still")


def test_a_blocked_wheel_waits_for_the_hand() -> None:
    robot = VirtualRobot(**{"left.blocked": 1}).open()
    robot.sim.set("left.hand_turns", 0.5)
    robot.run(0.5)
    assert (robot.sim.get("left.hand_turns"), truth(robot, "turns")[0]) == (0.5, 0.0)


def test_a_larger_wheel_goes_further_with_as_many_ticks() -> None:
    robot = VirtualRobot(**{"left.radius_scale": 1.1}).open()
    for side in ("left", "right"):
        robot.sim.set(f"{side}.hand_turns", 2.0)
    robot.run(2.1)
    assert reported(robot)[0] == pytest.approx(reported(robot)[1], abs=1)
    rim = 2 * 2 * math.pi * 0.033
    assert robot.sim.get("true.distance_m") == pytest.approx(1.05 * rim, rel=1e-6)
    assert robot.sim.get("true.heading_rad") == pytest.approx(-0.1 * rim / 0.2, rel=1e-6)


def test_backlash_counts_where_the_wheel_stands() -> None:
    play = 0.2
    robot = by_hand(1.0, wheels_free=1, **{"left.backlash_rad": play})
    forward, counted = truth(robot, "turns")[0], reported(robot)[0]
    assert forward == pytest.approx(1.0 - play / 2 / (2 * math.pi), abs=1e-6)  # from the middle
    robot.sim.set("left.hand_turns", -play / (2 * math.pi))
    robot.run(0.3)
    assert truth(robot, "turns")[0] == pytest.approx(forward, abs=1e-9)
    assert reported(robot)[0] - counted == pytest.approx(-play / (2 * math.pi) * COUNTS, abs=1)
    robot.sim.set("left.hand_turns", -0.5)
    robot.run(0.6)
    assert truth(robot, "turns")[0] == pytest.approx(forward - 0.5, abs=1e-6)


def test_a_motor_crosses_its_play_before_the_robot_moves() -> None:
    tight = driven(0.3, 0.3, 0.05)
    loose = driven(0.3, 0.3, 0.05, **{"left.backlash_rad": 0.4, "right.backlash_rad": 0.4})
    assert truth(loose, "ticks")[0] > truth(tight, "ticks")[0]
    assert loose.sim.get("true.distance_m") < tight.sim.get("true.distance_m")
    rest(loose)
    counted = truth(loose, "ticks")[0] / COUNTS
    assert counted - truth(loose, "turns")[0] == pytest.approx(0.2 / (2 * math.pi), abs=0.01)


def test_slip_loses_travel_under_load_only() -> None:
    grip = driven(0.6, 0.6, 2.0, slope_rad=0.1)
    slick = driven(0.6, 0.6, 2.0, slope_rad=0.1, slip=0.8)
    rolled = truth(slick, "turns")[0] * 2 * math.pi * 0.033
    gripped = truth(grip, "turns")[0] * 2 * math.pi * 0.033
    assert grip.sim.get("true.x_m") == pytest.approx(gripped)
    # Uphill at constant speed each wheel carries its share of m g sin(slope).
    assert truth(slick, "slip")[0] == pytest.approx(0.8 * math.sin(0.1), rel=0.02)
    assert slick.sim.get("true.x_m") < 0.95 * rolled
    assert reported(slick) == pytest.approx(truth(slick, "ticks"), abs=12)
    level = driven(0.6, 0.6, 3.0, slip=0.8)
    assert truth(level, "slip")[0] == pytest.approx(0.0, abs=1e-3)


# --- one motor unlike the other -----------------------------------------------------------------


def test_a_weak_motor_stalls_with_less_torque() -> None:
    robot = VirtualRobot(**{"left.torque_scale": 0.3, "left.blocked": 1, "right.blocked": 1}).open()
    robot.drive_duty(0.6, 0.6, 0.2)
    assert robot.sim.get("left.current_a") == robot.sim.get("right.current_a")
    weak = driven(0.3, 0.3, 1.0, **{"left.torque_scale": 0.3})
    assert truth(weak, "turns")[0] < 0.6 * truth(weak, "turns")[1]
    assert reported(weak)[0] < 0.6 * reported(weak)[1]


def test_a_winding_of_its_own_draws_its_own_current() -> None:
    robot = VirtualRobot(
        **{"left.winding_scale": 2.0, "left.blocked": 1, "right.blocked": 1}
    ).open()
    robot.drive_duty(1.0, 1.0, 0.4)
    drop_v, drop_ohm, winding = 1.3, 1.2, (7.4 - 1.3) / 1.0 - 1.2
    assert robot.sim.get("right.current_a") == pytest.approx(1.0)
    assert robot.sim.get("left.current_a") == pytest.approx(
        (7.4 - drop_v) / (2 * winding + drop_ohm)
    )


def test_friction_of_its_own_slows_one_wheel() -> None:
    robot = driven(0.5, 0.5, 1.0, **{"left.coulomb_scale": 3.0, "left.static_scale": 3.0})
    assert truth(robot, "mps")[0] < 0.85 * truth(robot, "mps")[1]
    assert robot.sample.left_mps < 0.9 * robot.sample.right_mps
    viscous = driven(0.5, 0.5, 1.0, **{"right.viscous_scale": 10.0})
    assert truth(viscous, "mps")[1] < truth(viscous, "mps")[0]


def test_static_friction_of_its_own_holds_one_wheel() -> None:
    robot = driven(0.12, 0.12, 1.0, **{"left.static_scale": 3.0})
    assert truth(robot, "turns")[0] == 0.0 < truth(robot, "turns")[1]
    assert reported(robot)[0] == 0 < reported(robot)[1]


# --- the encoders -------------------------------------------------------------------------------


def test_ticks_are_exact_far_beyond_the_counter_both_ways() -> None:
    robot = VirtualRobot(counts_per_revolution=FINE).open()
    robot.drive_duty(0.6, -0.6, 4.0)
    rest(robot)
    left, right = truth(robot, "ticks")
    assert left > 10 * COUNTER_LIMIT
    assert right < -10 * COUNTER_LIMIT
    assert reported(robot) == (left, right)


def test_ticks_are_exact_when_hovering_about_the_limit() -> None:
    robot = VirtualRobot(counts_per_revolution=FINE).open()
    robot.drive_duty(0.3, 0.3, 0.2)
    while truth(robot, "ticks")[0] < COUNTER_LIMIT:
        robot.drive_duty(0.3, 0.3, 0.02)
    crossings = 0
    above = True
    for _ in range(40):
        duty = -0.3 if truth(robot, "ticks")[0] > COUNTER_LIMIT else 0.3
        robot.drive_duty(duty, duty, 0.1)
        crossings += above != (truth(robot, "ticks")[0] > COUNTER_LIMIT)
        above = truth(robot, "ticks")[0] > COUNTER_LIMIT
    rest(robot)
    assert crossings > 5
    assert reported(robot) == truth(robot, "ticks")


def test_a_stuck_channel_has_two_names() -> None:
    robot = FwSim()
    robot.set("left.encoder_stuck", 2)
    assert robot.get("left.stuck_channel") == 2


@pytest.mark.parametrize("channel", [1, 2])
def test_a_stuck_channel_counts_back_and_forth(channel: int) -> None:
    robot = by_hand(2.0, wheels_free=1, **{"left.stuck_channel": channel})
    assert truth(robot, "ticks")[0] == pytest.approx(2 * COUNTS, abs=1)
    assert abs(reported(robot)[0]) <= 1


def test_a_missing_magnet_bunches_the_counts_once_a_turn() -> None:
    robot = VirtualRobot(wheels_free=1, **{"left.magnet_missing": 1}).open()
    robot.sim.set("left.hand_turns", 2.0)
    lag = []
    while robot.sim.get("left.hand_turns") > 0.0:
        robot.step()
        lag.append(truth(robot, "ticks")[0] - reported(robot)[0])
    robot.run(0.05)
    assert reported(robot)[0] == pytest.approx(2 * COUNTS, abs=COUNTS / 12)
    assert max(lag) == pytest.approx(COUNTS / 12, abs=12)
    late = [count > 20 for count in lag]
    assert sum(now and not before for before, now in pairwise(late)) == 2
    assert min(lag) >= -1


def test_the_bunch_is_lost_in_neither_direction() -> None:
    robot = by_hand(
        1.5, wheels_free=1, **{"left.magnet_missing": 1, "left.encoder_error_ticks": 0.4}
    )
    assert reported(robot)[0] == pytest.approx(1.5 * COUNTS, abs=1)
    robot.sim.set("left.hand_turns", -3.0)
    robot.run(3.1)
    assert reported(robot)[0] == pytest.approx(-1.5 * COUNTS, abs=1)


# --- the supply ---------------------------------------------------------------------------------


def test_the_supply_sags_under_both_motors() -> None:
    robot = VirtualRobot(supply_ohm=0.5, **{"left.blocked": 1, "right.blocked": 1}).open()
    assert robot.sim.get("true.supply_v") == 7.4
    robot.drive_duty(1.0, 1.0, 0.4)
    # Two windings in parallel behind the resistance.
    volts, winding = 7.4 - 1.3, (7.4 - 1.3) / 1.0
    current = volts / (winding + 2 * 0.5)
    assert robot.sim.get("left.current_a") == pytest.approx(current, rel=1e-3)
    assert robot.sim.get("true.supply_v") == pytest.approx(7.4 - 2 * 0.5 * current, rel=1e-3)
    assert robot.sample.battery_v == pytest.approx(7.4 - 2 * 0.5 * current, abs=0.06)
    robot.stop()
    robot.run(0.2)
    assert robot.sim.get("true.supply_v") == pytest.approx(7.4, abs=1e-6)


def test_a_sagging_supply_is_slow() -> None:
    stiff, soft = driven(0.8, 0.8, 1.5), driven(0.8, 0.8, 1.5, supply_ohm=5.0)
    assert truth(soft, "mps")[0] < 0.9 * truth(stiff, "mps")[0]
    assert reported(soft)[0] < 0.9 * reported(stiff)[0]


def test_no_supply_moves_nothing() -> None:
    robot = driven(0.5, 0.5, 0.4, supply_v=0.0)
    assert robot.sim.get("drive_on")
    assert truth(robot, "turns") == (0.0, 0.0)
    assert reported(robot) == (0, 0)


def test_a_brownout_resets_the_device() -> None:
    robot = VirtualRobot(supply_ohm=2.0, brownout_v=5.5).open()
    boot_id = robot.sim.get("boot_id")
    for _ in range(100):
        if robot.sim.get("boot_id") != boot_id:
            break
        robot.set_duty(1.0, 1.0)
        robot.run(0.01)
    assert robot.sim.get("boot_id") != boot_id
    assert robot.sim.get("state") == SupervisorState.BOOT  # for boot_time_us
    assert not robot.sim.get("drive_on")
    robot.run(0.2)
    robot.open()
    assert robot.session.phase is Phase.OPEN
    assert robot.session.device is not None
    assert robot.session.device.reset_reason is ResetReason.BROWNOUT


def test_a_flat_battery_holds_the_device_in_reset_until_it_is_changed() -> None:
    robot = VirtualRobot(brownout_v=5.5).open()
    boot_id = robot.sim.get("boot_id")
    robot.sim.set("supply_v", 5.0)
    robot.sim.advance(0.5)
    assert robot.sim.get("device_us") == 0.0
    assert robot.sim.get("boot_id") != boot_id
    boot_id = robot.sim.get("boot_id")
    robot.sim.set("supply_v", 7.4)
    robot.sim.advance(0.1)
    assert robot.sim.get("device_us") == pytest.approx(100_000, abs=200)
    assert robot.sim.get("boot_id") == boot_id  # one reset
