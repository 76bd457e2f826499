"""Draw what `wheelwire demo` shows, for the README: docs/demo.svg.

tools/draw_demo.py            runs the demonstration once, and writes the picture
tools/draw_demo.py --check    fails when the picture differs in more than its numbers

SMIL animates the picture; browsers play it inside an image as well. Where it is not played, as in
print, the picture shows the whole path, with the robot at its end.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Sequence
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console

from wheelwire.motion.odometry import Pose
from wheelwire.tools.demo import run
from wheelwire.tools.demo.figure import DURATION_S, commanded_path
from wheelwire.tools.demo.scenario import STRAIGHT_S, TTL_S, Report

PICTURE = Path(__file__).parents[1] / "docs" / "demo.svg"
WIDTH, MARGIN = 980, 20
PLOT_WIDTH = 370
PLOT_SCALE = 200.0
"""Units of the picture for a metre."""
ROW, LABEL_WIDTH = 20, 380
TRUTH_HZ = 50
EVERY = 5
"""One in so many poses is drawn."""
SPEED = 3.0
"""How much faster the picture is than the robot."""
PAUSE_S = 5.0
"""How long the picture rests at the end."""
PATHS = (
    ("commanded", "#c8c8c8", 7.0, ""),
    ("true (plant)", "#1b7837", 3.0, ""),
    ("odometry", "#c51b7d", 1.6, ' stroke-dasharray="7 5"'),
)
ROBOT = (
    '<rect x="-11" y="-9" width="22" height="18" rx="4" fill="#1b7837"/>'
    '<path d="M-6 -11h12M-6 11h12" stroke="#202020" stroke-width="4"/>'
    '<path d="M3 -4l5 4l-5 4z" fill="#ffffff"/>'
)
"""Around its middle, ahead is right."""
IN_THE_DARK = (
    "@media (prefers-color-scheme: dark) { .paper { fill: #131416 } svg { fill: #e6edf3 } "
    '[stroke="#c8c8c8"] { stroke: #545b64 } [stroke="#1b7837"] { stroke: #56d364 } '
    '[fill="#1b7837"] { fill: #56d364 } [stroke="#c51b7d"] { stroke: #ff7eb6 } '
    '[stroke="#000000"], [stroke="#202020"] { stroke: #adbac7 } [fill="#b2182b"] { fill: #ff7b72 } '
    '[fill="#1e1e1e"] { fill: #22272e } }'
)
"""The terminal is dark anyway."""


IDEAL = Report(5.4, 0.0, 0.0, 1, 1, 0, 0, 0, 0.0, 0.0, 0, 0, 486_000, 0.05, None, None)


def main() -> str | None:
    """Run, and write the picture; with --check, what to do about an old one."""
    if "--check" in sys.argv[1:]:
        path = commanded_path(DURATION_S + STRAIGHT_S)
        is_new = shape(draw([path] * 3, IDEAL)) == shape(PICTURE.read_text("utf-8"))
        return None if is_new else "docs/demo.svg is out of date; run tools/draw_demo.py"
    paths: list[Sequence[Pose]] = []
    with TemporaryDirectory() as folder:
        report = run(Path(folder), Console(stderr=True), lambda _, *found: paths.extend(found))
    commanded, odometry, true = paths
    PICTURE.write_text(draw([commanded, true, odometry], report), "utf-8")
    return None


def shape(picture: str) -> str:
    """The picture without its numbers, which differ from run to run."""
    words = re.sub(r'(?<=fill="#9be29b">)[^<]*', "", picture)
    return re.sub(r"(?:-?\d+(?:\.\d+)?[,; ]*)+", "#", words)


def draw(paths: Sequence[Sequence[Pose]], report: Report) -> str:
    """The picture; `paths` are those of `PATHS`, the true one at `TRUTH_HZ`."""
    plot, plot_height = draw_paths(paths, report)
    rows = [row for row in report.rows() if row[0] != "picture"]
    terminal, terminal_height = draw_terminal(rows)
    height = max(plot_height, terminal_height) + 2 * MARGIN
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:.0f}" '
        f'font-family="sans-serif" font-size="13">\n'
        f"<style>{IN_THE_DARK}</style>\n"
        f'<rect class="paper" width="{WIDTH}" height="{height:.0f}" fill="#ffffff"/>\n'
        f"{plot}{terminal}</svg>\n"
    )


def draw_paths(paths: Sequence[Sequence[Pose]], report: Report) -> tuple[str, float]:
    """The three paths with a legend, a scale and the robot that drives; and how high that is."""
    everywhere = [pose for path in paths for pose in path]
    left, right = min(p.x_m for p in everywhere), max(p.x_m for p in everywhere)
    bottom, top = min(p.y_m for p in everywhere), max(p.y_m for p in everywhere)
    indent = (PLOT_WIDTH - (right - left) * PLOT_SCALE) / 2

    def place(pose: Pose) -> tuple[float, float]:
        x, y = (pose.x_m - left) * PLOT_SCALE, (top - pose.y_m) * PLOT_SCALE
        return indent + x, 2 * MARGIN + y

    parts: list[str] = []
    for (label, colour, width, dashes), path in zip(PATHS, paths, strict=True):
        y = MARGIN + ROW * len(parts) / 2
        points = " ".join(written(*place(pose)) for pose in [*path[::EVERY], path[-1]])
        parts += [
            f'<polyline fill="none" stroke="{colour}" stroke-width="{width}"{dashes} '
            f'points="{points}"/>\n',
            f'<path d="M{MARGIN} {y}h30" stroke="{colour}" stroke-width="{width}"{dashes}/>'
            f'<text x="{MARGIN + 40}" y="{y + 4}">{label}</text>\n',
        ]
    x, y = PLOT_WIDTH - MARGIN - PLOT_SCALE / 2, (top - bottom) * PLOT_SCALE + 2 * MARGIN
    parts.append(
        f'<path d="M{x} {y - 8}v8h{PLOT_SCALE / 2}v-8" fill="none" stroke="#000000"/>'
        f'<text x="{x + PLOT_SCALE / 4}" y="{y - 5}" text-anchor="middle">0.5 m</text>\n'
    )
    true = paths[1]
    parts.append(draw_drive([place(pose) for pose in true], true))
    parts.append(draw_states(len(true) / TRUTH_HZ, report, y))
    return "".join(parts), y + 2 * ROW


def written(x: float, y: float) -> str:
    """A point."""
    return f"{x:.1f},{y:.1f}"


def draw_drive(way: Sequence[tuple[float, float]], path: Sequence[Pose]) -> str:
    """The robot on its way: `way` has the places of the path's poses. At the end it stands."""
    moving_s = len(path) / TRUTH_HZ / SPEED
    whole_s = moving_s + PAUSE_S
    number = range(0, len(path), EVERY)
    times = [f"{n / len(path) * moving_s / whole_s:.4f}" for n in number]
    x, y = way[-1]
    places = [written(way[n][0] - x, way[n][1] - y) for n in number] + ["0,0", "0,0"]
    turns = [f"{-math.degrees(path[n].heading_rad):.1f}" for n in number]
    turns += [f"{-math.degrees(path[-1].heading_rad):.1f}"] * 2
    timing = (
        f'dur="{whole_s:.2f}s" repeatCount="indefinite" '
        f'keyTimes="{";".join([*times, f"{moving_s / whole_s:.4f}", "1"])}"'
    )
    return (
        f'<g transform="translate({written(x, y)})">\n'
        f'<animateMotion {timing} calcMode="linear" values="{";".join(places)}"/>\n'
        f'<g transform="rotate({turns[-1]})">{ROBOT}\n'
        f'<animateTransform attributeName="transform" type="rotate" {timing} '
        f'values="{";".join(turns)}"/></g></g>\n'
    )


