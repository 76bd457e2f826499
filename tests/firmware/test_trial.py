"""Trials of parameters in virtual time: without `keep` the previous values come back."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from support.virtual import VirtualRobot
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import DeviceRefused, InvalidArgument, LinkLost
from wheelwire.simulation.libfwsim import FwSim
from wheelwire_protocol.codes import RefusalCode, TrialAction
from wheelwire_protocol.types import ParameterTrial

GAIN, SWAPPED = "proportional_gain", "motors_swapped"
FORMER = {GAIN: 2.5, SWAPPED: 0.0}
TRIED = {GAIN: 4.0, SWAPPED: 1.0}
TIMEOUT_S = 0.5


# --- what the device does when its host does nothing more ----------------------------------------


@pytest.fixture
def robot() -> VirtualRobot:
    """A robot that drives with values on trial; what is not on trial was not saved."""
    robot = VirtualRobot(wheels_free=1).open()
    for name, value in FORMER.items():
        robot.set_parameter(name, value)
    robot.request(ParameterTrial(0, 0, TrialAction.BEGIN, TIMEOUT_S))
    for name, value in TRIED.items():
        robot.set_parameter(name, value)
    robot.drive(0.2, 0.2, 0.3)
    return robot


def held(robot: VirtualRobot) -> dict[str, float]:
    return {name: robot.parameter(name) for name in FORMER}


def duties(sim: FwSim) -> tuple[float, float]:
    return sim.get("left.duty"), sim.get("right.duty")


def silence(robot: VirtualRobot, seconds: float) -> None:
    """The host is gone, as after a kill -9: nothing is sent any more."""
    robot.sim.advance_us(round(seconds * 1e6))
    robot.now_us += round(seconds * 1e6)


def test_a_session_renews_the_trial_and_stops_when_it_is_over(robot: VirtualRobot) -> None:
    robot.run(10 * TIMEOUT_S)
    assert held(robot) == TRIED
    robot.request(ParameterTrial(0, 0, TrialAction.KEEP, 0.0))
    robot.run(3 * TIMEOUT_S)
    assert held(robot) == TRIED
    assert robot.session.count == 1
    assert robot.session.statistics(robot.now_us).refused == 0


def test_a_host_that_slept_hears_that_its_trial_is_over(robot: VirtualRobot) -> None:
    silence(robot, 2 * TIMEOUT_S)
    robot.run_until(lambda: robot.session.count == 2)
    robot.run(0.1)
    with pytest.raises(DeviceRefused) as refused:
        robot.set_velocity(0.1, 0.1)
    assert refused.value.code == RefusalCode.NO_TRIAL
    with pytest.raises(DeviceRefused):
        robot.set_parameter(GAIN, 3.0)
    robot.session.release_trial()
    assert held(robot) == FORMER
    robot.drive(0.1, 0.1, 0.2)
    assert all(duties(robot.sim))


def lose_output(robot: VirtualRobot, seconds: float) -> None:
    """What the host sends for so long is lost; what the device sends arrives."""
    end_us = robot.now_us + round(seconds * 1e6)
    while robot.now_us < end_us:
        robot.session.advance(robot.now_us)
        robot.session.take_output()
        robot.step()


def test_a_setpoint_that_was_lost_is_not_repeated_after_a_revert(robot: VirtualRobot) -> None:
    robot.stop()
    robot.set_velocity(0.2, 0.2)
    robot.session.take_output()  # lost; its repeat would come in 20 ms
    robot.request(ParameterTrial(0, 0, TrialAction.REVERT, 0.0))
    robot.run(0.1)
    assert robot.session.statistics(robot.now_us).setpoints_repeated == 0
    assert duties(robot.sim) == (0.0, 0.0)


def test_no_renewal_follows_a_request_to_keep_that_has_to_be_repeated(robot: VirtualRobot) -> None:
    results: list[object] = []
    keep = ParameterTrial(0, 0, TrialAction.KEEP, 0.0)
    robot.session.request(keep, results.append, robot.now_us)
    lose_output(robot, TIMEOUT_S / 2)  # a renewal would have been due
    robot.run_until(lambda: bool(results))
    robot.run(2 * TIMEOUT_S)
    assert robot.session.count == 1
    assert held(robot) == TRIED


def test_an_expiry_is_heard_of_without_a_renewal(robot: VirtualRobot) -> None:
    robot.session.release_trial()  # the link no longer renews it
    robot.run(TIMEOUT_S + 0.1)
    assert robot.session.count == 2  # so all that was known is void
    robot.drive(0.1, 0.1, 0.2)
    assert all(duties(robot.sim))
    assert held(robot) == FORMER


# --- as an application uses it -------------------------------------------------------------------


@pytest.fixture
def mock() -> Iterator[MockDriver]:
    with MockDriver(realtime=False, parameters=FORMER) as robot:
        yield robot


def values(robot: MockDriver) -> dict[str, float]:
    """As known, and as the device has them."""
    known = {name: robot.parameters[name] for name in FORMER}
    robot.parameters.refresh()
    assert known == {name: robot.parameters[name] for name in FORMER}
    return known


def try_values(robot: MockDriver) -> None:
    for name, value in TRIED.items():
        robot.parameters.set(name, value)


def test_leaving_the_block_reverts_and_stops(mock: MockDriver) -> None:
    with mock.parameters.trial():
        try_values(mock)
        assert values(mock) == TRIED
        mock.set_duty(0.3, 0.3, ttl=1.0)
        mock.advance(0.1)
        assert mock.simulator.get("left.duty") > 0
    assert mock.simulator.get("left.duty") == 0
    assert values(mock) == FORMER
    mock.parameters.save()  # nothing of the trial is left
    mock.set_duty(0.3, 0.3, ttl=0.1)


def test_dimensions_on_trial_are_those_of_the_setpoints(mock: MockDriver) -> None:
    before = mock.geometry
    with mock.parameters.trial():
        mock.parameters.set("wheel_separation", 0.3)
        assert mock.geometry != before
    assert mock.geometry == before


def test_a_trial_whose_end_is_interrupted_is_reverted(
    mock: MockDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(_message: object) -> None:
        raise KeyboardInterrupt

    def fail() -> None:
        with mock.parameters.trial(timeout=60.0):
            try_values(mock)
            monkeypatch.setattr(mock._link, "request", interrupt)

    with pytest.raises(KeyboardInterrupt):
        fail()
    monkeypatch.undo()
    mock.advance(0.1)  # far less than the trial's time-out
    assert values(mock) == FORMER


def test_virtual_time_passes_in_a_trial_by_reading(mock: MockDriver) -> None:
    with mock.parameters.trial(timeout=0.2) as trial:
        try_values(mock)
        for _ in range(200):
            mock.set_duty(0.2, 0.2, ttl=0.1)
            mock.read()
        trial.keep()
    assert values(mock) == TRIED


def pull_the_cable(mock: MockDriver) -> None:
    with mock.parameters.trial():
        try_values(mock)
        mock.set_duty(0.3, 0.3, ttl=1.0)
        mock.unplug()
        mock.advance(2.1)
        assert mock.simulator.get("left.duty") == 0
        mock.plug()
        mock.advance(0.2)
        for act in (
            lambda: mock.set_duty(0.1, 0.1, ttl=0.1),
            lambda: mock.parameters.set(GAIN, 3.0),
            lambda: mock.parameters.save(),
            lambda: mock.parameters.reset(),
        ):
            with pytest.raises(DeviceRefused, match="trial of parameters is over"):
                act()
        mock.stop()


def test_after_a_pulled_cable_nothing_goes_on_with_the_previous_values(mock: MockDriver) -> None:
    pull_the_cable(mock)
    assert values(mock) == FORMER
    mock.set_duty(0.3, 0.3, ttl=0.1)
    assert mock.parameters.set(GAIN, 3.0) == 3.0


def keep_too_late(mock: MockDriver) -> None:
    with mock.parameters.trial(timeout=0.2) as trial:
        try_values(mock)
        mock.unplug()
        mock.plug()  # a new session
        mock.advance(0.2)
        trial.keep()


def test_a_lost_trial_is_not_kept(mock: MockDriver) -> None:
    with pytest.raises(DeviceRefused) as refused:
        keep_too_late(mock)
    assert refused.value.code == RefusalCode.NO_TRIAL
    assert values(mock) == FORMER


def leave_without_a_cable(mock: MockDriver) -> None:
    with mock.parameters.trial():
        try_values(mock)
        mock.unplug()


def test_leaving_without_a_cable_raises_and_the_device_reverts(mock: MockDriver) -> None:
    with pytest.raises(LinkLost):
        leave_without_a_cable(mock)
    mock.advance(2.1)
    mock.plug()
    mock.advance(0.2)
    assert values(mock) == FORMER
    mock.set_duty(0.3, 0.3, ttl=0.1)


def test_a_trial_in_a_trial_is_refused_and_harms_nothing(mock: MockDriver) -> None:
    with mock.parameters.trial() as trial:
        try_values(mock)
        with pytest.raises(DeviceRefused) as refused, mock.parameters.trial():
            pytest.fail("a second trial has begun")
        assert refused.value.code == RefusalCode.ON_TRIAL
        mock.advance(5.0)
        trial.keep()
    assert values(mock) == TRIED


@pytest.mark.parametrize("timeout_s", [0.1, 61, float("nan"), "2", None])
def test_a_time_out_beyond_the_bounds_is_refused(mock: MockDriver, timeout_s: float) -> None:
    with pytest.raises(InvalidArgument, match="timeout = "):
        mock.parameters.trial(timeout_s)
