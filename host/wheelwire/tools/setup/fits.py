"""The two models that measurements are fitted to: a line, and a first-order lag with a delay."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]

_DELAYS_S = (0.0, 0.08)
_LOGS = (math.log(0.003), math.log(1.0))
"""Logarithms of the shortest and longest time constant [s] that the fit tries."""
_GRID = 13
_ZOOMS = 5


class Line(NamedTuple):
    """Speed over duty: `speed = slope * (duty - offset)`."""

    slope: float
    """[m/s per duty]"""
    offset: float
    """Duty at which, by the line, the wheel stands still."""
    deviation: float
    """The greatest distance of a point from the line, as a fraction of the greatest speed."""


def fit_line(curve: Sequence[tuple[float, float]]) -> Line:
    """The least-squares line of speed over duty, through at least two points of them."""
    x, y = np.asarray(curve, float).T
    slope, intercept = np.polyfit(x, y, 1)
    deviation = np.abs(y - (slope * x + intercept)).max() / y.max()
    return Line(float(slope), float(-intercept / slope), float(deviation))


Edge: TypeAlias = Sequence[tuple[float, float]]
"""The measured answer to one step of the duty: time from its beginning [s], and speed [m/s]."""


class FirstOrder(NamedTuple):
    """A first-order lag with a delay, `exp(-delay s) / (time_constant s + 1)`."""

    delay_s: float
    time_constant_s: float


def fit_first_order(edges: Sequence[Edge], ramp_s: float) -> FirstOrder:
    """The lag that fits all of the edges best, by least squares.

    The speeds before and after each edge are fitted, too. What remains are two unknowns, searched
    on a grid that is refined several times.

    Args:
        edges: What was measured.
        ramp_s: Length of the ramp that each step is, as the slew limit of the duty makes it.
    """
    measured = [np.asarray(edge, float).T for edge in edges]
    delays = _DELAYS_S
    logs = _LOGS
    for _ in range(_ZOOMS):
        rows, columns = np.linspace(*delays, _GRID), np.linspace(*logs, _GRID)
        of_edges = [_residuals(edge, ramp_s, rows, np.exp(columns)) for edge in measured]
        row, column = divmod(int(np.argmin(sum(of_edges))), _GRID)
        delay, log = float(rows[row]), float(columns[column])
        delays = _zoomed(delays, delay, _DELAYS_S)
        logs = _zoomed(logs, log, _LOGS)
    return FirstOrder(delay, math.exp(log))


def _zoomed(
    window: tuple[float, float], centre: float, bounds: tuple[float, float]
) -> tuple[float, float]:
    # More than one step of the grid to each side: the best value lies between its points.
    half = 1.5 * (window[1] - window[0]) / (_GRID - 1)
    return max(bounds[0], centre - half), min(bounds[1], centre + half)


def _residuals(edge: Values, ramp_s: float, delays_s: Values, constants_s: Values) -> Values:
    """The sums of squares that the best speeds before and after an edge leave.

    A row for each delay, with a column for each time constant.
    """
    times, speeds = edge
    # speed = a + b * shape has a closed form: without their means, the part of the speeds that is
    # not along the shape remains.
    shapes = _ramp_response(times - delays_s[:, None, None], constants_s[:, None], ramp_s)
    shapes -= shapes.mean(axis=-1, keepdims=True)
    speeds = speeds - speeds.mean()
    powers = (shapes**2).sum(axis=-1)
    along = np.divide((shapes @ speeds) ** 2, powers, out=np.zeros_like(powers), where=powers > 0)
    return np.asarray(speeds @ speeds - along)


def _ramp_response(times: Values, time_constant_s: Values, ramp_s: float) -> Values:
    """Response of a lag to an input that rises from 0 to 1 within `ramp_s`."""
    # A step is a ramp of length 0; dividing by the length would fail.
    ramp_s = max(ramp_s, 1e-4)

    # A ramp is the difference of two integrated steps, so its response is the difference of two
    # integrals of the step response, 1 - exp(-t / time_constant_s).
    def integral(elapsed: Values) -> Values:
        elapsed = np.maximum(elapsed, 0.0)
        return elapsed + time_constant_s * np.expm1(-elapsed / time_constant_s)

    return (integral(times) - integral(times - ramp_s)) / ramp_s
