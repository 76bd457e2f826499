"""Whatever becomes of the host, the drive is removed by the deadline plus one control period.

Read from the plant, in the device's clock. The hosts are processes of their own, at a bad line; in
virtual time `tests/firmware/test_stop_times.py` has more failures.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator

import pytest

from support.simulator_on_line import simulator_on
from support.stop_host import (
    FAILURES,
    TIMEOUT_S,
    TRUTH_HZ,
    at_speed,
    host,
    stop,
    stopped,
    wait,
)
from support.stop_times import PERIOD_US, TTL_S
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.codes import SupervisorState

ON_ITS_WAY_S = 0.5
"""On a busy computer, between the failure and the line's own knowledge of it."""


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with simulator_on("noisy", truth_hz=TRUTH_HZ) as simulator:
        yield simulator


@pytest.mark.parametrize(
    ("name", "watched"),
    [
        ("host killed", True),
        ("host frozen", True),
        ("cable pulled", False),
        ("pings, no commands", False),
        ("host of a wrong schema", False),
    ],
)
def test_a_host_or_a_cable_that_fails(simulator: Simulator, name: str, *, watched: bool) -> None:
    """Also of a host that is recorded, beside a program that is attached."""
    with host(simulator, watched=watched) as process:
        stopping = stop(simulator, process, FAILURES[name])
        assert stopping.time.late_us is not None
        assert 0 <= stopping.time.late_us <= PERIOD_US
        # Frames in flight arrive; after that nothing may extend the deadline.
        latest_us = stopping.at_failure.device_us + (TTL_S + ON_ITS_WAY_S) * 1e6
        assert stopping.end.deadline_us <= latest_us
        if name == "pings, no commands":
            assert process.poll() is None


def test_interrupted_host_stops_before_the_deadline(simulator: Simulator) -> None:
    with host(simulator) as process:
        wait(simulator, at_speed)
        process.send_signal(signal.SIGINT)
        end = wait(simulator, stopped)
        assert end.drive_removed_us < end.deadline_us
        process.wait(TIMEOUT_S)


def test_a_reset_coasts_and_a_program_that_went_on_drives_nothing(
    simulator: Simulator,
) -> None:
    with host(simulator) as process:
        wait(simulator, at_speed)
        boot_id = simulator.reset()
        reset = wait(simulator, lambda state: state.boot_id == boot_id)
        assert not reset.drive_on
        assert reset.state is SupervisorState.BOOT
        # It goes on commanding in the session that the link opens by itself, and is refused.
        assert process.wait(TIMEOUT_S) != 0
        states = [state for state in simulator.take_states() if state.boot_id == boot_id]
        assert states
        assert not any(state.drive_on for state in states)
