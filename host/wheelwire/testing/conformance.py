"""The tests that every driver passes, whatever hardware is behind it.

Their tolerances are wide: how well the controller holds a velocity is measured elsewhere.
"""

from __future__ import annotations

import gc
import math
import threading
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from wheelwire_protocol.codes import EstopSource, Fault, Held, StopCause, SupervisorState

from .. import errors
from ..link.holds import HeldBy
from ..motion.kinematics import WheelVelocities
from ..robot.robot import Robot
from ..samples import WheelSample
from ..tools.setup.driving import set_at_rest
from .harness import CLOSE, SPEED_MPS, TIMEOUT_S, Bench, DriveHarness, mean_of, standing, turning

TURN_RADPS = 1.5
BATCH_S = 0.05
"""Some drivers receive edges in batches, and late on a busy machine."""
WATCHDOG_MARGIN_S = 0.15
"""Allows for one sample period and a busy machine."""
POLL_S = 0.01


class MotionTests:
    """Signs, units, and the limit."""

    def test_forward_is_positive_on_both_wheels(self, harness: DriveHarness) -> None:
        before = harness.driver.get_encoder_ticks()
        # A busy computer may show the start only after a wheel was too fast for a moment.
        harness.drive_until(
            SPEED_MPS, 0.0, lambda s: turning(s) and s.left_duty > 0 and s.right_duty > 0
        )
        after = harness.driver.get_encoder_ticks()
        assert after[0] > before[0]
        assert after[1] > before[1]

    def test_backward_is_negative_on_both_wheels(self, harness: DriveHarness) -> None:
        before = harness.driver.get_encoder_ticks()
        harness.drive_until(-SPEED_MPS, 0.0, lambda s: max(s.left_mps, s.right_mps) < -0.1)
        after = harness.driver.get_encoder_ticks()
        assert after[0] < before[0]
        assert after[1] < before[1]

    def test_counter_clockwise_is_positive_so_the_right_wheel_goes_forward(
        self, harness: DriveHarness
    ) -> None:
        before = harness.driver.get_encoder_ticks()
        harness.drive_until(0.0, TURN_RADPS, lambda s: s.right_mps > 0.1 and s.left_mps < -0.1)
        after = harness.driver.get_encoder_ticks()
        assert after[0] < before[0]
        assert after[1] > before[1]

    def test_a_left_turn_has_the_right_wheel_faster(self, harness: DriveHarness) -> None:
        separation = harness.driver.geometry.wheel_separation
        # A difference has the errors of both velocities.
        close = pytest.approx(0.5 * separation, rel=2 * CLOSE)
        harness.steady(SPEED_MPS, 0.5, lambda s: mean_of(s, "right") - mean_of(s, "left") == close)

    def test_velocities_are_in_metres_per_second(self, harness: DriveHarness) -> None:
        close = pytest.approx(SPEED_MPS, rel=CLOSE)
        metres_per_tick = harness.driver.geometry.metres_per_tick

        def as_commanded(steady: list[WheelSample]) -> bool:
            travel = steady[-1].since(steady[0])
            by_ticks = travel.left * metres_per_tick / travel.dt_s
            return all(
                v == close for v in (mean_of(steady, "left"), mean_of(steady, "right"), by_ticks)
            )

        harness.steady(SPEED_MPS, 0.0, as_commanded)

    def test_a_duty_drives_open_loop(self, harness: DriveHarness) -> None:
        sample = harness.drive_duty(0.5, -0.5, lambda s: s.left_mps > 0.1 and s.right_mps < -0.1)
        assert sample.left_duty == pytest.approx(0.5, abs=1e-3)
        assert sample.right_duty == pytest.approx(-0.5, abs=1e-3)

    def test_both_wheels_are_slowed_by_one_factor(self, harness: DriveHarness) -> None:
        limit = harness.driver.geometry.max_velocity_mps
        separation = harness.driver.geometry.wheel_separation
        linear, angular = limit, 1.5
        asked = WheelVelocities(
            linear - angular * separation / 2, linear + angular * separation / 2
        )
        ratio = pytest.approx(asked.left_mps / asked.right_mps, rel=CLOSE)

        def as_commanded(steady: list[WheelSample]) -> bool:
            left, right = mean_of(steady, "left"), mean_of(steady, "right")
            return right == pytest.approx(limit, rel=CLOSE) and left / right == ratio

        harness.steady(linear, angular, as_commanded)


