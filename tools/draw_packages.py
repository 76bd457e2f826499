"""Draw the packages of the host library and their imports: docs/architecture.svg.

tools/draw_packages.py            writes the picture
tools/draw_packages.py --check    fails when it is not what the code says

The rows are the layers that import-linter holds (pyproject.toml). The few imports that point
upwards are listed there: each happens when it is asked for, by name, and has no arrow.
"""

from __future__ import annotations

import sys

import grimp

import generated

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PICTURE = generated.ROOT / "docs" / "architecture.svg"
PACKAGE = "wheelwire"
WIDTH, ROW, BOX_WIDTH, BOX_HEIGHT = 900, 92, 190, 48
IN_THE_DARK = (
    "@media (prefers-color-scheme: dark) { .paper { fill: #131416 } text { fill: #e6edf3 } "
    "rect:not(.paper) { fill: #1c2733; stroke: #6ba3d6 } }"
)


def layers() -> list[list[str]]:
    """The packages, uppermost layer first."""
    settings = tomllib.loads((generated.ROOT / "pyproject.toml").read_text("utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    (rows,) = [c["layers"] for c in contracts if c.get("containers") == [PACKAGE]]
    return [[package.strip() for package in row.split("|")] for row in rows]


def arrows(rows: list[list[str]]) -> list[tuple[str, str]]:
    """Pairs of packages; the first, upper one imports the second.

    Pairs that are also connected through a third package are left out: most packages import the
    lowest one.
    """
    graph = grimp.build_graph(PACKAGE)
    row_of = {package: number for number, row in enumerate(rows) for package in row}
    found = set()
    for importer in graph.modules:
        for imported in graph.find_modules_directly_imported_by(importer):
            pair = importer.split(".")[1:2] + imported.split(".")[1:2]
            if set(pair) <= row_of.keys() and row_of[pair[0]] < row_of[pair[-1]]:
                found.add((pair[0], pair[1]))
    return sorted((a, b) for a, b in found if not _is_reached(b, _imported(a, found) - {b}, found))


def _imported(package: str, pairs: set[tuple[str, str]]) -> set[str]:
    return {imported for importer, imported in pairs if importer == package}


def _is_reached(package: str, packages: set[str], pairs: set[tuple[str, str]]) -> bool:
    return any(
        package in (further := _imported(other, pairs)) or _is_reached(package, further, pairs)
        for other in packages
    )


def picture() -> str:
    """The picture as SVG."""
    rows = layers()
    place: dict[str, tuple[float, float]] = {}
    for number, row in enumerate(rows):
        for column, package in enumerate(row):
            place[package] = WIDTH * (column + 1) / (len(row) + 1), 40 + ROW * number
    height = 40 + ROW * len(rows)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
        'font-family="sans-serif" font-size="15">',
        f"<style>{IN_THE_DARK}</style>",
        f'<rect class="paper" width="{WIDTH}" height="{height}" fill="#ffffff"/>',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" '
        'markerHeight="7" orient="auto"><path d="M0 0L8 4L0 8z" fill="#7a8794"/></marker></defs>',
    ]
    for importer, imported in arrows(rows):
        (x1, y1), (x2, y2) = place[importer], place[imported]
        # Bent outwards in proportion to its length, so that it avoids the boxes in between.
        bend = (abs(y2 - y1) / ROW - 1) * 55 * (1 if x1 + x2 >= WIDTH else -1)
        parts.append(
            f'<path d="M{x1:.0f} {y1 + BOX_HEIGHT / 2:.0f}Q{(x1 + x2) / 2 + bend:.0f} '
            f'{(y1 + y2) / 2:.0f} {x2:.0f} {y2 - BOX_HEIGHT / 2:.0f}" fill="none" '
            'stroke="#7a8794" stroke-width="1.2" marker-end="url(#tip)" opacity="0.75"/>'
        )
    for package, (x, y) in place.items():
        left, top = x - BOX_WIDTH / 2, y - BOX_HEIGHT / 2
        parts += [
            f'<rect x="{left:.0f}" y="{top:.0f}" width="{BOX_WIDTH}" height="{BOX_HEIGHT}" rx="6" '
            'fill="#eef4fa" stroke="#2b5f8f" stroke-width="1.5"/>',
            f'<text x="{x:.0f}" y="{y + 5:.0f}" text-anchor="middle">{package}</text>',
        ]
    return "\n".join([*parts, "</svg>"]) + "\n"


if __name__ == "__main__":
    sys.exit(generated.write({PICTURE: picture()}))
