"""One thing that is wrong."""

from __future__ import annotations

from dataclasses import dataclass

PAGE = "docs/doctor.md"


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    Attributes:
        name: Name of the check; the heading of its section in `PAGE`.
        problem: One sentence.
        cure: One line: what to run or to do.
    """

    name: str
    problem: str
    cure: str

    @property
    def page(self) -> str:
        """The section of the documentation that explains the finding."""
        return f"{PAGE}#{self.name}"
