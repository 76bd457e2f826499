"""`wheelwire sim`: a simulated robot, what its wheels do in sentences, and turns by hand."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from types import FrameType
from typing import Annotated, Any

import typer
import typer.core

from wheelwire.errors import InvalidArgument, SimulatorNotFound, WheelwireError, with_point
from wheelwire.simulation.impaired_simulator import ImpairedSimulator
from wheelwire.simulation.narration import SIDES, Narrator
from wheelwire.simulation.remote import RemoteConsole, RemoteSimulator, running_simulators
from wheelwire.simulation.simulator import Simulator, TrueState, find_simulator
from wheelwire.tools.files.bad_line import load_profile
from wheelwire.tools.files.plant import load_plant

from .output import JsonFlag, print_lines, print_note, print_result, printed_json
from .registry import Commands, Heading, command

DEFAULT_LINK = Path("/tmp/wheelwire")  # noqa: S108 - a name that a person can type
TRUTH_HZ = 20.0
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_BARE = "wheelwire.sim.bare"
"""Key of the arguments behind `--`, in Click's context."""
_PATIENCE_S = 1.5
"""How long a hand pushes a wheel that does not give way."""
_LOOK_S = 0.1
_MOST_TURNS = 1000.0


class _SimGroup(typer.core.TyperGroup):
    """A group whose arguments behind `--` are for `wheelwire-fwsim`, and no subcommand."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Remove the arguments behind `--` first, unless a subcommand stands before them."""
        if "--" in args:
            split = args.index("--")
            if not self.make_parser(ctx).parse_args(args=args[:split])[1]:
                ctx.meta[_BARE] = args[split + 1 :]
                args = args[:split]
        return super().parse_args(ctx, args)


app = Commands(cls=_SimGroup)
command("sim", Heading.WITHOUT_ROBOT, 2, page="simulator")(app)


