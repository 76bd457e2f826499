import inspect
import re
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any

import pytest

import wheelwire
from support.cases import each
from wheelwire import aio
from wheelwire.errors import DriverUnavailable, InvalidArgument, UnknownParameter

opening = import_module("wheelwire.connect")
"""The module, beside the function that `wheelwire` has of that name."""


@each("open_driver", [wheelwire.open_driver, aio.open_driver], ids=lambda one: one.__module__)
def test_options_are_checked_before_anything_is_opened(open_driver: Callable[..., object]) -> None:
    with pytest.raises(DriverUnavailable, match="there are: l298n, mock, pigpio, replay, serial"):
        open_driver("serail")
    with pytest.raises(InvalidArgument, match="'port'"):
        open_driver("serial", baud_rate=3)
    with pytest.raises(InvalidArgument, match="baud_rate = -3"):
        open_driver("serial", "/dev/x", baud_rate=-3)
    with pytest.raises(InvalidArgument, match="too many positional"):
        open_driver("mock", True)
    with pytest.raises(UnknownParameter):
        open_driver("mock", parameters={"wheel_radios": 1})
    for option, said in (
        ("baudrate", "no option 'baudrate': did you mean 'baud_rate'?"),
        ("strem_rate_hz", "did you mean 'stream_rate_hz'?"),
        ("zzz", "its options are: port, baud_rate"),
    ):
        with pytest.raises(InvalidArgument, match=re.escape(said)):
            open_driver("serial", port="/dev/x", **{option: 1})


def test_a_driver_that_lacks_its_library_says_which(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(opening._BUILT_IN, "odd", "a_module_that_is_not_there:Driver")
    with pytest.raises(DriverUnavailable, match="a_module_that_is_not_there"):
        wheelwire.open_driver("odd")


def test_a_driver_of_another_package_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "_plug_ins", lambda: {"dict": "builtins:dict"})
    options: dict[str, Any] = {"port": "x"}
    assert wheelwire.open_driver("dict", **options) == options  # type: ignore[comparison-overlap]
    assert opening.driver_names() == ["dict", "l298n", "mock", "pigpio", "replay", "serial"]


def test_every_public_name_is_there() -> None:
    for name in wheelwire.__all__:
        assert getattr(wheelwire, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'Wheel'"):
        wheelwire.Wheel  # noqa: B018


SLOW = {"construct", "crcmod", "numpy", "typer", "rich", "asyncio", "matplotlib"}
SLOW |= {"yaml", "pigpio", "gpiozero"}
OPENED = """
with wheelwire.open_driver("mock", parameters={"wheel_radius": 0.04}) as robot:
    robot.parameters.set("wheel_radius", 0.05)
    robot.board.read()
    robot.set_velocity(0.1, 0.0)
    robot.read()
    next(robot.samples())
    robot.stop()
"""


@pytest.mark.parametrize(
    "code", ["from wheelwire.drivers import l298n, mock, pigpio, replay, serial", OPENED]
)
def test_importing_the_package_and_driving_load_nothing_slow(code: str) -> None:
    assert not SLOW & loaded_by(code)


def test_who_hears_nothing_loads_no_logging() -> None:
    assert "logging" not in loaded_by(
        "from wheelwire.drivers import serial\nimport wheelwire.link.sharing"
    )


def loaded_by(code: str) -> set[str]:
    """The modules that are loaded after it."""
    program = f"import sys; sys.path[:] = {sys.path}; import wheelwire\n{code}\nprint(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    return set(loaded.stdout.split())


@pytest.mark.parametrize("module", [opening, aio])
@pytest.mark.parametrize("name", sorted(opening._BUILT_IN))
def test_a_type_checker_knows_the_options_of_every_driver(name: str, module: ModuleType) -> None:
    source = inspect.getsource(module)
    found = re.search(rf"@arguments_of\((\w+)Arguments\)\n +def open_driver.*\"{name}\"", source)
    assert found
    assert f"{found[1]}Driver" == opening.driver_class(name).__name__
