"""What every device counts, asked for with and without waiting."""

from support.waiting import wait_until
from wheelwire.drivers.mock import MockDriver


def test_control_counters_are_asked_for_with_and_without_waiting() -> None:
    with MockDriver() as driver:
        assert driver.control_counters().latest_step_us > 0
        assert driver.latest_control_counters() is None
        wait_until(lambda: driver.latest_control_counters() is not None)
    assert driver.latest_control_counters() is not None


def test_in_virtual_time_too() -> None:
    with MockDriver(realtime=False) as driver:
        assert driver.latest_control_counters() is None
        driver.advance(0.1)
        counters = driver.latest_control_counters()
        assert counters is not None
        assert counters.late_steps == 0