class SamplingTests:
    """Samples and ticks."""

    def test_a_sample_is_read_once_and_in_order(self, harness: DriveHarness) -> None:
        times = [harness.next().t_us for _ in range(20)]
        assert times == sorted(set(times))

    def test_ticks_continue_without_a_jump(self, harness: DriveHarness) -> None:
        samples = harness.drive(SPEED_MPS, 0.0, 1.0)
        per_metre = 1 / harness.driver.geometry.metres_per_tick
        for before, after in pairwise(samples):
            travel = after.since(before)
            assert not travel.rebased
            most = 3 * SPEED_MPS * per_metre * (travel.dt_s + BATCH_S)
            # A wheel that starts from an edge may toggle before it goes on.
            assert -2 <= travel.left <= most
            assert -2 <= travel.right <= most

    def test_no_tick_is_lost(self, bench: Bench, harness: DriveHarness) -> None:
        def counts() -> tuple[tuple[int, int], tuple[int, int]]:
            return harness.driver.get_encoder_ticks(), bench.true_ticks()

        def settled() -> bool:
            before = counts()
            harness.watch(0.2)
            return counts() == before

        # The two counts are read one after the other: no wheel may roll meanwhile.
        harness.first(settled, bool)
        start, true_start = counts()
        harness.drive(SPEED_MPS, 1.0, 1.0)
        harness.drive(-SPEED_MPS, 0.0, 1.0)
        harness.rest()

        def lost() -> list[int]:
            end, true_end = counts()
            return [true_end[n] - true_start[n] - (end[n] - start[n]) for n in (0, 1)]

        harness.wait(lambda _: lost() == [0, 0])  # the last edges may still be on their way
        harness.watch(0.2)
        assert lost() == [0, 0]  # nor does one come twice

    def test_a_stamp_is_the_hosts_time(self, harness: DriveHarness) -> None:
        samples = harness.watch(1.0)
        elapsed_s = samples[-1].stamp - samples[0].stamp
        assert elapsed_s == pytest.approx(samples[-1].since(samples[0]).dt_s, abs=0.05)


def not_driving(sample: WheelSample) -> bool:
    """Whether the robot is not in the state DRIVING."""
    return sample.state is not SupervisorState.DRIVING


