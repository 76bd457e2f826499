"""ros/diagnostics' aggregator, as far as our file uses it.

By diagnostic_aggregator 4.0.0 (branch ros2-jazzy): which analyzers take a status
(`GenericAnalyzer::match`, `Aggregator::diagCallback`), and the levels that analyzers and group
report (`GenericAnalyzerBase::report`, `AnalyzerGroup::report`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

OK, WARN, ERROR, STALE = range(4)
OTHER = "Other"
KNOWN = {"type", "path", "startswith", "remove_prefix", "timeout", "discard_stale", "num_items"}
GENERIC = "diagnostic_aggregator/GenericAnalyzer"


@dataclass
class Analyzer:
    """A GenericAnalyzer.

    Attributes:
        items: The statuses that it has: their level, and when they came last. [s]
    """

    path: str
    startswith: list[str]
    timeout: float
    discard_stale: bool
    may_be_empty: bool
    items: dict[str, tuple[int, float]] = field(default_factory=dict)

    def matches(self, name: str) -> bool:
        """Whether it takes a status of this name."""
        return any(name.startswith(begin) for begin in self.startswith)

    def level(self, now_s: float) -> int:
        """The level of its header."""

        def is_stale(since_s: float) -> bool:
            return now_s - since_s > self.timeout

        if self.discard_stale:
            self.items = {n: item for n, item in self.items.items() if not is_stale(item[1])}
        if not self.items and self.may_be_empty:
            return OK
        level, all_stale = OK, True
        for own, since_s in self.items.values():
            stale = is_stale(since_s)
            all_stale = all_stale and (stale or own == STALE)
            level = STALE if stale else max(level, own)
        if all_stale:
            return OK if self.discard_stale else STALE
        return ERROR if level == STALE else level


class Aggregator:
    """A group of analyzers from a parameter file.

    Args:
        parameters: Of the node `analyzers`.
    """

    def __init__(self, parameters: dict[str, Any]) -> None:
        self.analyzers: list[Analyzer] = []
        for name, given in parameters.items():
            if name == "path":
                continue
            assert given.keys() <= KNOWN, name
            assert given["type"] == GENERIC
            assert given.get("num_items", 0) == 0, "a number that is expected"
            self.analyzers.append(
                Analyzer(
                    given["path"],
                    given["startswith"],
                    given["timeout"],
                    given.get("discard_stale", False),
                    "num_items" in given,
                )
            )

    def takers(self, name: str) -> list[str]:
        """The paths under which a status appears."""
        return [one.path for one in self.analyzers if one.matches(name)] or [OTHER]

    def take(self, name: str, level: int, now_s: float) -> None:
        """A status has come."""
        for analyzer in self.analyzers:
            if analyzer.matches(name):
                analyzer.items[name] = level, now_s

    def level(self, now_s: float) -> int:
        """The level of the whole robot."""
        levels = [analyzer.level(now_s) for analyzer in self.analyzers]
        is_stale = max(levels) == STALE
        return ERROR if is_stale and min(levels) != STALE else max(levels)
