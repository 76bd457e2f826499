"""A process that forks while it uses a robot."""

import os
import signal
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from support.pty_device import PtyDevice
from support.waiting import measures, wait_until
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire_protocol.types import Stop, WheelState


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(tmp_path / "robot") as device:
        yield device


def open_files() -> set[str]:
    """What the descriptors of this process lead to."""
    files = os.listdir("/proc/self/fd")  # noqa: PTH208 - open only while it lists
    return {
        f"{file} {path.readlink()}"
        for file in files
        if (path := Path("/proc/self/fd", file)).exists() or path.is_symlink()
    }


def forked(child: Callable[[], None]) -> int:
    """Run `child` in a forked process, which then lives until it is killed; returns its id."""
    done_read, done_write = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # there are threads: that is the point
        pid = os.fork()
    if pid == 0:
        outcome = "ok"
        try:
            child()
        except BaseException:
            outcome = traceback.format_exc()
        os.write(done_write, outcome.encode())
        signal.pause()
        os._exit(0)
    os.close(done_write)
    outcome = os.read(done_read, 10_000).decode()
    os.close(done_read)
    if outcome != "ok":
        end(pid)
        raise AssertionError(outcome)
    return pid


def end(pid: int) -> None:
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)


def test_in_the_child_every_method_says_that_it_was_forked(robot: PtyDevice) -> None:
    driver = SerialDriver(str(robot.path))
    calls: list[Callable[[], object]] = [
        lambda: driver.set_velocity(0.1, 0.0),
        lambda: driver.set_duty(0.1, 0.0),
        driver.stop,
        driver.estop,
        driver.clear_estop,
        driver.clear_fault,
        driver.read,
        driver.get_encoder_ticks,
        driver.device_counters,
        lambda: driver.geometry,
        lambda: driver.parameters["wheel_radius"],
        driver.parameters.list,
    ]

    def child() -> None:
        for call in calls:
            with pytest.raises(errors.LinkClosed, match="forked"):
                call()
        assert driver.statistics.sessions == 1
        driver.shutdown()

    child_pid = forked(child)
    try:
        driver.set_velocity(0.1, 0.0)
        driver.stop()
        driver.shutdown()
    finally:
        end(child_pid)


def test_the_child_holds_no_file_of_the_link(robot: PtyDevice) -> None:
    before = open_files()
    with SerialDriver(str(robot.path)):

        def child() -> None:
            left = {name.split(" ", 1)[1] for name in open_files() - before}
            assert not {name for name in left if "pts" in name or "socket" in name}, left
            # Only the two pipes that report this.
            assert len([name for name in left if "pipe" in name]) <= 2, left

        end(forked(child))


def test_a_child_keeps_the_port_from_nobody_and_stops_nothing(robot: PtyDevice) -> None:
    driver = SerialDriver(str(robot.path))
    stops = robot.device.count(Stop)
    child_pid = forked(driver.shutdown)
    try:
        driver.read()
        assert robot.device.count(Stop) == stops
        driver.shutdown()
        with SerialDriver(str(robot.path)) as second:
            second.read()
    finally:
        end(child_pid)


def test_a_fork_in_a_signal_handler_ends_the_interrupted_call_in_the_child(
    robot: PtyDevice,
) -> None:
    children: list[int] = []
    report_read, report_write = os.pipe()

    def fork(*_: object) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            children.append(os.fork())

    with SerialDriver(str(robot.path)) as driver:
        robot.device.lost.add(WheelState)
        wait_until(lambda: not measures(driver))
        former = signal.signal(signal.SIGALRM, fork)
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        try:
            driver.read(timeout=1.0)
        except errors.LinkClosed as error:
            os.write(report_write, str(error).encode())
            os._exit(0)
        except errors.RequestTimeout:
            assert children
            assert children[0] != 0
        finally:
            signal.signal(signal.SIGALRM, former)
    os.close(report_write)
    assert "forked" in os.read(report_read, 1000).decode()
    os.close(report_read)
    assert os.waitpid(children[0], 0)[1] == 0
