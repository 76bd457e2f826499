"""Loss of the link, and the end of a driver, which must leave nothing behind."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from .. import errors
from ..drivers.base import BaseDriver
from .bench import Bench
from .harness import SPEED_MPS, TIMEOUT_S, DriveHarness, turning

POLL_S = 0.01


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
        for _ in range(round(TIMEOUT_S / POLL_S)):
            bench.pass_time(POLL_S)
            if not bench.is_driven():
                break
        assert not bench.is_driven()
        bench.restore_link()

    def test_shutdown_stops_and_releases_everything_and_may_be_repeated(self, bench: Bench) -> None:
        threads, files = _threads(), _open_files()
        driver = bench.open()
        harness = DriveHarness(driver)
        harness.drive_until(SPEED_MPS, 0.0, turning)
        driver.shutdown()
        driver.shutdown()
        assert not _threads() - threads
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
        threads = _threads()
        driver = bench.open()
        DriveHarness(driver).drive_until(SPEED_MPS, 0.0, turning)
        # A thread of the driver that refers to it would keep it alive, and the robot driving.
        del driver
        gc.collect()
        assert not _threads() - threads
        assert not bench.is_driven()


def _wait_for(bench: Bench, condition: Callable[[], bool]) -> None:
    for _ in range(round(TIMEOUT_S / POLL_S)):
        if condition():
            return
        bench.pass_time(POLL_S)
    raise AssertionError("the condition was never fulfilled")


def _is_lost(driver: BaseDriver) -> bool:
    """Whether reading fails; samples from before the loss may still be read first."""
    try:
        driver.read(timeout=0.05)
    except errors.LinkLost:
        return True
    except errors.RequestTimeout:
        return False
    return False


def _threads() -> set[threading.Thread]:
    return set(threading.enumerate())


def _open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))
