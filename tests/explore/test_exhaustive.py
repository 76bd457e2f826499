"""Every combination of the small spaces, and the refusals that SPEC.md lists."""

from __future__ import annotations

import re

import pytest

from support import exploring

pytestmark = pytest.mark.skipif(not exploring.PROGRAM.exists(), reason="not built: make cpp-tests")
SPEC = exploring.ROOT / "protocol" / "SPEC.md"
OF_OTHER_DEVICES = {"NOT_SUPPORTED"}
"""The simulated device has all that can be asked for, but no chip's memory."""


def listed() -> dict[str, set[str]]:
    """The refusals of each request, by SPEC.md's table."""
    table: dict[str, set[str]] = {}
    for line in SPEC.read_text("utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) != 3 or not re.fullmatch(r"[A-Z]\w*[a-z]\w*(, [A-Z]\w+)*", cells[0]):
            continue
        codes = set(re.findall(r"\b[A-Z][A-Z_]{4,}\b", cells[2]))
        for message in cells[0].split(", "):
            table[message] = codes
    return table


@pytest.fixture(scope="module")
def visited() -> exploring.Report:
    return exploring.exhaust()


def test_no_combination_breaks_a_rule(visited: exploring.Report) -> None:
    assert visited.broken == [], [file.read_text("utf-8") for file in visited.files]
    assert visited.totals["scenarios"] > 50_000


def test_each_refusal_of_the_specification_is_seen_and_no_other(
    visited: exploring.Report,
) -> None:
    seen: dict[str, set[str]] = {}
    for cell in visited.cells["refusal"]:
        message, code = cell.split(" ")
        seen.setdefault(message, set()).add(code)
    table = listed()
    assert len(table) > 15
    for message, codes in table.items():
        everywhere = set() if message in ("Stop", "Estop") else {"NO_SESSION"}
        elsewhere = set() if message == "MemoryGet" else OF_OTHER_DEVICES
        assert seen.get(message, set()) == codes - elsewhere | everywhere, message


def test_each_transition_is_seen(visited: exploring.Report) -> None:
    """Those that the supervisor's table has between two different states."""
    assert set(visited.cells["transition"]) >= {
        "IDLE SETPOINT",
        "TIMED_OUT SETPOINT",
        "DRIVING STOP",
        "TIMED_OUT STOP",
        "DRIVING SESSION",
        "TIMED_OUT SESSION",
        "DRIVING DEADLINE",
        "IDLE ESTOP",
        "DRIVING ESTOP",
        "TIMED_OUT ESTOP",
        "FAULT ESTOP",
        "DRIVING FAULT",
        "IDLE FAULT",
        "ESTOPPED CLEAR_ESTOP",
        "FAULT CLEAR_FAULT",
    }
