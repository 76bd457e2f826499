"""A process that forks while it uses a robot."""

from collections.abc import Callable

import pytest

from support.forking import descriptors, forked
from support.pty_device import PtyDevice
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire_protocol.types import Stop


def test_in_the_child_every_method_says_that_it_was_forked(device: PtyDevice) -> None:
    driver = SerialDriver(str(device.path))
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

    with forked(child):
        driver.set_velocity(0.1, 0.0)
        driver.stop()
        driver.shutdown()


def test_the_child_holds_no_file_of_the_link(device: PtyDevice) -> None:
    before = descriptors()
    with SerialDriver(str(device.path)):

        def child() -> None:
            left = {name for number, name in descriptors().items() if before.get(number) != name}
            assert not {name for name in left if "pts" in name or "socket" in name}, left
            # Only the two pipes that report this.
            assert len([name for name in left if "pipe" in name]) <= 2, left

        with forked(child):
            pass


def test_a_child_keeps_the_port_from_nobody_and_stops_nothing(device: PtyDevice) -> None:
    driver = SerialDriver(str(device.path))
    stops = device.device.count(Stop)
    with forked(driver.shutdown):
        driver.read()
        assert device.device.count(Stop) == stops
        driver.shutdown()
        with SerialDriver(str(device.path)) as second:
            second.read()
