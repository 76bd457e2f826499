"""Whatever becomes of the host, the drive is removed by the deadline plus one control period.

Read from the plant, in the device's clock. The hosts are processes of their own.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from support.processes import interruptible
from wheelwire.sim import Simulator, TrueState
from wheelwire_protocol.codes import SupervisorState

TTL_S = 0.3
PERIOD_US = 1000
PATIENCE_S = 30.0

COMMANDING = """
import signal, sys, time, wheelwire
signal.signal(signal.SIGUSR1, lambda *_: time.sleep(3600))
with wheelwire.open_driver("serial", port=sys.argv[1]) as robot:
    while True:
        robot.set_velocity(0.25, 0.0, ttl={ttl})
        time.sleep(0.02)
"""
HANG = signal.SIGUSR1
"""Makes its main thread sleep; the link's thread goes on, and pings."""


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator(truth_hz=200) as simulator:
        yield simulator


@contextmanager
def host(simulator: Simulator) -> Iterator[subprocess.Popen[bytes]]:
    """A process that drives the simulated robot; killed at the end."""
    code = COMMANDING.format(ttl=TTL_S)
    command = [sys.executable, "-c", code, simulator.port]
    process = subprocess.Popen(command, preexec_fn=interruptible)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def wait(simulator: Simulator, condition: Callable[[TrueState], bool]) -> TrueState:
    """The first true state from now on that fulfils `condition`."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        for state in simulator.take_states():
            if condition(state):
                return state
        time.sleep(0.005)
    raise AssertionError("the condition never held")


def at_speed(state: TrueState) -> bool:
    return state.left_mps > 0.2


def stopped(state: TrueState) -> bool:
    return not state.drive_on and state.stands_still


def check_stop(simulator: Simulator, blow: Callable[[], object]) -> TrueState:
    """Wait for speed, strike, and check when the drive was removed."""
    wait(simulator, at_speed)
    blow()
    struck = wait(simulator, lambda _: True)
    end = wait(simulator, stopped)
    late_us = end.drive_removed_us - end.deadline_us
    assert 0 <= late_us <= PERIOD_US
    assert end.deadline_us <= struck.device_us + (TTL_S + 0.05) * 1e6
    return end


def test_host_killed(simulator: Simulator) -> None:
    with host(simulator) as process:
        check_stop(simulator, lambda: process.send_signal(signal.SIGKILL))


def test_host_frozen(simulator: Simulator) -> None:
    with host(simulator) as process:
        check_stop(simulator, lambda: process.send_signal(signal.SIGSTOP))


def test_cable_pulled(simulator: Simulator) -> None:
    with host(simulator):
        check_stop(simulator, simulator.unplug)


def test_application_hangs_while_the_link_goes_on(simulator: Simulator) -> None:
    with host(simulator) as process:
        check_stop(simulator, lambda: process.send_signal(HANG))
        assert process.poll() is None


def test_interrupted_host_stops_before_the_deadline(simulator: Simulator) -> None:
    with host(simulator) as process:
        wait(simulator, at_speed)
        process.send_signal(signal.SIGINT)
        end = wait(simulator, stopped)
        assert end.drive_removed_us < end.deadline_us
        process.wait(PATIENCE_S)


def test_device_reset_coasts_until_a_setpoint_of_a_new_session(simulator: Simulator) -> None:
    with host(simulator):
        wait(simulator, at_speed)
        boot_id = simulator.reset()
        reset = wait(simulator, lambda state: state.boot_id == boot_id)
        assert not reset.drive_on
        assert reset.state is SupervisorState.BOOT
        # The application lives and goes on commanding: the link recovers by itself.
        wait(simulator, lambda state: state.boot_id == boot_id and at_speed(state))
