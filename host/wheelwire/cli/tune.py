"""`wheelwire tune`: a short drive by hand, with other gains beside the robot's own."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from wheelwire.errors import CommissioningFailed, DriverUnavailable, InvalidArgument, OutputFailed
from wheelwire.parameters import checked_values, definition_of, number_text
from wheelwire.robot.robot import Robot
from wheelwire.tools.setup.driving import meaning_of

from .address import Address, Given, driving
from .output import (
    TimeLeft,
    check_writable,
    print_json,
    print_lines,
    print_table,
    screen,
    wants_json,
)
from .prompts import ask_until, ask_yes_or_no, can_ask
from .registry import Heading, command

if TYPE_CHECKING:
    from wheelwire.tools.tune.before_after import Course
    from wheelwire.tools.tune.tuning import Comparison, Drive, Tracking

Outcome = Literal["keep", "undo", "save"]
_REVERTED = "the previous values are active again"
_HELD_UP = "setpoints came late in a drive, as this computer or the line is busy"
_LESS_BUSY = "end other programs, then try again"
_SHORTEST_S, _LONGEST_S = 0.2, 60.0
_NEAREST_M, _FURTHEST_M = 0.01, 20.0

_FIGURES = (
    ("rms_mps", "rms error", "mm/s", 1e3),
    ("rise_s", "rise time", "ms", 1e3),
    ("overshoot", "overshoot", "%", 100.0),
    ("settling_s", "settling", "ms", 1e3),
)
"""Attribute of `Tracking`, title, unit and scale."""


@command("tune", Heading.BUILD, 6, page="tutorial/7-tune")
def tune(
    given: Given,
    shape: str = "step",
    wheel: str = "both",
    speed: float = 0.2,
    seconds: float = 3.0,
    distance: float = 0.5,
    proportional_gain: Annotated[float | None, typer.Option("--proportional-gain", "--kp")] = None,
    integral_gain: Annotated[float | None, typer.Option("--integral-gain", "--ki")] = None,
    velocity_feedforward: float | None = None,
    static_feedforward: float | None = None,
    acceleration_feedforward: float | None = None,
    path_gain: float | None = None,
    heading_gain: float | None = None,
    plot: Path | None = None,
    save: bool = False,
    yes: Annotated[bool, typer.Option("--yes", "-y")] = False,
) -> None:
    """Drive a step, a ramp or a sine with the robot's gains and with others; keep them, or undo.

    It asks before anything moves: raise the robot, or leave it room. The new values are on trial:
    the previous ones return unless you keep or save the new ones, also after Ctrl-C, a fault or a
    lost link. Without a gain it drives once.

    Args:
        given: The robot.
        shape: step, ramp or sine.
        wheel: left, right or both; the other one is held.
        speed: Greatest speed in m/s; negative: backward.
        seconds: Longest time of a drive.
        distance: Farthest way of a wheel in a drive, in m.
        proportional_gain: Value to try.
        integral_gain: Value to try.
        velocity_feedforward: Value to try.
        static_feedforward: Value to try.
        acceleration_feedforward: Value to try.
        path_gain: Value to try.
        heading_gain: Value to try.
        plot: Draw the drives to this file.
        save: Save the values without asking, unless the robot tracks worse or setpoints came late.
        yes: Do not ask before the wheels turn.
    """
    gains = {
        "proportional_gain": proportional_gain,
        "integral_gain": integral_gain,
        "velocity_feedforward": velocity_feedforward,
        "static_feedforward": static_feedforward,
        "acceleration_feedforward": acceleration_feedforward,
        "path_gain": path_gain,
        "heading_gain": heading_gain,
    }
    tried = checked_values({name: v for name, v in gains.items() if v is not None})
    drive = _checked(shape, wheel, speed, seconds, distance)
    check_plot(plot)
    if save and not tried:
        raise InvalidArgument("there is nothing to save: give a gain, such as --ki 12")
    address = given.resolve(moves=True, yes=yes)
    address.check_parameters(tried, save=save)
    if not yes and not can_ask():
        raise InvalidArgument(
            "`tune` asks before the wheels turn, and there is no terminal to ask on: add --yes"
        )
    wish = _Wish(drive, tried, plot, save, yes, _can_save(address, tried))
    with driving(address, lambda: _REVERTED if tried else "") as driver:
        before = {name: driver.parameters[name] for name in tried}
        found, outcome = _try(driver, wish)
    if wants_json():
        print_json(_as_json(found, before, wish, outcome))
    elif outcome:
        _print_outcome(before, tried, outcome)
    if found.faults[-1]:
        raise CommissioningFailed(f"a fault ended the drive: {meaning_of(found.faults[-1])}")
    if save and outcome != "save":
        if found.held_up:
            raise CommissioningFailed(
                f"{_HELD_UP}: {_LESS_BUSY}; the new values were not saved, {_REVERTED}"
            )
        raise CommissioningFailed(f"the new values track worse and were not saved; {_REVERTED}")


@dataclass(frozen=True)
class _Wish:
    """The options of the command."""

    drive: Drive
    tried: Mapping[str, float]
    plot: Path | None
    save: bool
    yes: bool
    can_save: bool


def _try(driver: Robot, wish: _Wish) -> tuple[Comparison, Outcome | None]:
    """Drive, show, ask; the robot then has the values that were decided on."""
    # Here, so that no other command waits until numpy is imported.
    from wheelwire.tools.setup.driving import set_at_rest
    from wheelwire.tools.tune.tuning import compare

    def confirm(course: Course) -> None:
        if not wish.yes and not ask_yes_or_no(_question(wish, course)):
            raise InvalidArgument("nothing was driven")

    outcome = None
    with driver.parameters.trial() as trial:
        with TimeLeft(screen()) as left:
            found = compare(driver, wish.drive, wish.tried, left.show, confirm)
        if not wants_json():
            _print(found)
        if wish.plot is not None:
            _draw(found, wish.plot)
        if wish.tried:
            outcome = _outcome(found, wish)
        if outcome in ("keep", "save"):
            for name, value in wish.tried.items():
                set_at_rest(driver, name, value)
            trial.keep()
    if outcome == "save":  # the device saves nothing while values are on trial
        for name in wish.tried:
            driver.parameters.save(name)
    return found, outcome


def _checked(shape: str, wheel: str, speed: float, seconds: float, distance: float) -> Drive:
    """The drive; raises `InvalidArgument`."""
    from wheelwire.tools.tune.tuning import SHAPES, WHEELS, Drive

    for name, value, allowed in (("shape", shape, SHAPES), ("wheel", wheel, WHEELS)):
        if value not in allowed:
            raise InvalidArgument(f"--{name} {value}: give {', '.join(allowed)}")
    if not math.isfinite(speed) or not speed:
        raise InvalidArgument(f"--speed {speed:g}: give a speed in m/s that is not 0")
    for name, given, low, high in (
        ("seconds", seconds, _SHORTEST_S, _LONGEST_S),
        ("distance", distance, _NEAREST_M, _FURTHEST_M),
    ):
        if not low <= given <= high:
            raise InvalidArgument(f"--{name} {given:g}: give {low:g} to {high:g}")
    return Drive(shape, wheel, speed, seconds, distance)


def check_plot(plot: Path | None) -> None:
    """For `--plot`: raise before anything moves what would otherwise be raised at the end."""
    if plot is None:
        return
    check_writable(plot)
    if find_spec("matplotlib") is None:
        raise DriverUnavailable("--plot needs matplotlib: run pip install 'wheelwire[tools]'")
    from wheelwire.tools.tune.before_after import check_picture

    check_picture(plot)


def _question(wish: _Wish, course: Course) -> str:
    drive = wish.drive
    what = "both wheels" if len(drive.wheels) > 1 else f"the {drive.wheel} wheel"
    times = "twice" if wish.tried else "once"
    return (
        f"A {drive.shape} of {what} to {drive.speed_mps:g} m/s, {course.seconds:.1f} s, {times}. "
        f"On the floor each takes up to {drive.distance_m:g} m. Is the robot raised, or is "
        "there enough space?"
    )


def _outcome(found: Comparison, wish: _Wish) -> Outcome:
    """What to do with the values that were tried."""
    if wish.save:
        return "undo" if found.is_worse or found.held_up else "save"
    if found.faults[-1] or not can_ask():
        return "undo"
    choices: tuple[Outcome, ...] = ("keep", "undo", "save") if wish.can_save else ("keep", "undo")

    def parse(given: str) -> Outcome:
        for choice in choices:
            if given.lower() in (choice[0], choice):
                return choice
        raise InvalidArgument(f"answer {', '.join(choices)}")

    return ask_until(f"What now ({', '.join(choices)})?", parse, "undo")


def _can_save(address: Address, names: Collection[str]) -> bool:
    try:
        address.check_parameters(names, save=True)
    except InvalidArgument:
        return False
    return True


def _print(found: Comparison) -> None:
    rows = [
        (
            f"{side} {title}",
            *(_shown(figures, side, name, unit, scale) for figures in found.figures),
        )
        for side in found.sides
        for name, title, unit, scale in _FIGURES
        if name == "rms_mps" or found.drive.shape == "step"
    ]
    print_table(
        f"{found.drive.shape} to {found.drive.speed_mps:g} m/s, {found.seconds:.1f} s",
        ("", *found.titles) if len(found.titles) > 1 else ("", "measured"),
        rows,
    )
    for title, fault in zip(found.titles, found.faults, strict=True):
        if fault:
            print_lines(f"{title}: a fault ended the drive: {meaning_of(fault)}")
    if found.gain_mps is not None:
        print_lines(_verdict(found, found.gain_mps))
    elif found.held_up:
        print_lines(f"{_HELD_UP}: {_LESS_BUSY}")


def _shown(
    figures: Mapping[str, Tracking] | None, side: str, name: str, unit: str, scale: float
) -> str:
    if figures is None:
        return "fault"
    value: float | None = getattr(figures[side], name)
    return "-" if value is None else f"{value * scale:.{1 if unit == 'mm/s' else 0}f} {unit}"


def _verdict(found: Comparison, gain_mps: float) -> str:
    if found.held_up:
        return f"{_HELD_UP}, so both cannot be compared: {_LESS_BUSY}"
    noise = f"the noise of such drives, {found.noise_mps * 1e3:.1f} mm/s"
    if abs(gain_mps) <= found.noise_mps:
        return f"both track as well, within {noise}"
    which = "better" if gain_mps > 0 else "worse"
    return f"the new values track {which} by {abs(gain_mps) * 1e3:.1f} mm/s, beyond {noise}"


def _draw(found: Comparison, plot: Path) -> None:
    from wheelwire.tools.tune.before_after import draw

    titles = found.titles if len(found.titles) > 1 else ("measured",)
    with OutputFailed.of(plot, _REVERTED):
        draw(plot, tuple(zip(titles, found.traces, strict=True)))
    screen().print(f"drawn in {plot}", soft_wrap=True)


def _print_outcome(before: Mapping[str, float], tried: Mapping[str, float], outcome: str) -> None:
    for name, value in tried.items():
        unit = definition_of(name).unit.value
        print_lines(f"  {name}: {number_text(before[name])} -> {number_text(value)} {unit}")
    said = {
        "keep": "active until the next reset; `wheelwire params save` saves them",
        "undo": f"undone: {_REVERTED}",
        "save": "saved",
    }
    print_lines(said[outcome])


def _as_json(
    found: Comparison, before: Mapping[str, float], wish: _Wish, outcome: Outcome | None
) -> Mapping[str, object]:
    return {
        "drive": found.drive,
        "seconds": found.seconds,
        "values": {
            name: {"before": before[name], "after": value} for name, value in wish.tried.items()
        },
        **dict(zip(found.titles, found.figures, strict=True)),
        "faults": dict(zip(found.titles, found.faults, strict=True)),
        "gain_mps": found.gain_mps,
        "noise_mps": found.noise_mps,
        "held_up": found.held_up,
        "outcome": outcome,
        "plot": None if wish.plot is None else str(wish.plot),
    }
