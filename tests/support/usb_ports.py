"""Fake USB serial ports, for a command in this process and for one in a process of its own."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from serial.tools import list_ports

CP210X = (0x10C4, 0xEA60)


def plug_in(monkeypatch: pytest.MonkeyPatch, *devices: str) -> None:
    """In this process pyserial finds only these ports, all behind a CP210x."""
    vendor, product = CP210X
    ports = [
        SimpleNamespace(device=name, vid=vendor, pid=product, description="", serial_number="0001")
        for name in devices
    ]
    monkeypatch.setattr(list_ports, "comports", lambda: ports)


def environment_with_ports(folder: Path, *devices: str) -> dict[str, str]:
    """An environment in which a process of its own finds only these ports."""
    (folder / "sitecustomize.py").write_text(
        "from types import SimpleNamespace\n"
        "from serial.tools import list_ports\n"
        "def port(name):\n"
        "    return SimpleNamespace(device=name, description='', serial_number='0001',\n"
        f"                           vid={CP210X[0]}, pid={CP210X[1]})\n"
        f"list_ports.comports = lambda: [port(name) for name in {list(devices)!r}]\n"
    )
    return {"PYTHONPATH": str(folder)}
