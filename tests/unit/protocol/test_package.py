import subprocess
import sys
from importlib.resources import files

import pytest

import wheelwire_protocol
from support.cases import each


@each("name", wheelwire_protocol.__all__)
def test_public_name(name: str) -> None:
    assert getattr(wheelwire_protocol, name) is not None
    assert name in vars(wheelwire_protocol), "asked for once"


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        getattr(wheelwire_protocol, "no_such_name")  # noqa: B009  # mypy knows that it is not there


def test_a_decoder_needs_no_numpy_crcmod_or_construct() -> None:
    code = "import sys, wheelwire_protocol; wheelwire_protocol.Decoder().feed(b'')"
    command = [sys.executable, "-c", f"{code}; print(*sys.modules)"]
    result = subprocess.run(command, capture_output=True, check=True, text=True)
    loaded = set(result.stdout.split())
    assert "wheelwire_protocol.framing" in loaded
    assert not {"numpy", "crcmod", "construct", "wheelwire_protocol.bulk"} & loaded


@pytest.mark.parametrize("package", ["wheelwire", "wheelwire_protocol"])
def test_the_package_is_marked_as_typed(package: str) -> None:
    assert (files(package) / "py.typed").is_file()
