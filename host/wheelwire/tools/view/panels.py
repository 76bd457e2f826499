"""The text of each part of the screen, for a width and a height. Readable without colour."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Sequence
from datetime import datetime
from typing import NamedTuple

from rich.text import Text

from wheelwire_protocol.codes import Fault

from .canvas import BLANK, Canvas
from .model import WINDOW_S, Look, Model

LABEL = 6
"""Width of a plot's labels in cells."""
GAP_S = 0.5
"""Over a longer pause no line is drawn."""
DOTTED = 3
"""Setpoints have a dot at every third column, so that they can be recognised without colour."""
_NICE = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0)
_NOISE = 0.03
"""Fraction of the scale that a value may be below zero without getting its own half of the plot."""
MEASURED, ASKED, DUTY = "cyan", "yellow", "magenta"
_ALARM = "bold reverse"

_Value = Callable[[Look], "float | None"]


class Curve(NamedTuple):
    """One line of a plot."""

    value: _Value
    style: str
    dotted: bool = False


class Side(NamedTuple):
    """How to get one wheel's values."""

    name: str
    speed: Curve
    asked_speed: Curve
    duty: Curve
    asked_duty: Curve


def _measured(name: str, style: str) -> Curve:
    """What this attribute of the samples is."""
    return Curve(lambda look: None if look.sample is None else getattr(look.sample, name), style)


def _asked(index: int, *, duty: bool) -> Curve:
    def value(look: Look) -> float | None:
        asked = look.asked
        return asked[index] if asked is not None and asked.duty is duty else None

    return Curve(value, ASKED, dotted=True)


LEFT, RIGHT = (
    Side(
        side.upper(),
        _measured(f"{side}_mps", MEASURED),
        _asked(index, duty=False),
        _measured(f"{side}_duty", DUTY),
        _asked(index, duty=True),
    )
    for index, side in enumerate(("left", "right"))
)


# --- lines of text -------------------------------------------------------------------------------


def title(model: Model, modes: Iterable[str], width: int) -> Text:
    """The robot's name, and what this view does besides showing it."""
    right = ", ".join(modes)
    name = model.name
    room = max(8, width - len(right) - 2)
    if len(name) > room:  # a path's end says more than its beginning
        name = f"…{name[1 - room :]}"
    return Text(f"{name}{right.rjust(width - len(name))}"[:width], style="bold")


def state(model: Model, width: int, height: int) -> Text:
    """The state and faults in words, and why."""
    lines: list[tuple[str, str]] = []
    before = ""
    if model.ended:
        lines += _wrapped(f"ENDED: {model.ended}", width, _ALARM)
        before = "at its end: "
    elif model.trouble:
        before = "before: "
        lines += _wrapped(f"OUT OF REACH: {model.trouble}", width, _ALARM)
        lines += _wrapped("The view goes on when the robot is back.", width, "")
    found = model.state
    if found is None:
        lines += _wrapped("waiting for the first sample", width, "")
    else:
        style = _ALARM if model.is_latched else "bold"
        lines += _wrapped(f"{before}{found.name}: {found.doc}", width, style)
        lines += _wrapped(_reasons(model), width, "")
        for sentence in model.held:
            lines += _wrapped(sentence, width, _ALARM)
    return _joined(_cut(lines, width, height))


def _reasons(model: Model) -> str:
    why, look_at = model.why
    faults = [] if model.sample is None else [f for f in Fault if f in model.sample.faults]
    if why:
        names = f"{', '.join(str(fault.name) for fault in faults)}. " if faults else ""
        return f"{names}{why} Look first at {look_at}."
    warnings = () if model.held else model.status.warnings  # the same in other words
    return " ".join([*(f"{f.name}: {f.doc}" for f in faults), *warnings])


