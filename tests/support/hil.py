"""What a board has to show in `make hil`, and the table of it.

A measurement is the JSON object that `wheelwire-hil-sim` prints: `firmware/esp32/test/hil/`. A
board has no row for which a wire is missing, and null where it cannot measure something.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Measured = Mapping[str, Any]

BACK_S = 15.0
RELEASED_MS = 1.1
"""After a crash: the handler's first act."""
FROZEN_MS = 7.0
"""After the last step of a core that freezes, at 1 kHz."""
EXPIRED_MS = 1.1
TICKS = 2
PAUSE_MS = 450.0
REASONS = {
    "crash": {"PANIC", "INTERRUPT_WATCHDOG"},
    "hang": {"TASK_WATCHDOG", "INTERRUPT_WATCHDOG"},
}
"""A crash whose handler does not come to its end is ended by the RTC watchdog."""


@dataclass(frozen=True)
class Check:
    """One line of the table."""

    row: str
    what: str
    wanted: str
    seen: str
    passes: bool

    @property
    def result(self) -> str:
        """In a word, for the table."""
        return "passes" if self.passes else "FAILS"


def _at_most(row: str, what: str, values: Iterable[float], limit: float, unit: str) -> Check:
    largest = max(values, default=float("inf"))
    seen = f"{largest:.4g} {unit}".strip()
    return Check(row, what, f"at most {limit:g} {unit}".strip(), seen, largest <= limit)


def _all(row: str, what: str, wanted: str, found: Sequence[bool]) -> Check:
    return Check(row, what, wanted, f"{sum(found)} of {len(found)}", bool(found) and all(found))


def _released_ms(events: Iterable[Measured]) -> list[float]:
    """How long the motors stayed on; an event without that time has no end."""
    return [event.get("released_ms", float("inf")) for event in events]


def _crashes(measured: Measured) -> list[Check]:
    row = "crashes"
    events = measured["events"]
    back = [event for event in events if event["is_back"]]
    crashes = [event for event in events if event["kind"] == "crash"]
    whole = [event for event in back if event.get("reason") == "PANIC"]
    # A board cannot time what a core does that crashes.
    by_time = [_at_most(row, "motors off after a crash", _released_ms(crashes), RELEASED_MS, "ms")]
    return [
        _all(row, "drove when it happened", "each time", [event["drove"] for event in events]),
        _all(row, "back without a hand", "each time", [event["is_back"] for event in events]),
        _at_most(row, "until it is back", [event["back_s"] for event in back], BACK_S, "s"),
        _all(
            row,
            "reset reason",
            "right each time",
            [event["reason"] in REASONS[event["kind"]] for event in back],
        ),
        *(by_time if measured.get("times_release", True) else []),
        _all(row, "core dump after a panic", "each time", [event["has_dump"] for event in whole]),
        Check(
            row,
            "black box of the last reset",
            "in flash, with its reason",
            str(measured.get("box_reason")),
            bool(measured.get("box_is_of_reset")) and measured.get("box_reason") in REASONS["hang"],
        ),
    ]


def _pwm(measured: Measured) -> list[Check]:
    row = "pwm"
    duties, changes = measured["duties"], measured["changes"]
    return [
        _all(row, "starts", "each time", [it["started"] for it in duties]),
        _at_most(
            row,
            "period",
            [abs(it["period_us"] * it["frequency_hz"] / 1e6 - 1) * 100 for it in duties],
            0.1,
            "% off",
        ),
        _at_most(row, "high time", [it["worst_ticks"] for it in duties], TICKS, "ticks off"),
        _at_most(row, "edges at 0 and 100 %", [it["edges_of_levels"] for it in duties], 0, ""),
        _at_most(row, "changes that show more", [it["wrong"] for it in changes], 0, ""),
        *([] if measured["reversals"] is None else _reversals(row, measured["reversals"])),
    ]


