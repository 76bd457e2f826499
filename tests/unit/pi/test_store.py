"""The parameters that a computer's robot keeps in a file."""

from pathlib import Path

import pytest

from support.full_disk import no_space
from support.library_robot import LibraryRobot
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import DeviceRefused
from wheelwire.pi.core import active_parameters, make_core
from wheelwire.pi.pins import Pins
from wheelwire.pi.settings import McuSettings
from wheelwire_protocol.types import ParameterSave


def settings(store: Path | None = None, **parameters: float) -> McuSettings:
    return McuSettings("l298n", Pins(), parameters, None if store is None else str(store))


def test_saved_values_are_there_again(tmp_path: Path) -> None:
    store = tmp_path / "parameters"
    with MockDriver(realtime=False, store=store) as driver:
        default = driver.parameters["integral_gain"]
        driver.parameters.set("integral_gain", 7.5)
        driver.parameters.save()
        driver.parameters.set("integral_gain", 8.0)
    with MockDriver(realtime=False, store=store) as driver:
        assert driver.parameters["integral_gain"] == 7.5
        driver.parameters.reset()
        assert driver.parameters["integral_gain"] == default


def test_the_file_precedes_the_configuration_which_a_reset_restores(tmp_path: Path) -> None:
    store = tmp_path / "parameters"
    _save_on(settings(store, integral_gain=7.5))
    configured = settings(store, integral_gain=3.0)
    assert active_parameters(configured)["integral_gain"] == 7.5
    store.unlink()
    assert active_parameters(configured)["integral_gain"] == 3.0


def test_a_computer_has_defaults_of_its_own(tmp_path: Path) -> None:
    values = active_parameters(settings(tmp_path / "none"))
    assert values["control_rate_hz"] == 100
    assert values["estop_input_enabled"] == 0


def test_without_a_file_nothing_can_be_saved() -> None:
    with pytest.raises(DeviceRefused, match="store"):
        _save_on(settings())


def test_on_a_full_disk_nothing_is_saved_and_nothing_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = tmp_path / "parameters"
    _save_on(settings(store, integral_gain=7.5))
    before = store.read_bytes()
    monkeypatch.setattr("wheelwire.whole_file.os.fsync", no_space)
    with pytest.raises(DeviceRefused, match="store"):
        _save_on(settings(store))
    assert store.read_bytes() == before
    assert list(tmp_path.iterdir()) == [store]


def _save_on(settings: McuSettings) -> None:
    LibraryRobot(make_core(settings)).open().request(ParameterSave(0, 0, 0))
