"""Invalid commands and parameters, which a driver must reject with an error."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from wheelwire_protocol.codes import SupervisorState

from .. import errors
from ..drivers.base import BaseDriver
from ..samples import WheelSample
from .harness import CLOSE, SPEED_MPS, TIMEOUT_S, DriveHarness, mean_of


def commands_with(driver: BaseDriver, value: float) -> list[Callable[[], None]]:
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

    @pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
    def test_a_value_that_is_not_finite_is_rejected(
        self, harness: DriveHarness, value: float
    ) -> None:
        for call in commands_with(harness.driver, value):
            with pytest.raises(errors.InvalidCommand):
                call()
        assert harness.next().state is not SupervisorState.DRIVING

    @pytest.mark.parametrize("ttl", [0.0, -0.5])
    def test_a_command_without_time_to_live_is_rejected(
        self, driver: BaseDriver, ttl: float
    ) -> None:
        with pytest.raises(errors.InvalidCommand, match="ttl"):
            driver.set_velocity(0.1, 0.0, ttl=ttl)

    @pytest.mark.parametrize("ahead_s", [1.0, 1.7e9])
    def test_a_stamp_of_another_clock_is_rejected(
        self, harness: DriveHarness, ahead_s: float
    ) -> None:
        # On a busy machine much time may pass until the calls; the stamp has to be ahead of them.
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

    def test_a_duty_beyond_one_is_rejected(self, driver: BaseDriver) -> None:
        with pytest.raises(errors.InvalidCommand):
            driver.set_duty(0.0, -1.01)

    def test_parameters_have_names_and_bounds(self, driver: BaseDriver) -> None:
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
            # Renewed for each: the requests take a part of a setpoint's life.
            harness.driver.set_velocity(SPEED_MPS, 0.0)
            with pytest.raises(errors.DeviceRefused, match=f"{name} = .*driving.*stop"):
                parameters.set(name, value * 2)
            assert parameters[name] == value
            # Setting the active value is no change.
            parameters.set(name, value)
        harness.driver.stop()
        parameters.set("ttl_max_s", 0.5)
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
        # What counts is the device's value, not the one that is known here.
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
