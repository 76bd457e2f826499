"""What the pictures of wires share: shapes, colours, and how they look in the dark."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

ORANGE, BLUE, GREEN, RED, BLACK = "#bc4c00", "#1f6feb", "#1a7f37", "#cf222e", "#24292f"
GREY, PAPER = "#555", "#ffffff"
IN_THE_DARK = (
    ".paper { fill: #131416 }",
    'text:not([fill]), text[fill="#111"] { fill: #e6edf3 }',
    f'text[fill="{GREY}"] {{ fill: #9da7b3 }}',
    f'text[fill="{RED}"] {{ fill: #ff7b72 }}',
    f'text[fill="{GREEN}"] {{ fill: #56d364 }}',
    f'[stroke="{BLACK}"] {{ stroke: #adbac7 }}',
    f'circle[fill="{BLACK}"] {{ fill: #adbac7 }}',
)


class Picture:
    """Shapes, as lines of an SVG."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def add(self, element: str, text: str | None = None, /, **attributes: object) -> None:
        """An element; in its attributes' names, _ stands for -."""
        named = (f' {name.replace("_", "-")}="{value}"' for name, value in attributes.items())
        end = "/>" if text is None else f">{escape(text)}</{element}>"
        self.lines.append(f"<{element}{''.join(named)}{end}")

    def rect(self, x: int, y: int, width: int, height: int, **attributes: object) -> None:
        """A rectangle, from its upper left corner."""
        self.add("rect", x=x, y=y, width=width, height=height, **attributes)

    def wire(self, colour: str, *points: tuple[int, int], width: int = 2) -> None:
        """A line through the points."""
        path = " ".join(f"{x},{y}" for x, y in points)
        self.add("polyline", points=path, fill="none", stroke=colour, stroke_width=width)

    def dot(self, x: int, y: int, colour: str, radius: float = 4) -> None:
        """A pin, or where wires meet."""
        self.add("circle", cx=x, cy=y, r=radius, fill=colour)


def svg(title: str, width: int, height: int, rules: Iterable[str], *pictures: Picture) -> str:
    """The pictures, each over the one before, as a file.

    Args:
        title: What a screen reader says.
        width: Of all.
        height: Of all.
        rules: CSS that replaces these pictures' own colours in the dark.
        pictures: Black on white, and in the dark the other way round. Wires keep their colours.
    """
    style = " ".join((*IN_THE_DARK, *rules))
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
            'font-family="Helvetica, Arial, sans-serif" font-size="13" role="img" '
            'aria-labelledby="title">',
            f'<title id="title">{escape(title)}</title>',
            f"<style>@media (prefers-color-scheme: dark) {{ {style} }}</style>",
            f'<rect class="paper" width="{width}" height="{height}" fill="{PAPER}"/>',
            *(line for picture in pictures for line in picture.lines),
            "</svg>",
            "",
        ]
    )