def link(model: Model, width: int) -> Text:
    """The link, the supply and the ticks."""
    parts = []
    counted, sample = model.status.statistics, model.sample
    if counted is not None:
        parts += [
            # Each has a fixed width, so that a line does not break elsewhere at each look.
            f"link {counted.state_rate_hz:4.0f} Hz",
            f"loss {counted.recent_loss:5.1%}, {counted.frames_lost} frames",
            f"clock ±{_ms(counted.clock_error_us)}",
            f"round trip {_ms(counted.round_trip_p50_us)}, p99 {_ms(counted.round_trip_p99_us)}",
        ]
    if sample is not None:
        measured = "not measured" if sample.battery_v is None else f"{sample.battery_v:.1f} V"
        parts += [f"supply {measured}", f"ticks {sample.left_ticks:+d} {sample.right_ticks:+d}"]
    return _flowing(parts, width)


def keys(names: Sequence[tuple[str, str]], width: int) -> Text:
    """The line that explains the keys."""
    return _flowing([f"{key} {meaning}" for key, meaning in names], width)


def events(model: Model, width: int, height: int) -> Text:
    """The last events with their times, the newest last; whole ones, but for the newest."""
    lines: list[tuple[str, str]] = []
    for event in reversed(model.events):
        time_of_day = datetime.fromtimestamp(event.unix_s).astimezone()
        found = _wrapped(f"{time_of_day:%H:%M:%S} {event.text}", width, "", indent=9)
        if lines and len(lines) + len(found) > height:
            break
        lines = [*_cut(found, width, height), *lines]
    return _joined(lines)


def paragraph(text: str, width: int, height: int) -> Text:
    """A text over several lines."""
    return _joined(_wrapped(text, width, "")[:height])


def _ms(microseconds: float) -> str:
    return "   -   " if math.isnan(microseconds) else f"{microseconds / 1000:.2f} ms"


def _wrapped(text: str, width: int, style: str, indent: int = 0) -> list[tuple[str, str]]:
    lines = textwrap.wrap(text, max(width, 20), subsequent_indent=" " * indent)
    return [(line, style) for line in lines]


def _cut(lines: list[tuple[str, str]], width: int, height: int) -> list[tuple[str, str]]:
    """Lines that end with an ellipsis if some are left out."""
    if 0 < height < len(lines):
        text, style = lines[height - 1]
        lines[height - 1] = f"{text[: width - 1]}…", style
    return lines[:height]


def _joined(lines: Iterable[tuple[str, str]]) -> Text:
    return Text("\n").join(Text(line, style=style) for line, style in lines)


def _flowing(parts: Iterable[str], width: int) -> Text:
    """Parts side by side, none of them broken."""
    lines: list[str] = []
    for part in parts:
        if lines and len(lines[-1]) + 2 + len(part) <= width:
            lines[-1] += f"  {part}"
        else:
            lines.append(part)
    return Text("\n".join(line[:width] for line in lines))


# --- a wheel -------------------------------------------------------------------------------------


def wheel(model: Model, side: Side, width: int, height: int) -> Text:
    """One wheel: its numbers, its speed over time, and its duty over time."""
    looks, now_s, text = model.looks, model.now_s, _numbers(model, side, width)
    speed_width = width * 3 // 5
    duty_width = width - speed_width - 1
    speeds = plot(looks, now_s, (side.asked_speed, side.speed), speed_width, height - 1)
    duties = plot(looks, now_s, (side.asked_duty, side.duty), duty_width, height - 1, 1.0)
    for left, right in zip(speeds, duties, strict=True):
        text.append("\n").append_text(left).append(" ").append_text(right)
    return text


def _numbers(model: Model, side: Side, width: int) -> Text:
    newest = model.looks[-1] if model.looks else Look(0.0, None, None, "")
    asked_duty = side.asked_duty.value(newest)
    parts = [
        f"{side.name:5}",
        f"asked {_number(side.asked_speed.value(newest))}",
        f"measured {_number(side.speed.value(newest))} m/s",
        f"duty {_number(side.duty.value(newest))}",
    ]
    if asked_duty is not None:
        parts.append(f"asked {_number(asked_duty)}")
    return Text().append("  ".join(parts)[:width], style="bold")


def _number(value: float | None) -> str:
    return "  -  " if value is None else f"{value:+.2f}"


