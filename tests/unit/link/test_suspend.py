"""A computer that slept: its monotonic clock stood still, while the device's went on."""

import time

import pytest

from support.pty_device import PtyDevice
from support.waiting import wait_until
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link import clock
from wheelwire.link.clock import SuspendWatch, host_clock_us

SLEEP_US = 6_000_000


def test_a_step_between_the_clocks_is_reported_once() -> None:
    asleep_us = 1000
    watch = SuspendWatch(lambda: 1000 * (host_clock_us() + asleep_us))
    assert not watch.was_suspended(host_clock_us())
    asleep_us += SLEEP_US
    assert watch.was_suspended(host_clock_us())
    assert not watch.was_suspended(host_clock_us())


def test_a_pause_between_two_readings_does_not_count_as_a_sleep() -> None:
    pause_s = 0.0

    def slow_clock() -> int:
        before_us = host_clock_us()
        time.sleep(pause_s)
        return 1000 * before_us

    def late_clock() -> int:
        time.sleep(pause_s)
        return 1000 * host_clock_us()

    for boot_clock in (slow_clock, late_clock):
        watch = SuspendWatch(boot_clock)
        pause_s = 0.05
        assert not watch.was_suspended(host_clock_us())
        pause_s = 0.0
        assert not watch.was_suspended(host_clock_us())


def test_without_such_a_clock_nothing_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clock, "BOOT_CLOCK_NS", None)
    assert not SuspendWatch().was_suspended(host_clock_us())


def test_after_a_sleep_a_new_session_knows_the_devices_clock(
    device: PtyDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    asleep_us = 0
    monkeypatch.setattr(clock, "BOOT_CLOCK_NS", lambda: 1000 * (host_clock_us() + asleep_us))
    with SerialDriver(str(device.path)) as driver:
        driver.read()
        # As the host sees it: the device's clock leaps ahead by what the host slept.
        device.device.clock_offset_us += SLEEP_US
        asleep_us += SLEEP_US
        slept_s = time.monotonic()
        wait_until(lambda: driver.sessions == 2)
        sample = driver.read(timeout=5.0)
        while sample.stamp < slept_s - 1.0:
            sample = driver.read(timeout=5.0)
        assert abs(time.monotonic() - sample.stamp) < 1.0
        driver.set_velocity(0.1, 0.0)
        wait_until(lambda: bool(device.device.obeyed))
