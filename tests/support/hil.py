"""What a board has to show in `make hil`, and the table of it.

A measurement is the JSON object that `wheelwire-hil-sim` prints: `firmware/esp32/test/hil/`. A
board has no row for which a wire is missing, and null where it cannot measure something.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

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


class Check(NamedTuple):
    """One line of the table."""

    what: str
    wanted: str
    seen: str
    passes: bool
    row: str = ""


def _at_most(what: str, values: Iterable[float], limit: float, unit: str = "") -> Check:
    largest = max(values, default=float("inf"))
    seen, wanted = (f"{number} {unit}".strip() for number in (f"{largest:.4g}", f"{limit:g}"))
    return Check(what, f"at most {wanted}", seen, largest <= limit)


def _all(what: str, found: Sequence[bool], wanted: str = "each time") -> Check:
    return Check(what, wanted, f"{sum(found)} of {len(found)}", bool(found) and all(found))


def _released_ms(events: Iterable[Measured]) -> list[float]:
    """How long the motors stayed on; an event without that time has no end."""
    return [event.get("released_ms", float("inf")) for event in events]


def _crashes(measured: Measured) -> list[Check]:
    events = measured["events"]
    back = [event for event in events if event["is_back"]]
    crashes = [event for event in events if event["kind"] == "crash"]
    right = [event["reason"] in REASONS[event["kind"]] for event in back]
    dumps = [event["has_dump"] for event in back if event.get("reason") == "PANIC"]
    box = measured.get("box_reason")
    of_reset = bool(measured.get("box_is_of_reset")) and box in REASONS["hang"]
    # A board cannot time what a core does that crashes.
    by_time = [_at_most("motors off after a crash", _released_ms(crashes), RELEASED_MS, "ms")]
    return [
        _all("drove when it happened", [event["drove"] for event in events]),
        _all("back without a hand", [event["is_back"] for event in events]),
        _at_most("until it is back", [event["back_s"] for event in back], BACK_S, "s"),
        _all("reset reason", right, "right each time"),
        *(by_time if measured.get("times_release", True) else []),
        _all("core dump after a panic", dumps),
        Check("black box of the last reset", "in flash, with its reason", str(box), of_reset),
    ]


def _pwm(measured: Measured) -> list[Check]:
    duties, changes = measured["duties"], measured["changes"]
    off = [abs(it["period_us"] * it["frequency_hz"] / 1e6 - 1) * 100 for it in duties]
    return [
        _all("starts", [it["started"] for it in duties]),
        _at_most("period", off, 0.1, "% off"),
        _at_most("high time", [it["worst_ticks"] for it in duties], TICKS, "ticks off"),
        _at_most("edges at 0 and 100 %", [it["edges_of_levels"] for it in duties], 0),
        _at_most("changes that show more", [it["wrong"] for it in changes], 0),
        *([] if measured["reversals"] is None else _reversals(measured["reversals"])),
    ]


def _reversals(reversals: Sequence[Measured]) -> list[Check]:
    more = [100 * (it["most_part"] - it["wanted_part"]) for it in reversals]
    return [
        _at_most("a reversal shows more than its duty", more, 1.0, "% of a period"),
        _at_most("and of the old direction", [it["wrong_way_part"] for it in reversals], 0),
        _all("drives after a reversal", [it["drives_afterwards"] for it in reversals]),
    ]


def _counters(measured: Measured) -> list[Check]:
    errors = {
        "through 100 000 ticks and back": "error_ticks",
        f"{measured['turns_at_limit']} turns at the limit": "error_at_limit_ticks",
        f"{measured['spikes']} spikes of 500 ns": "error_of_spikes_ticks",
    }
    return [
        _all("starts", [measured["started"]], "yes"),
        *(_at_most(what, [abs(measured[key])], 0, "ticks off") for what, key in errors.items()),
    ]


def _stops(measured: Measured) -> list[Check]:
    count, freezes = measured["expiries"]["count"], measured["freezes"]
    late = [measured["expiries"]["longest_ms"]] if count else []
    return [
        _at_most(f"drive after {count} deadlines", late, EXPIRED_MS, "ms"),
        *([] if freezes is None else _freezes(freezes)),
    ]


def _freezes(freezes: Sequence[Measured]) -> list[Check]:
    return [
        _all("drove when it froze", [it["drove"] for it in freezes]),
        _at_most("drive after the last step", _released_ms(freezes), FROZEN_MS, "ms"),
        _all("back without a hand", [it["is_back"] for it in freezes]),
    ]


def _line(measured: Measured) -> list[Check]:
    saved = [number < measured["saved"] for number in range(measured["saves"])]
    return [
        _at_most(f"of {measured['pings']} pings at rest lost", [measured["lost"]], 0),
        _all("saves under traffic", saved, "all"),
        _at_most("longest pause of a save", [measured["longest_pause_ms"]], PAUSE_MS, "ms"),
        _at_most("resets", [measured["resets"]], 0),
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
    judged = [(row, judge(measured[row])) for row, judge in ROWS.items() if row in measured]
    return [check._replace(row=row) for row, found in judged for check in found]


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
    for what, wanted, seen, passes, row in found:
        result = "passes" if passes else "FAILS"
        lines.append(f"| {row} | {what} | {wanted} | {seen} | {result} |")
    return "\n".join(lines)