class StoppingTests:
    """The supervisor, seen through the driver."""

    def test_a_stop_removes_the_drive_and_the_wheels_come_to_rest(
        self, bench: Bench, harness: DriveHarness
    ) -> None:
        harness.drive_until(SPEED_MPS, 0.0, turning)
        harness.driver.stop()
        sample = harness.wait(not_driving)
        assert sample.state is SupervisorState.IDLE
        assert sample.left_duty == sample.right_duty == 0
        harness.wait(standing)
        assert not bench.is_driven()

    def test_a_setpoint_ends_with_its_time_to_live(
        self, bench: Bench, harness: DriveHarness
    ) -> None:
        harness.drive_until(SPEED_MPS, 0.0, turning)
        sample = harness.time_to(
            lambda: harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=0.3),
            not_driving,
            0.3 + WATCHDOG_MARGIN_S,
        )
        assert sample.state is SupervisorState.TIMED_OUT
        harness.wait(standing)
        assert not bench.is_driven()

    def test_the_time_to_live_counts_from_the_stamp(self, harness: DriveHarness) -> None:
        harness.drive_until(SPEED_MPS, 0.0, turning)

        def command_with_an_old_stamp() -> None:
            made = harness.next().stamp
            harness.drive(SPEED_MPS, 0.0, 0.4)
            harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=1.0, stamp=made)

        # 0.4 of the 1 s have passed when it is sent.
        sample = harness.time_to(command_with_an_old_stamp, not_driving, 0.6 + WATCHDOG_MARGIN_S)
        assert sample.state is SupervisorState.TIMED_OUT

    def test_reading_does_not_extend_a_setpoint(self, harness: DriveHarness) -> None:
        harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=0.3)
        start = harness.next()
        while harness.next().t_us - start.t_us < 0.6e6:
            harness.driver.get_encoder_ticks()
            assert harness.driver.geometry.wheel_radius > 0
        assert harness.next().state is SupervisorState.TIMED_OUT

    def test_a_time_to_live_is_limited(self, harness: DriveHarness) -> None:
        longest_s = harness.driver.parameters["ttl_max_s"]
        with pytest.raises(errors.InvalidCommand, match="ttl_max_s"):
            harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=1e9)
        sample = harness.time_to(
            lambda: harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=longest_s),
            not_driving,
            longest_s + WATCHDOG_MARGIN_S,
        )
        assert sample.state is SupervisorState.TIMED_OUT

    def test_a_fresh_setpoint_ends_a_time_out(self, harness: DriveHarness) -> None:
        harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=0.3)
        harness.wait(lambda s: s.state is SupervisorState.TIMED_OUT)
        harness.drive_until(SPEED_MPS, 0.0, turning)

    def test_a_full_reversal_is_no_fault(self, harness: DriveHarness) -> None:
        harness.drive(0.3, 0.0, 1.0)
        # Until they turn round, the wheels are driven against their motion, as with a reversed
        # encoder.
        harness.drive(-0.3, 0.0, 1.0)
        harness.drive_until(-0.3, 0.0, lambda s: s.state is SupervisorState.DRIVING)
        assert harness.next().faults == Fault(0)

    def test_an_estop_latches_until_it_is_cleared(self, harness: DriveHarness) -> None:
        harness.drive_until(SPEED_MPS, 0.0, turning)
        harness.driver.estop()
        harness.wait(lambda s: s.state is SupervisorState.ESTOPPED and s.left_duty == 0)
        with pytest.raises(errors.DeviceRefused):
            harness.driver.set_velocity(SPEED_MPS, 0.0)
        harness.wait(standing)
        harness.driver.clear_estop()
        # A clear alone restarts nothing: first the robot is asked to stand.
        harness.drive_until(0.0, 0.0, lambda s: s.state is SupervisorState.DRIVING)
        harness.drive_until(SPEED_MPS, 0.0, turning)

    def test_the_robot_says_what_holds_it_and_what_ended_its_motion(
        self, harness: DriveHarness
    ) -> None:
        driver = harness.driver
        reported: list[HeldBy] = []
        driver.on_held = reported.append
        harness.drive_until(SPEED_MPS, 0.0, turning)
        driver.estop()
        harness.wait(lambda _: driver.held_by is None or Held.ESTOP in driver.held_by)
        held_by, last_stop = driver.health.held_by, driver.last_stop
        if held_by is None or last_stop is None:
            pytest.skip("this driver's robot does not say")
        assert held_by.estop_source is EstopSource.SESSION
        assert last_stop.cause is StopCause.ESTOP_SESSION
        assert last_stop.speed_mps > 0.0
        driver.clear_estop()
        harness.wait(lambda _: not driver.held_by)
        harness.wait(lambda _: bool(reported))
        assert Held.ESTOP in reported[0]

    def test_an_encoder_that_does_not_count_is_a_fault(
        self, bench: Bench, harness: DriveHarness
    ) -> None:
        harness.drive_until(SPEED_MPS, 0.0, turning)
        bench.block_left_encoder()
        try:
            sample = harness.drive_until(SPEED_MPS, 0.0, lambda s: s.state is SupervisorState.FAULT)
        except errors.DeviceRefused:
            # The fault was known before a sample showed it.
            sample = harness.wait(lambda s: s.state is SupervisorState.FAULT)
        assert sample.faults & Fault.LEFT_NOT_COUNTING
        assert sample.left_duty == sample.right_duty == 0
        with pytest.raises(errors.DeviceRefused, match="fault"):
            harness.driver.set_velocity(SPEED_MPS, 0.0)
        harness.driver.clear_fault()
        # Zero, because the encoder is still blocked.
        harness.driver.set_velocity(0.0, 0.0)


def commands_with(driver: Robot, value: float) -> list[Callable[[], None]]:
    """Commands that have `value` for each of their arguments in turn."""
    return [
        lambda: driver.set_velocity(value, 0.0),
        lambda: driver.set_velocity(0.0, value),
        lambda: driver.set_wheel_velocity(0.1, value),
        lambda: driver.set_duty(value, 0.0),
        lambda: driver.set_velocity(0.1, 0.0, ttl=value),
        lambda: driver.set_duty(0.1, 0.0, stamp=value),
    ]


