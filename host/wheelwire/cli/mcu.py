"""The command `mcu`: the firmware's core as a service on this computer."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer


def mcu(
    config: Annotated[Path, typer.Option(help="YAML file of a robot with driver l298n or pigpio.")],
    listen: Annotated[str, typer.Option(help="Where hosts connect: unix:/run/wheelwire.sock.")],
) -> None:
    """Run the firmware's core on this computer's own pins until SIGTERM or Ctrl-C."""
    from wheelwire.config import load_config, service_settings

    settings = service_settings(load_config(config), listen)
    # exec, so that the service runs without the configuration libraries in memory and receives
    # the service manager's signals itself.
    command = [sys.executable, "-m", "wheelwire.linux_mcu", settings.to_json()]
    os.execv(sys.executable, command)  # noqa: S606
