"""Fake USB serial ports for a command in a separate process."""

from __future__ import annotations

from pathlib import Path

CP210X = (0x10C4, 0xEA60)


def fake_usb_ports(folder: Path, *devices: str) -> dict[str, str]:
    """An environment in which pyserial finds only these ports, all behind a CP210x."""
    vendor, product = CP210X
    (folder / "sitecustomize.py").write_text(
        "from types import SimpleNamespace\n"
        "from serial.tools import list_ports\n"
        "def port(name):\n"
        "    return SimpleNamespace(\n"
        f"        device=name, vid={vendor}, pid={product}, description='', serial_number='0001'\n"
        "    )\n"
        f"list_ports.comports = lambda: [port(name) for name in {list(devices)!r}]\n"
    )
    return {"PYTHONPATH": str(folder)}