class RefusingTests:
    """Invalid commands and parameters."""

    def test_a_value_that_is_not_finite_is_rejected(self, harness: DriveHarness) -> None:
        harness.next()  # one of the opening, whose zero setpoint may just have been obeyed
        for value in (math.nan, math.inf, -math.inf):
            for call in commands_with(harness.driver, value):
                with pytest.raises(errors.InvalidCommand):
                    call()
            assert harness.next().state is not SupervisorState.DRIVING

    def test_a_command_without_time_to_live_is_rejected(self, driver: Robot) -> None:
        for ttl in (0.0, -0.5):
            with pytest.raises(errors.InvalidCommand, match="ttl"):
                driver.set_velocity(0.1, 0.0, ttl=ttl)

    def test_a_stamp_of_another_clock_is_rejected(self, harness: DriveHarness) -> None:
        for ahead_s in (1.0, 1.7e9):
            # On a busy machine much time may pass until the calls; the stamp has to be ahead of
            # them.
            later = harness.next().stamp + TIMEOUT_S + ahead_s
            for call in (harness.driver.set_velocity, harness.driver.set_wheel_velocity):
                with pytest.raises(errors.InvalidCommand, match="monotonic"):
                    call(0.1, 0.0, stamp=later)
            with pytest.raises(errors.InvalidCommand, match="monotonic"):
                harness.driver.set_duty(0.1, 0.0, stamp=later)

    def test_a_command_older_than_its_ttl_is_not_sent(self, harness: DriveHarness) -> None:
        made = harness.next().stamp
        harness.watch(0.3)
        with pytest.raises(errors.InvalidCommand, match=r"0\.2 s: send it sooner"):
            harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=0.2, stamp=made)
        assert harness.next().state is not SupervisorState.DRIVING

    def test_a_duty_beyond_one_is_rejected(self, driver: Robot) -> None:
        with pytest.raises(errors.InvalidCommand):
            driver.set_duty(0.0, -1.01)

    def test_parameters_have_names_and_bounds(self, driver: Robot) -> None:
        parameters = driver.parameters
        with pytest.raises(errors.UnknownParameter, match="wheel_radius"):
            parameters["wheel_radios"]
        with pytest.raises(errors.ParameterOutOfRange, match="at most"):
            parameters.set("wheel_radius", 7.0)
        with pytest.raises(errors.ParameterOutOfRange, match="whole"):
            parameters.set("counts_per_revolution", 360.5)
        assert parameters.set("max_velocity_mps", 0.15) == 0.15
        assert parameters["max_velocity_mps"] == 0.15
        assert driver.geometry.max_velocity_mps == 0.15
        assert {info.name for info in parameters.list()} >= {"wheel_radius", "ttl_max_s"}

    def test_a_changed_limit_applies(self, harness: DriveHarness) -> None:
        harness.driver.parameters.set("max_velocity_mps", 0.15)
        close = pytest.approx(0.15, rel=CLOSE)
        harness.steady(0.4, 0.0, lambda samples: mean_of(samples, "left") == close)

    def test_safety_parameters_do_not_change_while_driving(self, harness: DriveHarness) -> None:
        parameters = harness.driver.parameters
        before = {name: parameters[name] for name in ("counts_per_revolution", "ttl_max_s")}
        harness.drive_until(SPEED_MPS, 0.0, lambda s: s.state is SupervisorState.DRIVING)
        for name, value in before.items():
            # Renewed for each: the requests take a part of a setpoint's life, on a busy computer
            # most of it.
            harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=before["ttl_max_s"])
            with pytest.raises(errors.DeviceRefused, match=f"{name} = .*driving.*stop"):
                parameters.set(name, value * 2)
            assert parameters[name] == value
            # Setting the active value changes nothing.
            parameters.set(name, value)
        harness.driver.stop()
        set_at_rest(harness.driver, "ttl_max_s", 0.5)
        assert parameters["ttl_max_s"] == 0.5

    def test_a_trial_is_reverted_unless_it_is_kept(self, harness: DriveHarness) -> None:
        parameters = harness.driver.parameters
        former = parameters["integral_gain"]
        with parameters.trial():
            parameters.set("integral_gain", 12.0)
            harness.drive_until(SPEED_MPS, 0.0, lambda s: s.state is SupervisorState.DRIVING)
            with pytest.raises(errors.DeviceRefused, match="on trial"):
                parameters.save()
        harness.next()  # the newest one may have been measured before the end of the trial
        assert harness.next().state is not SupervisorState.DRIVING
        assert parameters["integral_gain"] == former
        with parameters.trial() as trial:
            parameters.set("integral_gain", 12.0)
            trial.keep()
        # The device's value counts, not the value known here.
        parameters.refresh("integral_gain")
        assert parameters["integral_gain"] == 12.0

    def test_gains_may_change_while_driving(self, harness: DriveHarness) -> None:
        def change() -> WheelSample:
            harness.drive_until(SPEED_MPS, 0.0, lambda s: s.state is SupervisorState.DRIVING)
            harness.driver.parameters.set("integral_gain", 12.0)
            return harness.next()

        harness.first(change, lambda sample: sample.state is SupervisorState.DRIVING)
        assert harness.driver.parameters["integral_gain"] == 12.0

    def test_nothing_is_saved_while_driving(self, harness: DriveHarness) -> None:
        harness.drive_until(SPEED_MPS, 0.0, lambda s: s.state is SupervisorState.DRIVING)
        with pytest.raises(errors.DeviceRefused, match="driving"):
            harness.driver.parameters.save()


