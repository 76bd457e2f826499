"""`wheelwire setup`: find a robot's wiring and numbers, by measuring and by asking."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wheelwire.connect import MOCK
from wheelwire.errors import CommissioningFailed, InvalidArgument
from wheelwire.robot.robot import Robot
from wheelwire.samples import to_json_value

from .address import Address, Given, YesFlag, driving
from .output import TimeLeft, check_writable, console, print_json, screen, wants_json
from .prompts import ask_until
from .registry import Heading, command
from .sim import setting
from .tune import check_plot

if TYPE_CHECKING:
    from wheelwire.drivers.mock import MockDriver
    from wheelwire.tools.setup.questions import Person, Question
    from wheelwire.tools.setup.setup import Findings, Options

WIRING_VARIABLES = (
    "motors_swapped",
    "encoders_swapped",
    "left.motor_reversed",
    "right.motor_reversed",
    "left.encoder_reversed",
    "right.encoder_reversed",
)
"""The simulated robot's variables for its wiring."""

UNSAVED = "what was not saved has its previous value again; run the command again to go on"
"""How a set-up that a signal ends leaves the robot."""

SIZES = {
    "counts_per_revolution": "counts_per_revolution",
    "wheel_radius": "wheel_radius_m",
    "wheel_separation": "wheel_separation_m",
}
"""Parameters, and the variables of the simulated robot that they describe."""


@command("setup", Heading.BUILD, 5, page="first-hour")
def setup(
    given: Given,
    answers: Path | None = None,
    keep: Path | None = None,
    plot: Path | None = None,
    on_the_floor: bool = False,
    resume: Annotated[bool | None, typer.Option("--resume/--anew", show_default=False)] = None,
    simulated: bool = False,
    plant: str | None = None,
    seed: int | None = None,
    settings: Annotated[list[str] | None, typer.Option("--set", metavar="NAME=VALUE")] = None,
    yes: YesFlag = False,
) -> None:
    """Set up a new robot: find its wiring, count its encoders, tune its velocity loop.

    Raise the robot so that its wheels hang free; one with an IMU first stands on the floor, until
    setup knows how that is mounted. It takes some minutes and about eleven questions, six more with
    an IMU; Enter takes the default answer. Parameters correct the wiring of motors and encoders;
    setup names what they cannot correct. Until you save, the robot has its previous parameters.

    Args:
        given: The robot.
        answers: YAML file of answers, to run without a person.
        keep: Write the values to this file, as `params export` does; save nothing.
        plot: Draw the test drives before and after to this file.
        on_the_floor: Only tune, with the robot on the floor and a metre free ahead of it.
        resume: Go on where the last set-up was interrupted, or begin anew; default: ask, with
            --answers begin anew.
        simulated: Set up a simulated robot, which answers by itself.
        plant: With --simulated: a built-in plant's name or a YAML file.
        seed: With --simulated: seed of the random wiring.
        settings: With --simulated: a variable of docs/simulator.md; wiring among them is not
            random.
        yes: Do not ask.
    """
    # Here, so that no other command waits until numpy is imported.
    from wheelwire.tools.setup.questions import AnswersFile, SimulatedPerson
    from wheelwire.tools.setup.setup import Options

    if not simulated and (plant, seed, settings) != (None, None, None):
        raise InvalidArgument(
            "--plant, --seed and --set are for a simulated robot: add --simulated"
        )
    # What would fail at the end fails here: the measurements take minutes.
    check_writable(keep)
    check_plot(plot)
    options = Options(keep, resume, on_the_floor=on_the_floor, plot=plot)
    person: Person
    if simulated:
        if given.robot is not None:
            raise InvalidArgument(f"give {given.robot} or --simulated, not both")
        with _simulated_robot(plant, seed, settings or (), on_the_floor=on_the_floor) as mock:
            person = SimulatedPerson(mock)
            if answers is not None:
                person = AnswersFile(answers, person)
            _run(mock, person, options)
        if not wants_json():
            console.print(
                "Next: `wheelwire sim` runs a simulated robot that stays; with a real one, "
                "`wheelwire start`"
            )
        return
    if answers is None and not sys.stdin.isatty():
        raise InvalidArgument(
            "setup asks questions: run it in a terminal, or answer them by --answers FILE"
        )
    person = AnswersFile(answers) if answers is not None else _Terminal()
    address = given.resolve(moves=True, yes=yes)
    _check_lasting(address, keep)
    findings = set_up_at(address, person, options)
    if findings.saved and not wants_json():
        _print_next(address.text, on_the_floor=on_the_floor)


