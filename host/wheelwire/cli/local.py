"""Commands that need no robot: ports, demo, mcu."""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from pathlib import Path

from wheelwire.errors import OutputFailed
from wheelwire.link.ports import ports as serial_ports

from .output import console, print_facts, print_table, printed_json, screen
from .registry import Heading, command

PLUG_IN = (
    "plug the board in with a data cable (many cables only charge), or run `wheelwire sim` for a "
    "simulated robot"
)


@command("ports", Heading.BUILD, 2, page="troubleshooting/port")
def ports() -> None:
    """List serial ports, likely robots first. Opens none of them."""
    found = serial_ports()
    if printed_json(found):
        return
    if not found:
        console.print(f"no serial ports: {PLUG_IN}")
        return
    used = {True: "yes", False: "no", None: "unknown"}
    print_table(
        "Serial ports",
        ("port", "by path", "in use", "what it may be"),
        [(p.device, p.by_path or "", used[p.in_use], p.note or p.description) for p in found],
    )
    if all(port.vendor_id is None for port in found):
        console.print(f"No USB adapter is plugged in, so no board is among these: {PLUG_IN}")


@command("demo", Heading.WITHOUT_ROBOT, 1, page="simulator")
def demo(output: Path = Path("build/demo")) -> None:
    """Drive a simulated robot through a figure eight, then hang on purpose.

    Args:
        output: Folder for the picture.
    """
    from wheelwire.tools.demo import (
        run,  # here, because the display and the plot are slow to import
    )

    report = run(output, screen())
    if not printed_json(report):
        print_facts("Measured", report.rows())
        console.print(
            "Next: `wheelwire start` leads to the first drive of your robot; without one, "
            "`wheelwire setup --simulated` sets up a simulated one"
        )
    # Last: what was measured is shown in any case.
    if report.picture_error and find_spec("matplotlib") is not None:
        raise OutputFailed(f"the picture was not written: {report.picture_error}")


@command("mcu", Heading.WITHOUT_ROBOT, 3, page="pi-pins/a-service-of-its-own", has_json=False)
def mcu(config: Path, listen: str) -> None:
    """Run the firmware's core on this computer's own pins until SIGTERM or Ctrl-C.

    Args:
        config: YAML file of a robot with driver l298n or pigpio.
        listen: Where hosts connect: unix:/run/wheelwire.sock.
    """
    from wheelwire.tools.files.robot import load_config, service_settings

    settings = service_settings(load_config(config), listen)
    # exec, so that the service runs without the configuration libraries in memory and receives
    # the service manager's signals itself.
    command = [sys.executable, "-m", "wheelwire.pi", settings.to_json()]
    os.execv(sys.executable, command)  # noqa: S606