class LifecycleTests:
    """A driver from opening to garbage collection."""

    def test_a_lost_link_is_reported_and_recovers_by_itself(
        self, bench: Bench, harness: DriveHarness
    ) -> None:
        harness.drive_until(SPEED_MPS, 0.0, turning)
        bench.lose_link()
        while not _is_lost(harness.driver):
            bench.pass_time(POLL_S)
        with pytest.raises(errors.LinkLost):
            harness.driver.set_velocity(SPEED_MPS, 0.0)
        with pytest.raises(errors.LinkLost):
            harness.driver.stop()
        with pytest.raises(errors.LinkLost):
            harness.driver.get_encoder_ticks()
        bench.restore_link()
        assert harness.recovers()
        harness.driver.set_velocity(0.0, 0.0)  # a restarted one waits for it
        harness.drive_until(SPEED_MPS, 0.0, turning)

    def test_a_loss_and_the_return_are_told_in_order(
        self, bench: Bench, harness: DriveHarness
    ) -> None:
        told: list[str] = []
        harness.driver.on_lost = lambda _: told.append("lost")
        harness.driver.on_opened = lambda _: told.append("opened")
        bench.lose_link()
        _wait_for(bench, lambda: told == ["lost"])
        bench.restore_link()
        _wait_for(bench, lambda: told == ["lost", "opened"])
        harness.driver.stop()

    def test_a_robot_without_its_link_stops(self, bench: Bench, harness: DriveHarness) -> None:
        harness.drive_until(SPEED_MPS, 0.0, turning)
        bench.lose_link()
        _wait_for(bench, lambda: not bench.is_driven())
        bench.restore_link()

    def test_shutdown_stops_and_releases_everything_and_may_be_repeated(self, bench: Bench) -> None:
        threads, files = set(threading.enumerate()), _open_files()
        driver = bench.open()
        harness = DriveHarness(driver)
        harness.drive_until(SPEED_MPS, 0.0, turning)
        driver.shutdown()
        driver.shutdown()
        assert not set(threading.enumerate()) - threads
        assert _open_files() <= files
        calls: list[Callable[[], object]] = [
            lambda: driver.set_velocity(0.1, 0.0),
            driver.read,
            driver.stop,
            driver.get_encoder_ticks,
        ]
        for call in calls:
            with pytest.raises(errors.LinkClosed, match="closed"):
                call()
        assert not bench.is_driven()

    def test_a_driver_may_be_opened_again(self, bench: Bench) -> None:
        for _ in range(2):
            with bench.open() as driver:
                DriveHarness(driver).drive_until(SPEED_MPS, 0.0, turning)

    def test_a_garbage_collected_driver_stops_the_robot(self, bench: Bench) -> None:
        threads = set(threading.enumerate())
        driver = bench.open()
        DriveHarness(driver).drive_until(SPEED_MPS, 0.0, turning)
        # A thread of the driver that refers to it would keep it alive, and the robot driving.
        del driver
        gc.collect()
        assert not set(threading.enumerate()) - threads
        assert not bench.is_driven()


def _wait_for(bench: Bench, condition: Callable[[], bool]) -> None:
    for _ in range(round(TIMEOUT_S / POLL_S)):
        if condition():
            return
        bench.pass_time(POLL_S)
    raise AssertionError("the condition was never fulfilled")


def _is_lost(driver: Robot) -> bool:
    """Whether reading fails; samples from before the loss may still be read first."""
    try:
        driver.read(timeout=0.05)
    except errors.LinkLost:
        return True
    except errors.RequestTimeout:
        return False
    return False


def _open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


class DriverConformance(MotionTests, SamplingTests, StoppingTests, RefusingTests, LifecycleTests):
    """Derive a test class from this one and give it a fixture `bench`."""

    @pytest.fixture
    def driver(self, bench: Bench) -> Iterator[Robot]:
        """The driver under test."""
        with bench.open() as driver:
            yield driver

    @pytest.fixture
    def harness(self, driver: Robot) -> DriveHarness:
        """The driver under test in a harness."""
        return DriveHarness(driver)
