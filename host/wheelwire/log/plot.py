"""What a recording shows over time, and its picture: setpoints, wheels, and what stopped them."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheelwire_protocol.codes import Fault, SupervisorState

from ..link.sample_stream import DUTY_SCALE, Measurement
from ..link.session import Phase, Session
from ..link.setpoints import ASKED
from ..link.traffic import Kind, Record
from ..whole_file import save_figure
from .rerun import Rerun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def _floats() -> array[float]:
    return array("d")


@dataclass
class Asked:
    """Setpoints: when each began and ended, and its value for each wheel."""

    begins_s: array[float] = field(default_factory=_floats)
    ends_s: array[float] = field(default_factory=_floats)
    left: array[float] = field(default_factory=_floats)
    right: array[float] = field(default_factory=_floats)


class Band(NamedTuple):
    """The robot's state from `begin_s` to `end_s`; None: out of reach."""

    begin_s: float
    end_s: float
    state: SupervisorState | None


class Mark(NamedTuple):
    """Faults that were latched at a moment."""

    time_s: float
    faults: Fault


@dataclass
class Trace:
    """Times are in seconds since the recording's beginning, at the arrival of each frame.

    Attributes:
        times_s: Times of the samples.
        left_mps: Measured.
        right_mps: Measured.
        left_duty: On the output, -1..1.
        right_duty: On the output, -1..1.
        asked_speed: Setpoints for velocities. [m/s]
        asked_duty: Setpoints for duties.
        bands: The supervisor's states, side by side.
        marks: Faults, each when it was latched.
        begin_us: When the recording begins, by the host's clock.
        end_s: The recording's length.
    """

    times_s: array[float] = field(default_factory=_floats)
    left_mps: array[float] = field(default_factory=_floats)
    right_mps: array[float] = field(default_factory=_floats)
    left_duty: array[float] = field(default_factory=_floats)
    right_duty: array[float] = field(default_factory=_floats)
    asked_speed: Asked = field(default_factory=Asked)
    asked_duty: Asked = field(default_factory=Asked)
    bands: list[Band] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    begin_us: int = 0
    end_s: float = 0.0

    @classmethod
    def of(cls, records: Iterable[Record]) -> Trace:
        """Run a recording again, and collect what it shows.

        Raises:
            ValueError: A record is from another release.
        """
        return _Tracing().trace_of(records)


class _Tracing:
    """Fills a trace."""

    def __init__(self) -> None:
        self._trace = Trace()
        self._state: SupervisorState | None = None
        self._since_s = 0.0
        self._opened_s: float | None = None
        """When the session was opened."""
        self._faults = Fault(0)

    def trace_of(self, records: Iterable[Record]) -> Trace:
        again, trace = Rerun(), self._trace
        for record in records:
            trace.begin_us = trace.begin_us or record.host_us
            if record.kind in (Kind.VELOCITY, Kind.DUTY):
                self._note_asked(record)
            elif record.kind in (Kind.STOP, Kind.STOP_COPY):
                self._end_asked(self._seconds(record.host_us))
            for measurement in again.feed(record):
                self._note(measurement)
            self._note_reach(again.session, record.host_us)
        trace.end_s = self._seconds(again.host_us)
        self._change(None, trace.end_s)
        return trace

    def _seconds(self, host_us: int) -> float:
        return (host_us - self._trace.begin_us) / 1e6

    def _note_asked(self, record: Record) -> None:
        left, right, expiry_us = ASKED.unpack(record.data)
        self._end_asked(self._seconds(record.host_us))
        trace = self._trace
        asked = trace.asked_duty if record.kind is Kind.DUTY else trace.asked_speed
        asked.begins_s.append(self._seconds(record.host_us))
        asked.ends_s.append(self._seconds(expiry_us))
        asked.left.append(left)
        asked.right.append(right)

    def _end_asked(self, now_s: float) -> None:
        """End a setpoint: at its expiry, the next setpoint of either kind, or a stop."""
        for asked in (self._trace.asked_speed, self._trace.asked_duty):
            if asked.ends_s and asked.ends_s[-1] > now_s:
                asked.ends_s[-1] = now_s

    def _note(self, measurement: Measurement) -> None:
        trace, state = self._trace, measurement.state
        now_s = self._seconds(measurement.arrived_us)
        trace.times_s.append(now_s)
        trace.left_mps.append(state.left_mps)
        trace.right_mps.append(state.right_mps)
        trace.left_duty.append(state.left_duty_q15 / DUTY_SCALE)
        trace.right_duty.append(state.right_duty_q15 / DUTY_SCALE)
        if measurement.supervisor is not self._state:
            # The first sample of a session shows the state that it was opened in.
            opened_s = self._opened_s if self._state is None else None
            self._change(measurement.supervisor, now_s if opened_s is None else opened_s)
        if measurement.faults != self._faults:
            if fresh := measurement.faults & ~self._faults:
                trace.marks.append(Mark(now_s, fresh))
            self._faults = measurement.faults

    def _note_reach(self, session: Session | None, host_us: int) -> None:
        if session is not None and session.phase is Phase.OPEN:
            if self._opened_s is None:
                self._opened_s = self._seconds(host_us)
            return
        self._opened_s = None
        if self._state is not None:
            self._change(None, self._seconds(host_us))

    def _change(self, state: SupervisorState | None, now_s: float) -> None:
        if now_s > self._since_s:
            self._trace.bands.append(Band(self._since_s, now_s, self._state))
        self._state, self._since_s = state, now_s


