"""The parameters of a robot on local pins: kept in a file, if there is one."""

from pathlib import Path

import pytest

from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import ConfigurationError, DeviceRefused


def test_what_was_saved_is_there_again(tmp_path: Path) -> None:
    store = tmp_path / "parameters.json"
    with MockDriver(realtime=False, store=store) as driver:
        driver.parameters["integral_gain"] = 7.5
        driver.parameters.save()
        driver.parameters["integral_gain"] = 8.0
    with MockDriver(realtime=False, store=store) as driver:
        assert driver.parameters["integral_gain"] == 7.5
        driver.parameters.reset()
        assert driver.parameters["integral_gain"] == 16.0
    assert not store.exists()


def test_without_a_file_nothing_can_be_saved() -> None:
    with MockDriver(realtime=False) as driver, pytest.raises(DeviceRefused, match="store"):
        driver.parameters.save()


def test_on_a_full_disk_nothing_is_saved_and_nothing_lost(tmp_path: Path) -> None:
    store = tmp_path / "parameters.json"
    with MockDriver(realtime=False, store=store) as driver:
        driver.parameters["integral_gain"] = 7.5
        driver.parameters.save()
        (tmp_path / "parameters.json.new").symlink_to("/dev/full")
        driver.parameters["integral_gain"] = 8.0
        with pytest.raises(DeviceRefused, match="store") as refusal:
            driver.parameters.save()
        assert "No space left" in str(refusal.value.__cause__)
    with MockDriver(realtime=False, store=store) as driver:
        assert driver.parameters["integral_gain"] == 7.5


@pytest.mark.parametrize("content", ["{", "[1]", '{"wheel_radius": 7}', '{"wheel": 1}'])
def test_a_store_of_something_else_is_told(tmp_path: Path, content: str) -> None:
    store = tmp_path / "parameters.json"
    store.write_text(content)
    with pytest.raises(ConfigurationError, match=r"parameters.json: .*mend"):
        MockDriver(realtime=False, store=store)


def test_a_change_is_in_force_at_once() -> None:
    with MockDriver(realtime=False) as driver:
        driver.parameters["right_motor_inverted"] = 1
        driver.set_duty(0.5, 0.5)
        driver.advance(0.5)
        left, right = driver.get_encoder_ticks()
        assert left > 10
        assert right < -10
