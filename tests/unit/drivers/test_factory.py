import ast
import inspect
import subprocess
import sys

import pytest

import wheelwire
from wheelwire import aio
from wheelwire.drivers import factory
from wheelwire.errors import DriverUnavailable, InvalidArgument


def test_an_unknown_driver_is_told_with_those_there_are() -> None:
    with pytest.raises(DriverUnavailable, match="there are: l298n, mock, pigpio, serial"):
        wheelwire.open_driver("serail")


def test_a_driver_that_lacks_its_library_says_which(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(factory._BUILT_IN, "odd", "a_module_that_is_not_there:Driver")
    with pytest.raises(DriverUnavailable, match="a_module_that_is_not_there"):
        wheelwire.open_driver("odd")


def test_a_driver_of_another_package_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(factory, "_plug_ins", lambda: {"dict": "builtins:dict"})
    assert wheelwire.open_driver("dict", port="x") == {"port": "x"}  # type: ignore[comparison-overlap]
    assert factory.driver_names() == ["dict", "l298n", "mock", "pigpio", "serial"]


def test_every_public_name_is_there() -> None:
    for name in wheelwire.__all__:
        assert getattr(wheelwire, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'Wheel'"):
        wheelwire.Wheel  # noqa: B018


def test_importing_the_package_loads_nothing_slow() -> None:
    program = (
        "import sys; sys.path[:] = %r; import wheelwire\n"
        "from wheelwire.drivers import l298n, mock, pigpio, serial\n"
        "slow = {'construct', 'numpy', 'typer', 'rich', 'asyncio', 'matplotlib'}\n"
        "slow |= {'yaml', 'pigpio', 'gpiozero'}\n"
        "print(*(slow & set(sys.modules)))"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", program % sys.path], capture_output=True, text=True, check=True
    )
    assert loaded.stdout.split() == []


@pytest.mark.parametrize("name", sorted(factory._BUILT_IN))
def test_a_type_checker_knows_the_options_of_every_driver(name: str) -> None:
    tree = ast.parse(inspect.getsource(factory))
    overloads = [node for node in tree.body if getattr(node, "name", "") == "open_driver"]
    (options,) = [
        {argument.arg for argument in node.args.kwonlyargs}
        for node in overloads
        if isinstance(node, ast.FunctionDef) and f"Literal['{name}']" in ast.unparse(node)
    ]
    assert options == set(inspect.signature(factory.driver_class(name)).parameters)


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ("baudrate", "no option 'baudrate': did you mean 'baud_rate'?"),
        ("strem_rate_hz", "did you mean 'stream_rate_hz'?"),
        ("zzz", "its options are: port, baud_rate"),
    ],
)
def test_a_misspelt_option_is_named_with_the_one_that_is_meant(option: str, said: str) -> None:
    options: dict[str, object] = {"port": "/dev/x", option: 1}
    for open_driver in (wheelwire.open_driver, aio.open_driver):
        with pytest.raises(InvalidArgument) as error:
            open_driver("serial", **options)
        assert said in str(error.value)