def _reversals(row: str, reversals: Sequence[Measured]) -> list[Check]:
    more = [100 * (it["most_part"] - it["wanted_part"]) for it in reversals]
    return [
        _at_most(row, "a reversal shows more than its duty", more, 1.0, "% of a period"),
        _at_most(
            row, "and of the old direction", [it["wrong_way_part"] for it in reversals], 0, ""
        ),
        _all(
            row,
            "drives after a reversal",
            "each time",
            [it["drives_afterwards"] for it in reversals],
        ),
    ]


def _counters(measured: Measured) -> list[Check]:
    row = "counters"
    return [
        _all(row, "starts", "yes", [measured["started"]]),
        _at_most(
            row, "through 100 000 ticks and back", [abs(measured["error_ticks"])], 0, "ticks off"
        ),
        _at_most(
            row,
            f"{measured['turns_at_limit']} turns at the limit",
            [abs(measured["error_at_limit_ticks"])],
            0,
            "ticks off",
        ),
        _at_most(
            row,
            f"{measured['spikes']} spikes of 500 ns",
            [abs(measured["error_of_spikes_ticks"])],
            0,
            "ticks off",
        ),
    ]


def _stops(measured: Measured) -> list[Check]:
    row = "stops"
    expiries = measured["expiries"]
    return [
        _at_most(
            row,
            f"drive after {expiries['count']} deadlines",
            [expiries["longest_ms"]] if expiries["count"] else [],
            EXPIRED_MS,
            "ms",
        ),
        *([] if measured["freezes"] is None else _freezes(row, measured["freezes"])),
    ]


def _freezes(row: str, freezes: Sequence[Measured]) -> list[Check]:
    return [
        _all(row, "drove when it froze", "each time", [it["drove"] for it in freezes]),
        _at_most(row, "drive after the last step", _released_ms(freezes), FROZEN_MS, "ms"),
        _all(row, "back without a hand", "each time", [it["is_back"] for it in freezes]),
    ]


def _line(measured: Measured) -> list[Check]:
    row = "line"
    return [
        _at_most(row, f"of {measured['pings']} pings at rest lost", [measured["lost"]], 0, ""),
        _all(
            row,
            "saves under traffic",
            "all",
            [i < measured["saved"] for i in range(measured["saves"])],
        ),
        _at_most(row, "longest pause of a save", [measured["longest_pause_ms"]], PAUSE_MS, "ms"),
        _at_most(row, "resets", [measured["resets"]], 0, ""),
    ]


ROWS = {
    "crashes": _crashes,
    "pwm": _pwm,
    "counters": _counters,
    "stops": _stops,
    "line": _line,
}


def checks(measured: Measured) -> list[Check]:
    """Judge what was measured, row by row."""
    judged = [(row, judge) for row, judge in ROWS.items() if row in measured]
    return [check for row, judge in judged for check in judge(measured[row])]


def report(measured: Measured, output: Path, show: Callable[[str], object]) -> bool:
    """Print the table, write the measurements to `output`. Whether every row passes."""
    found = checks(measured)
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(json.dumps(measured, indent=1), "utf-8")
    show(markdown(found))
    for row in failing_rows(found):
        show(f"FAILED {row}")
    return not failing_rows(found)


def failing_rows(found: Iterable[Check]) -> list[str]:
    """The rows that do not pass, in the table's order."""
    return list(dict.fromkeys(check.row for check in found if not check.passes))


def simulate(program: Path, times: int = 1) -> Measured:
    """What the simulated board measures, everything `times` times as often."""
    command = [str(program), str(times)]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    measured: Measured = json.loads(result.stdout)
    return measured


def markdown(found: Iterable[Check]) -> str:
    """The table, for an issue."""
    lines = ["| row | what | wanted | seen | |", "| -- | -- | -- | -- | -- |"]
    lines += [
        f"| {check.row} | {check.what} | {check.wanted} | {check.seen} | {check.result} |"
        for check in found
    ]
    return "\n".join(lines)