POINTS = 4000
"""A picture has fewer columns; of more samples, each column shows least and most."""
GAP_S = 0.5
"""Samples further apart are not joined by a line."""
LABELS = 12
"""How many marks have a label; more would cover each other."""
OUT_OF_REACH = "out of reach"
COLOURS = {
    SupervisorState.BOOT: "#cfe3f5",
    SupervisorState.IDLE: "#efefef",
    SupervisorState.DRIVING: "#d6f0d3",
    SupervisorState.TIMED_OUT: "#fdeeb5",
    SupervisorState.ESTOPPED: "#f8cfa8",
    SupervisorState.FAULT: "#f5b5b5",
}
LEFT, RIGHT, SETPOINT, FAULT = "#1f5fa8", "#8c3a8c", "#222222", "#c00000"

Line = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Times and values; NaN where the line is broken."""


def draw(trace: Trace, title: str, path: Path, window: tuple[float, float] | None = None) -> None:
    """Draw a trace.

    Args:
        trace: What to show.
        title: Above the picture.
        path: Its ending says what kind of picture it is, as .png.
        window: Begin and end. [s]; default: all.

    Raises:
        ImportError: matplotlib is not installed.
        OSError: The file cannot be written.
        ValueError: There is no such kind of picture.
    """
    from matplotlib.figure import Figure  # not pyplot, which needs a display

    figure = Figure(figsize=(12, 7.5), layout="constrained")
    left, right, duty = figure.subplots(3, 1, sharex=True)
    right.sharey(left)  # the wheels can be compared
    unit, scale = _time_unit(trace.end_s)
    states = _states(trace)
    for axes in (left, right, duty):
        _draw_bands(axes, trace, scale, states)
        for mark in trace.marks:
            axes.axvline(mark.time_s * scale, color=FAULT, linewidth=1.2)
        axes.grid(alpha=0.35)
        axes.axhline(0.0, color="#777777", linewidth=0.6)
        axes.margins(x=0)
    times_s = np.asarray(trace.times_s)
    for axes, name, measured, asked, colour in (
        (left, "left", trace.left_mps, trace.asked_speed.left, LEFT),
        (right, "right", trace.right_mps, trace.asked_speed.right, RIGHT),
    ):
        # The setpoint's line is broad and lies below, so that both lines can be seen.
        _plot(axes, steps(trace.asked_speed, asked), scale, "asked", SETPOINT, 3.0, alpha=0.35)
        _plot(axes, line(times_s, np.asarray(measured)), scale, "measured", colour, 1.1)
        axes.set_ylabel(f"{name} [m/s]")
    for name, driven, asked, colour in (
        ("left", trace.left_duty, trace.asked_duty.left, LEFT),
        ("right", trace.right_duty, trace.asked_duty.right, RIGHT),
    ):
        if asked:
            _plot(
                *(duty, steps(trace.asked_duty, asked), scale, f"{name}, asked", colour, 3.0),
                alpha=0.35,
            )
        _plot(duty, line(times_s, np.asarray(driven)), scale, name, colour, 1.1)
    duty.set_ylabel("duty")
    duty.set_xlabel(f"time since the recording's beginning [{unit}]")
    begin_s, end_s = window or (0.0, max(trace.end_s, 1e-3))
    duty.set_xlim(max(0.0, begin_s) * scale, min(end_s, trace.end_s or end_s) * scale)
    for axes in (left, right, duty):
        # Above the panel, where it covers nothing.
        axes.legend(
            *axes.get_legend_handles_labels(),
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=4,
            fontsize="small",
            frameon=False,
            borderpad=0.2,
        )
    _name_marks(left, trace.marks, scale)
    figure.suptitle(title, fontsize="medium")
    _draw_legend(figure, states, has_marks=bool(trace.marks))
    save_figure(figure, path, dpi=110)


def line(times_s: NDArray[np.float64], values: NDArray[np.float64]) -> Line:
    """Samples as a line, of as many points as can be seen."""
    if len(times_s) < 2:
        return times_s, values
    columns = np.arange(len(times_s))
    if len(times_s) > 2 * POINTS:
        span_s = times_s[-1] - times_s[0]
        columns = ((times_s - times_s[0]) / span_s * (POINTS - 1)).astype(np.int64)
    # Breaks come between two columns: a gap is longer than one, or lies within it unseen.
    begins = np.flatnonzero(np.diff(columns, prepend=-1))
    lows, highs = np.fmin.reduceat(values, begins), np.fmax.reduceat(values, begins)
    firsts = times_s[begins]
    lasts = times_s[np.append(begins[1:], len(times_s)) - 1]
    broken = np.append(firsts[1:] - lasts[:-1] > GAP_S, False)
    x = np.column_stack((firsts, lasts, lasts)).ravel()
    y = np.column_stack((lows, highs, np.where(broken, np.nan, highs))).ravel()
    return x, y


def steps(asked: Asked, values: Sequence[float]) -> Line:
    """Setpoints as steps, each as long as it was active."""
    begins, ends, heights = (np.asarray(one) for one in (asked.begins_s, asked.ends_s, values))
    if not len(begins):
        return begins, heights
    # Equal spans that follow each other without a break become one.
    is_new = np.ones(len(begins), dtype=bool)
    is_new[1:] = (begins[1:] > ends[:-1]) | (heights[1:] != heights[:-1])
    firsts = np.flatnonzero(is_new)
    ends = ends[np.append(firsts[1:], len(begins)) - 1]
    begins, heights = begins[firsts], heights[firsts]
    broken = np.append(begins[1:] > ends[:-1], True)
    x = np.column_stack((begins, ends, ends)).ravel()
    y = np.column_stack((heights, heights, np.where(broken, np.nan, heights))).ravel()
    return x, y


def _plot(
    axes: Axes, shown: Line, scale: float, label: str, colour: str, width: float, **style: Any
) -> None:
    x, y = shown
    axes.plot(x * scale, y, label=label, color=colour, linewidth=width, **style)


def _time_unit(end_s: float) -> tuple[str, float]:
    if end_s < 180:
        return "s", 1.0
    return ("min", 1 / 60) if end_s < 3 * 3600 else ("h", 1 / 3600)


def _states(trace: Trace) -> list[SupervisorState | None]:
    """The states that occur, in the order of their numbers."""
    found = {band.state for band in trace.bands}
    away_s = sum(band.end_s - band.begin_s for band in trace.bands if band.state is None)
    states: list[SupervisorState | None] = [state for state in SupervisorState if state in found]
    # Leave out the short end while a program closes its robot.
    return [*states, None] if away_s > trace.end_s / POINTS else states


def _band_style(state: SupervisorState | None) -> dict[str, Any]:
    if state is None:
        return {"facecolor": "white", "edgecolor": "#999999", "hatch": "///"}
    return {"facecolor": COLOURS[state], "edgecolor": "none"}


def _draw_bands(
    axes: Axes, trace: Trace, scale: float, states: list[SupervisorState | None]
) -> None:
    for state in states:
        spans = [
            (band.begin_s * scale, (band.end_s - band.begin_s) * scale)
            for band in trace.bands
            if band.state is state
        ]
        axes.broken_barh(
            *(spans, (0.0, 1.0)),
            transform=axes.get_xaxis_transform(),
            zorder=0,
            linewidth=0,
            **_band_style(state),
        )


def _name_marks(axes: Axes, marks: Sequence[Mark], scale: float) -> None:
    """Draw the faults in the uppermost panel, each along its line."""
    for mark in marks[:LABELS]:
        names = ", ".join(fault.name or "" for fault in Fault if fault in mark.faults)
        axes.annotate(
            *(names, (mark.time_s * scale, 0.97)),
            xycoords=axes.get_xaxis_transform(),
            xytext=(-2, 0),
            textcoords="offset points",
            rotation=90,
            horizontalalignment="right",
            verticalalignment="top",
            color=FAULT,
            fontsize="small",
            bbox={"facecolor": "white", "alpha": 0.6, "linewidth": 0, "pad": 1},
        )
    if len(marks) > LABELS:
        axes.set_title(
            f"{len(marks)} faults, the first {LABELS} named",
            loc="left",
            color=FAULT,
            fontsize="small",
        )


def _draw_legend(figure: Figure, states: list[SupervisorState | None], *, has_marks: bool) -> None:
    from matplotlib.artist import Artist
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Artist] = [
        Patch(label=OUT_OF_REACH if state is None else state.name, **_band_style(state))
        for state in states
    ]
    if has_marks:
        handles.append(Line2D([], [], color=FAULT, label="a fault is latched"))
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=len(handles),
        fontsize="small",
        frameon=False,
    )
