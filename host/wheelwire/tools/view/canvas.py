"""A small canvas of braille characters: eight dots in each cell of a terminal."""

from __future__ import annotations

DOTS_X, DOTS_Y = 2, 4
"""Dots in a cell: columns, rows."""
BLANK = 0x2800
_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""The bit of the dot in a row and a column of a cell."""


class Canvas:
    """Dots, from the left and from the top; what lies outside is left out.

    Args:
        width: Cells.
        height: Cells.

    Attributes:
        width: Dots.
        height: Dots.
        rows: The dots of each cell as bits, row by row; a cell's character is at `BLANK` plus them.
    """

    def __init__(self, width: int, height: int) -> None:
        self.width = width * DOTS_X
        self.height = height * DOTS_Y
        self.rows = [[0] * width for _ in range(height)]

    def set(self, x: int, y: int) -> None:
        """Draw a dot."""
        if 0 <= x < self.width and 0 <= y < self.height:
            self.rows[y // DOTS_Y][x // DOTS_X] |= _BITS[y % DOTS_Y][x % DOTS_X]

    def column(self, x: int, y: int, other_y: int) -> None:
        """Draw the dots of one column from `y` to `other_y`, both included."""
        for dot in range(min(y, other_y), max(y, other_y) + 1):
            self.set(x, dot)