def set_up_at(
    address: Address, person: Person | None = None, options: Options | None = None
) -> Findings:
    """Set up the robot at this address.

    Args:
        address: Where it is.
        person: Answers the questions; by default the person at this terminal.
        options: What differs from the ordinary.

    Raises:
        typer.Exit: The set-up could not go on.
        WheelwireError: As `Address.open` and `wheelwire.tools.setup.setup.set_up`.
    """
    from wheelwire.tools.setup.setup import Options, Progress

    person = person or _Terminal()
    options = options or Options()
    with driving(address, lambda: UNSAVED) as driver:
        # Only a board with an id is recognised again; on the floor there is nothing to resume.
        if driver.has_device and not options.on_the_floor:
            options = replace(options, progress=Progress(driver.info.device.board_id))
        return _run(driver, person, options)


def _print_next(robot: str, *, on_the_floor: bool) -> None:
    if not on_the_floor:
        console.print(
            f"Next: put the robot on the floor with a metre free ahead of it; `wheelwire setup "
            f"{robot} --on-the-floor` tunes it with its own mass. Or drive it:",
            soft_wrap=True,
        )
    else:
        console.print("Next:")
    console.print(f"    wheelwire drive {robot} --linear 0.1 --seconds 2", soft_wrap=True)


def _run(robot: Robot, person: Person, options: Options) -> Findings:
    from wheelwire.tools.setup.setup import set_up

    def say(text: str) -> None:
        screen().print(text, soft_wrap=True)

    with TimeLeft(screen()) as left:
        options = replace(options, left=left.show)
        findings = set_up(robot, _Shown(person, say), say, options)
    if wants_json():
        found = to_json_value(findings)
        del found["is_complete"]  # the exit code says so
        print_json(found)
    elif findings.is_complete and findings.problems:
        count = len(findings.problems)
        remain = "1 problem remains" if count == 1 else f"{count} problems remain"
        console.print(f"{remain}, see above")
    elif not findings.is_complete:
        console.print("the set-up cannot go on: remove the cause, then run the command again")
    if not findings.is_complete:
        raise typer.Exit(CommissioningFailed.exit_code)
    return findings


class _Shown:
    """Shows the questions and answers of a simulated person, or of a file of answers."""

    def __init__(self, person: Person, say: Callable[[str], None]) -> None:
        self._person = person
        self._say = say

    def answer(self, question: Question) -> str:
        """As the person behind it answers."""
        answer = self._person.answer(question)
        # A terminal has shown both while it asked.
        if not isinstance(self._person, _Terminal):
            self._say(f"{question.text} {answer}")
        return answer


class _Terminal:
    """The person at this terminal."""

    def answer(self, question: Question) -> str:
        """Ask until the answer can be understood."""
        choices = f" ({', '.join(question.choices)})" if question.choices else ""
        text = f"{question.text}{choices}"
        return ask_until(text, question.parse, question.default, err=wants_json())


def _check_lasting(address: Address, keep: Path | None) -> None:
    """Check that the results can be saved; raises `InvalidArgument`."""
    if keep is not None:
        return
    if address.text == MOCK:
        raise InvalidArgument(
            "mock exists only while this command runs: use `wheelwire setup --simulated`"
        )
    from wheelwire.tools.setup.setup import CHANGED

    address.check_parameters(CHANGED, save=True)


def _simulated_robot(
    plant: str | None, seed: int | None, settings: Sequence[str], *, on_the_floor: bool
) -> MockDriver:
    """A robot raised and wired at random; or on the floor, set up except for its gains."""
    from wheelwire.drivers.mock import MockDriver
    from wheelwire.simulation.libfwsim import FwSimError
    from wheelwire.tools.files.plant import load_plant

    given = dict(map(setting, settings))
    values = dict(load_plant(plant).settings) if plant is not None else {}
    values |= {"wheels_free": float(not on_the_floor)}
    # With a seed the wiring is random even if a part of it is given, which then takes precedence.
    if not on_the_floor and (seed is not None or not given.keys() & set(WIRING_VARIABLES)):
        drawn = random.Random(seed)
        values |= {name: float(drawn.randrange(2)) for name in WIRING_VARIABLES}
    robot = MockDriver(realtime=False)
    try:
        for name, value in {**values, **given}.items():
            robot.simulator.set(name, value)
    except FwSimError as error:
        robot.close()
        raise InvalidArgument(
            f"the simulated robot refused {error}; docs/simulator.md has all variables"
        ) from error
    if on_the_floor:
        for name, variable in SIZES.items():
            robot.parameters.set(name, robot.simulator.get(variable))
    return robot