def draw_states(driven_s: float, report: Report, y: float) -> str:
    """What happens, in words, each as long as it lasts."""
    whole_s = driven_s / SPEED + PAUSE_S
    stands_s = driven_s
    removed_s = stands_s - report.standstill_after_deadline_us / 1e6
    hangs_s = removed_s - TTL_S
    # The hang and the stop are over in a second: the picture holds what matters until its end.
    phases = (
        ("the program drives", "#1b7837", 0.0, hangs_s / SPEED),
        ("the program hangs", "#d95f02", hangs_s / SPEED, stands_s / SPEED),
        ("the firmware has stopped the robot", "#b2182b", stands_s / SPEED, whole_s),
    )
    texts = []
    for number, (text, colour, begin, end) in enumerate(phases):
        # Without animation the last one is seen.
        shown = int(number == len(phases) - 1)
        values = ";".join(str(int(begin <= time < end)) for time in (0.0, begin, end))
        times = f"0;{begin / whole_s:.4f};{min(end / whole_s, 1.0):.4f}"
        texts.append(
            f'<text x="{MARGIN}" y="{y + ROW}" fill="{colour}" font-weight="bold" '
            f'opacity="{shown}">{text}<animate attributeName="opacity" calcMode="discrete" '
            f'dur="{whole_s:.2f}s" repeatCount="indefinite" values="{values}" '
            f'keyTimes="{times}"/></text>\n'
        )
    return "".join(texts)


def draw_terminal(rows: Sequence[tuple[str, str]]) -> tuple[str, float]:
    """The command and what it prints; and how high that is."""
    lines = [("$ wheelwire demo", ""), *rows]
    x, height = PLOT_WIDTH + MARGIN, (len(lines) + 1) * ROW
    texts = [
        f'<text x="{x}" y="{MARGIN + (number + 1.2) * ROW:.0f}">{escape(label)}'
        f'<tspan x="{x + LABEL_WIDTH}" fill="#9be29b">{escape(value)}</tspan></text>\n'
        for number, (label, value) in enumerate(lines)
    ]
    frame = (
        f'<rect x="{PLOT_WIDTH}" y="{MARGIN}" width="{WIDTH - PLOT_WIDTH - MARGIN}" '
        f'height="{height}" rx="8" fill="#1e1e1e"/>\n'
        f'<g font-family="monospace" fill="#e8e8e8">\n'
    )
    return f"{frame}{''.join(texts)}</g>\n", height


if __name__ == "__main__":
    sys.exit(main())