def axis(width: int) -> Text:
    """The lines below the wheels: the time axis and the legend."""
    text = Text()
    text.append("·····", style=ASKED).append(" asked  ")
    text.append("━━━━━", style=MEASURED).append(" measured, m/s  ")
    text.append("━━━━━", style=DUTY).append(" duty")
    text.append(f"last {WINDOW_S:.0f} s".rjust(max(0, width - len(text.plain))))
    return text


def plot(
    looks: Sequence[Look],
    now_s: float,
    curves: Sequence[Curve],
    width: int,
    height: int,
    full: float | None = None,
) -> list[Text]:
    """Curves over the last `WINDOW_S`, one text for each row; of two in a cell the last one shows.

    Args:
        looks: In order.
        now_s: At the right edge.
        curves: To draw.
        width: Cells, with the labels.
        height: Cells.
        full: The scale; None: by the values.
    """
    if height < 1:
        return []
    values = [[curve.value(look) for look in looks] for curve in curves]
    low, high = _scale([v for found in values for v in found if v is not None], full)
    cells = max(1, width - LABEL)
    canvases = []
    for curve, found in zip(curves, values, strict=True):
        canvas = Canvas(cells, height)
        _draw(canvas, looks, found, now_s, (low, high), dotted=curve.dotted)
        canvases.append(canvas.rows)
    labels = _labels(low, high, height)
    return [
        _row(labels[row], [canvas[row] for canvas in canvases], [curve.style for curve in curves])
        for row in range(height)
    ]


def _scale(values: Sequence[float], full: float | None) -> tuple[float, float]:
    peak = max((abs(value) for value in values), default=0.0)
    high = full or next((nice for nice in _NICE if peak <= nice), math.ceil(peak))
    return (-high if min(values, default=0.0) < -_NOISE * high else 0.0), high


def _labels(low: float, high: float, height: int) -> list[str]:
    labels = [" " * LABEL] * height
    labels[0] = f"{high:+5.1f} "
    if height > 1:
        labels[-1] = f"{low:+5.1f} "
    if low < 0 and height > 2:
        labels[height // 2] = f"{0:5.1f} "
    return labels


def _draw(
    canvas: Canvas,
    looks: Sequence[Look],
    values: Sequence[float | None],
    now_s: float,
    scale: tuple[float, float],
    *,
    dotted: bool,
) -> None:
    """Draw a curve: in each column all that was seen in its time, joined to the column before."""
    low, high = scale
    column_s = WINDOW_S / canvas.width
    # Columns of one clock: a curve moves by whole columns, and keeps its shape.
    shift = canvas.width - 1 - int(now_s // column_s)
    last_x, last_y, last_s = 0, 0, -math.inf
    for look, value in zip(looks, values, strict=True):
        if value is None:
            last_s = -math.inf
            continue
        number = int(look.now_s // column_s)
        x = number + shift
        part = (min(max(value, low), high) - low) / (high - low)
        y = canvas.height - 1 - round(part * (canvas.height - 1))
        if dotted:
            if number % DOTTED == 0:
                canvas.set(x, y)
        elif look.now_s - last_s > GAP_S:
            canvas.set(x, y)
        else:
            for between in range(last_x + 1, x):
                canvas.set(between, last_y)
            canvas.column(x, last_y, y)
        last_x, last_y, last_s = x, y, look.now_s


def _row(label: str, rows: Sequence[Sequence[int]], styles: Sequence[str]) -> Text:
    text = Text().append(label, style="dim")
    if not any(map(any, rows)):
        return text.append(" " * len(rows[0]))
    run, run_style = "", ""
    for cells in zip(*rows, strict=True):
        bits, style = 0, run_style  # a blank cell has any style
        for cell, of_curve in zip(cells, styles, strict=True):
            if cell:
                bits |= cell
                style = of_curve
        if style != run_style:
            text.append(run, style=run_style)
            run, run_style = "", style
        run += chr(BLANK + bits) if bits else " "
    return text.append(run, style=run_style)
