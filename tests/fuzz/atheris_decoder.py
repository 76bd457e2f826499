"""An atheris target: any bytes through Python's decoder and the firmware's, whole and cut."""

from __future__ import annotations

import sys

import atheris

with atheris.instrument_imports(include=["wheelwire_protocol"]):
    from support.decoders import by_firmware, by_python


def check(data: bytes) -> None:
    """The first byte says where the rest is cut."""
    cut, line = data[0] if data else 0, data[1:]
    pieces = [line[:cut], line[cut:]]
    expected = by_python([line])
    assert by_python(pieces) == expected
    assert by_firmware([line]) == expected
    assert by_firmware(pieces) == expected


atheris.Setup(sys.argv, check)
atheris.Fuzz()
