"""An atheris target: any bytes through the host's decoder, whole and cut, and the firmware's."""

from __future__ import annotations

import sys

import atheris

with atheris.instrument_imports(include=["wheelwire_protocol"]):
    from support.decoders import by_firmware, by_host


def check(data: bytes) -> None:
    """The first byte says where the rest is cut."""
    cut, line = data[0] if data else 0, data[1:]
    expected = by_firmware(line)
    assert by_host([line]) == expected
    assert by_host([line[:cut], line[cut:]]) == expected


atheris.Setup(sys.argv, check)
atheris.Fuzz()
