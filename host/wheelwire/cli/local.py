"""Commands that need no robot: sim, ports, demo, mcu."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from wheelwire.errors import OutputFailed
from wheelwire.files.bad_line import load_profile
from wheelwire.files.plant import load_plant
from wheelwire.link.port_list import ports as serial_ports
from wheelwire.simulation.impaired_simulator import ImpairedSimulator
from wheelwire.simulation.impairment import LineProfile
from wheelwire.simulation.simulator import find_simulator

from .output import JsonFlag, console, print_facts, print_json, print_table

DEFAULT_LINK = Path("/tmp/wheelwire")  # noqa: S108 - a name that a person can type


def sim(
    link: Annotated[Path, typer.Option(help="Path of the simulated port.")] = DEFAULT_LINK,
    faults: Annotated[
        str | None,
        typer.Option(help="Simulate a bad serial line: a built-in profile's name or a YAML file."),
    ] = None,
    plant: Annotated[
        str | None,
        typer.Option(help="Simulate these motors: a built-in plant's name or a YAML file."),
    ] = None,
    arguments: Annotated[
        list[str] | None,
        typer.Argument(help="For wheelwire-fwsim: see `wheelwire sim -- --help`."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Run a simulated robot with the firmware's real core until Ctrl-C."""
    arguments = [*_plant_settings(plant), *(arguments or [])]
    if faults is not None:
        _sim_on_a_bad_line(link, load_profile(faults), arguments, as_json=as_json)
        return
    program = str(find_simulator())
    announce = [] if as_json else ["--announce", _announcement(link)]
    # exec, not a child: any signal that ends this command then ends the simulator, which removes
    # its port.
    os.execv(program, [program, "--link", str(link), *announce, *arguments])  # noqa: S606


def _plant_settings(plant: str | None) -> list[str]:
    if plant is None:
        return []
    return [f"--set={name}={value!r}" for name, value in load_plant(plant).settings.items()]


def _announcement(port: str | Path) -> str:
    return (
        f"A simulated robot is running at {port}; Ctrl-C stops it. In another terminal:\n"
        f"    wheelwire drive {port} --linear 0.2 --seconds 2"
    )


def _sim_on_a_bad_line(
    link: Path, profile: LineProfile, arguments: list[str], *, as_json: bool
) -> None:
    # Like Ctrl-C, SIGTERM must leave the `with` block, which removes the port.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with ImpairedSimulator(profile, link=link, arguments=arguments) as simulator:
        if as_json:
            print_json({"event": "ready", "port": simulator.port})
        else:
            console.print(_announcement(simulator.port), soft_wrap=True)
        with contextlib.suppress(KeyboardInterrupt):
            simulator.wait()


def ports(as_json: JsonFlag = False) -> None:
    """List serial ports, likely robots first. Opens none of them."""
    found = serial_ports()
    if as_json:
        print_json(found)
        return
    if not found:
        console.print("no serial ports: plug the board in, or run `wheelwire sim`")
        return
    used = {True: "yes", False: "no", None: "unknown"}
    print_table(
        "Serial ports",
        ("port", "by path", "in use", "what it may be"),
        [(p.device, p.by_path or "", used[p.in_use], p.note or p.description) for p in found],
    )


def demo(
    output: Annotated[Path, typer.Option(help="Folder for the picture.")] = Path("build/demo"),
    as_json: JsonFlag = False,
) -> None:
    """Drive a simulated robot through a figure eight, then hang on purpose."""
    from wheelwire.demo import run  # here, because the display and the plot are slow to import

    report = run(output, Console(stderr=True) if as_json else console)
    if as_json:
        print_json(report)
    else:
        print_facts("Measured", report.rows())
    # Last: what was measured is shown in any case.
    if report.picture_error and find_spec("matplotlib") is not None:
        raise OutputFailed(f"the picture was not written: {report.picture_error}")


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