@app.callback(invoke_without_command=True)
def sim(
    context: typer.Context,
    link: Annotated[Path, typer.Option(help="Path of the simulated port.")] = DEFAULT_LINK,
    faults: Annotated[
        str | None,
        typer.Option(help="Simulate a bad serial line: a built-in profile's name or a YAML file."),
    ] = None,
    plant: Annotated[
        str | None,
        typer.Option(help="Simulate these motors: a built-in plant's name or a YAML file."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="A variable of docs/simulator.md."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Run a simulated robot with the firmware's real core until Ctrl-C.

    It prints what a person beside the robot would see, for setup's questions. Type commands such as
    `set left.blocked 1`. With --json, or arguments for wheelwire-fwsim behind `--` (`wheelwire sim
    -- --help`), it prints none of this.
    """
    if context.invoked_subcommand is not None:
        return
    values = dict(load_plant(plant).settings) if plant is not None else {}
    values.update(map(setting, settings or ()))
    bare = context.meta.get(_BARE)
    if bare is None and not as_json:
        _run_told(link, faults, values)
        return
    arguments = [*(f"--set={name}={value!r}" for name, value in values.items()), *(bare or ())]
    if faults is not None:
        _run_on_a_bad_line(link, faults, arguments)
        return
    program = str(find_simulator())
    announce = [] if as_json else ["--announce", _announcement(link)]
    # exec, not a child: any signal that ends this command then ends the simulator, which removes
    # its port.
    os.execv(program, [program, "--link", str(link), *announce, *arguments])  # noqa: S606


def setting(text: str) -> tuple[str, float]:
    """`NAME=VALUE` of an option `--set`; raises `InvalidArgument`."""
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError as error:
        raise InvalidArgument(
            f"--set {text}: give NAME=VALUE, with a number{with_point(value)}"
        ) from error


def _announcement(port: str | Path) -> str:
    return (
        f"A simulated robot is running at {port}; Ctrl-C stops it. In another terminal:\n"
        f"    wheelwire drive {port} --linear 0.2 --seconds 2"
    )


def _run_on_a_bad_line(link: Path, faults: str, arguments: list[str]) -> None:
    _leave_by_signals()
    with ImpairedSimulator(load_profile(faults), link=link, arguments=arguments) as simulator:
        if not printed_json({"event": "ready", "port": simulator.port}):
            print_lines(_announcement(simulator.port))
        with suppress(KeyboardInterrupt):
            simulator.wait()


def _leave_by_signals() -> None:
    """Like Ctrl-C, the others must leave the `with` block, which removes the port."""
    for number in _ENDING:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _leave)


def _leave(_number: int, _frame: FrameType | None) -> None:
    # A service manager may send several: the next one would interrupt the block's end, too.
    for number in _ENDING:
        signal.signal(number, _stay)
    raise KeyboardInterrupt


def _stay(_number: int, _frame: FrameType | None) -> None:
    # Not SIG_IGN: Python complains of a signal that was on its way.
    pass


def _run_told(link: Path, faults: str | None, values: dict[str, float]) -> None:
    """The simulator as a child, so that this process can say what its wheels do."""
    _leave_by_signals()
    profile = None if faults is None else load_profile(faults)
    watched: list[Narrator] = []

    def watch(state: TrueState) -> None:
        for narrator in watched:
            narrator.watch(state)

    options: dict[str, Any] = {
        "link": link,
        "settings": values,
        "truth_hz": TRUTH_HZ,
        "on_state": watch,
    }
    simulator = Simulator(**options) if profile is None else ImpairedSimulator(profile, **options)
    with suppress(KeyboardInterrupt), ExitStack() as stack:
        stack.enter_context(simulator)
        counts = simulator.get("counts_per_revolution")
        print_lines(_announcement(simulator.port), _seen(simulator))
        watched.append(Narrator(counts, print_lines))
        try:
            stack.enter_context(RemoteConsole(str(simulator.port), simulator.command))
        except (OSError, WheelwireError) as error:
            print_note(f"`wheelwire sim turn` cannot turn its wheels: {error}")
        threading.Thread(target=_obey_lines, args=(simulator,), daemon=True).start()
        if simulator.wait():
            raise WheelwireError("the simulator has ended: start it again")


def _seen(simulator: Simulator) -> str:
    """What a person would see and measure at the robot, for setup's other questions."""
    names = ("wheels_free", "wheel_radius_m", "wheel_separation_m")
    free, radius_m, separation_m = map(simulator.get, names)
    stands = (
        "Its wheels hang free"
        if free
        else "It stands on the floor (`--set wheels_free=1` raises it, as `wheelwire setup` needs)"
    )
    return (
        f"{stands}; the wheels have a radius of {radius_m:g} m and are {separation_m:g} m apart. "
        "`wheelwire sim turn left 10` turns one by hand. What the wheels do:"
    )


def _obey_lines(simulator: Simulator) -> None:
    """Carries out the commands that the user types."""
    for line in sys.stdin:
        if not line.strip():
            continue
        try:
            answer = simulator.command(line.strip())
        except WheelwireError as error:
            print_lines(str(error))
            continue
        value = f" = {answer['value']:g}" if "value" in answer else ""
        print_lines(f"{answer.get('name', answer['command'])}{value}")


# A negative number of turns is not an option.
@app.command("turn", context_settings={"ignore_unknown_options": True})
def turn(
    wheel: Annotated[str, typer.Argument(metavar="WHEEL")],
    turns: Annotated[float, typer.Argument(metavar="TURNS")],
    link: Path | None = None,
) -> None:
    """Turn a wheel of a running simulator by hand, one turn a second, for setup.

    Args:
        wheel: left or right.
        turns: Turns of the wheel; negative: backward.
        link: The simulated port, if several run.
    """
    if wheel not in SIDES:
        raise InvalidArgument(f"{wheel} is not a wheel: give left or right")
    if not 0.0 < abs(turns) <= _MOST_TURNS:
        raise InvalidArgument(
            f"{turns:g} turns: give a number from -{_MOST_TURNS:g} to {_MOST_TURNS:g}, and not 0"
        )
    with closing(_running(link)) as simulator:
        left = _turn(simulator, wheel, turns)
    if left:
        raise WheelwireError(
            f"the {wheel} wheel does not give way after {abs(turns - left):.2f} turns: is it "
            "blocked, or driven?"
        )
    way = "forward" if turns > 0 else "backward"
    text = f"the {wheel} wheel was turned {way} by {abs(turns):g} turns"
    print_result({"wheel": wheel, "turns": turns}, text)


def _turn(simulator: RemoteSimulator, wheel: str, turns: float) -> float:
    """Turn and let go; returns what is left of the turns."""
    name = f"{wheel}.hand_turns"
    if simulator.get(name):
        raise InvalidArgument(f"somebody turns the {wheel} wheel already: wait until that is done")
    left, moved_s = turns, time.monotonic()
    try:
        simulator.set(name, turns)  # in here, for Ctrl-C may come before its answer
        while left and time.monotonic() - moved_s < _PATIENCE_S:
            time.sleep(_LOOK_S)
            before, left = left, simulator.get(name)
            if left != before:
                moved_s = time.monotonic()
    finally:
        if left:
            simulator.set(name, 0.0)
    return left


def _running(link: Path | None) -> RemoteSimulator:
    """The simulator at this port, or the only one.

    Raises:
        SimulatorNotFound: None runs there, or several do.
    """
    found = running_simulators()
    chosen = [one for one in found if link is None or Path(one.link) == link.absolute()]
    for one in found:
        if [one] != chosen:
            one.close()
    if len(chosen) == 1:
        return chosen[0]
    if chosen:
        raise SimulatorNotFound(
            f"{len(chosen)} simulators run, at {_listed(chosen)}: name one by --link"
        )
    at, others = (
        (f" at {link}" if link else ""),
        (f"; one does at {_listed(found)}" if found else ""),
    )
    raise SimulatorNotFound(
        f"no simulator that can be turned by hand runs{at}{others}: start `wheelwire sim`, without "
        "--json and without arguments behind `--`"
    )


def _listed(simulators: Sequence[RemoteSimulator]) -> str:
    return " and ".join(one.link for one in simulators)
