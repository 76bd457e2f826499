"""Draw what `wheelwire demo` shows, for the README: docs/demo.svg. Runs the demonstration once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console

from wheelwire.demo import run
from wheelwire.motion.odometry import Pose

PICTURE = Path(__file__).parents[1] / "docs" / "demo.svg"
WIDTH, MARGIN = 980, 20
PLOT_WIDTH = 370
PLOT_SCALE = 200.0
"""Units of the picture for a metre."""
ROW, LABEL_WIDTH = 20, 380
PATHS = (
    ("commanded", "#c8c8c8", 7.0, ""),
    ("true (plant)", "#1b7837", 3.0, ""),
    ("odometry", "#c51b7d", 1.6, ' stroke-dasharray="7 5"'),
)


def main() -> None:
    """Run, and write the picture."""
    paths: list[Sequence[Pose]] = []
    with TemporaryDirectory() as folder:
        report = run(Path(folder), Console(stderr=True), lambda _, *found: paths.extend(found))
    plot, plot_height = draw_paths(paths)
    terminal, terminal_height = draw_terminal([row for row in report.rows() if row[0] != "picture"])
    height = max(plot_height, terminal_height) + 2 * MARGIN
    PICTURE.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:.0f}" '
        f'font-family="sans-serif" font-size="13">\n'
        f'<rect width="{WIDTH}" height="{height:.0f}" fill="#ffffff"/>\n'
        f"{plot}{terminal}</svg>\n",
        "utf-8",
    )


def draw_paths(paths: Sequence[Sequence[Pose]]) -> tuple[str, float]:
    """The three paths with a legend and a scale; and how high that is."""
    everywhere = [pose for path in paths for pose in path]
    left, right = min(p.x_m for p in everywhere), max(p.x_m for p in everywhere)
    bottom, top = min(p.y_m for p in everywhere), max(p.y_m for p in everywhere)
    indent = (PLOT_WIDTH - (right - left) * PLOT_SCALE) / 2
    parts = []
    for (label, colour, width, dashes), path in zip(PATHS, paths, strict=True):
        points, last = [], None
        for pose in path:
            if last is None or math.hypot(pose.x_m - last.x_m, pose.y_m - last.y_m) > 0.01:
                last = pose
                x, y = (pose.x_m - left) * PLOT_SCALE, (top - pose.y_m) * PLOT_SCALE
                points.append(f"{indent + x:.1f},{2 * MARGIN + y:.1f}")
        parts.append(
            f'<polyline fill="none" stroke="{colour}" stroke-width="{width}"{dashes} '
            f'points="{" ".join(points)}"/>\n'
        )
        y = MARGIN + ROW * len(parts) / 2
        parts.append(
            f'<path d="M{MARGIN} {y}h30" stroke="{colour}" stroke-width="{width}"{dashes}/>'
            f'<text x="{MARGIN + 40}" y="{y + 4}">{label}</text>\n'
        )
    x, y = PLOT_WIDTH - MARGIN - PLOT_SCALE / 2, (top - bottom) * PLOT_SCALE + 2 * MARGIN
    parts.append(
        f'<path d="M{x} {y - 8}v8h{PLOT_SCALE / 2}v-8" fill="none" stroke="#000000"/>'
        f'<text x="{x + PLOT_SCALE / 4}" y="{y - 5}" text-anchor="middle">0.5 m</text>\n'
    )
    return "".join(parts), y


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
    main()
