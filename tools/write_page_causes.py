"""Write web/src/generated/causes.ts: the sentences of `wheelwire why`, for the page.

`wheelwire why` says each sentence of a robot that reports this cause. So no rule is written twice.

tools/write_page_causes.py            writes the file
tools/write_page_causes.py --check    fails when it is not what `wheelwire why` says
"""

from __future__ import annotations

import json
import sys

import generated
from generated import ROOT
from wheelwire.holds import LastStop
from wheelwire.log.why.causes import look_at_of, sentence_of
from wheelwire.log.why.device import last_stop
from wheelwire_protocol.codes import Fault, Held, ResetReason, StopCause
from wheelwire_protocol.generate.text import banner, lines

TABLES = ROOT / "web" / "src" / "generated" / "causes.ts"
BY_DETAIL = (
    StopCause.FAULT,
    StopCause.RESET,
    StopCause.BUMPER,
    StopCause.CLIFF,
    StopCause.FAULT_INPUT,
    StopCause.BATTERY,
)
"""What these are of is in another field of the report."""
OF_HOST = ("program_paused", "host_frozen", "cable_pulled", "line_corrupt", "protocol_mismatch")
"""Causes that the host itself tells apart, by what it sent and heard."""
BUMPERS_AND_SENSORS = tuple(
    flag
    for flag in Held
    if flag in (Held.CLIFF, Held.FAULT_INPUT, Held.BATTERY, Held.BATTERY_UNKNOWN)
    or str(flag.name).startswith("BUMPER")
)


def _of(flag: Held) -> LastStop:
    is_bumper = str(flag.name).startswith("BUMPER")
    return LastStop(StopCause.BUMPER if is_bumper else StopCause.CLIFF, held=flag)


def _table(name: str, what: str, rows: dict[str, tuple[str, str]]) -> str:
    texts = (
        f"  {key}: {{ sentence: {json.dumps(sentence)}, lookAt: {json.dumps(look_at)} }},"
        for key, (sentence, look_at) in rows.items()
    )
    return f"""\
/** By the name of the {what}. */
export const {name}: Readonly<Record<string, Why>> = {{
{lines(texts)}
}};"""


def _stops(name: str, what: str, stops: dict[str, LastStop]) -> str:
    said = {key: last_stop(stop, 0)[0] for key, stop in stops.items()}
    return _table(name, what, {key: (one.sentence, one.look_at) for key, one in said.items()})


def tables() -> str:
    """The text of causes.ts."""
    plain = {c.name: LastStop(c) for c in StopCause if c not in (*BY_DETAIL, StopCause.UNKNOWN)}
    faults = {str(fault.name): LastStop(StopCause.FAULT, faults=fault) for fault in Fault}
    sensors = {str(flag.name): _of(flag) for flag in BUMPERS_AND_SENSORS}
    resets = {why.name: LastStop(StopCause.RESET, reset_reason=why) for why in ResetReason}
    host = {name: (sentence_of((name,)), look_at_of((name,))) for name in OF_HOST}
    return f"""\
// {banner("What `wheelwire why` says", "host/wheelwire/diagnosis")}

/** What happened, and what to look at first. */
export interface Why {{
  readonly sentence: string;
  readonly lookAt: string;
}}

{_stops("WHY_STOPPED", "stop's cause", plain)}

{_stops("WHY_FAULT", "fault", faults)}

{_stops("WHY_SENSOR", "hold", sensors)}

{_stops("WHY_RESET", "reset's reason", resets)}

{_table("WHY_HOST", "cause", host)}
"""


if __name__ == "__main__":
    sys.exit(generated.write({TABLES: tables()}))
