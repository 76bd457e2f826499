"""One thing that is wrong."""

from __future__ import annotations

from dataclasses import dataclass

PAGE = "docs/doctor.md"


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    Attributes:
        name: Of the check; the heading of its section in `PAGE`.
        problem: One sentence.
        cure: One line: what to run or to do.
    """

    name: str
    problem: str
    cure: str

    @property
    def page(self) -> str:
        """Where it is explained."""
        return f"{PAGE}#{self.name}"
