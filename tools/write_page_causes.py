"""Write web/src/generated/causes.ts: the sentences of `wheelwire why`, for the page.

Each is what `wheelwire why` says of a robot that reports this cause, so that no rule of it is
written twice.

tools/write_page_causes.py            writes the file
tools/write_page_causes.py --check    fails when it is not what `wheelwire why` says
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator

import generated
from generated import ROOT
from wheelwire.holds import LastStop
from wheelwire.log.why.causes import look_at_of, sentence_of
from wheelwire.log.why.device import last_stop
from wheelwire.log.why.diagnosis import Stop
from wheelwire_protocol.codes import Fault, Held, ResetReason, StopCause
from wheelwire_protocol.generate.text import banner

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


def _words(stop: LastStop) -> tuple[str, str]:
    said: Stop = last_stop(stop, 0)[0]
    return said.sentence, said.look_at


def _sensor(flag: Held) -> tuple[str, str]:
    is_bumper = str(flag.name).startswith("BUMPER")
    return _words(LastStop(StopCause.BUMPER if is_bumper else StopCause.CLIFF, held=flag))


def _table(name: str, doc: str, rows: Iterator[tuple[str, tuple[str, str]]]) -> list[str]:
    return [
        f"/** {doc} */",
        f"export const {name}: Readonly<Record<string, Why>> = {{",
        *(
            f"  {key}: {{ sentence: {json.dumps(sentence)}, lookAt: {json.dumps(look_at)} }},"
            for key, (sentence, look_at) in rows
        ),
        "};",
        "",
    ]


def tables() -> str:
    """The text of causes.ts."""
    plain = (c for c in StopCause if c not in (*BY_DETAIL, StopCause.UNKNOWN))
    return "\n".join(
        [
            f"// {banner('What `wheelwire why` says', 'host/wheelwire/diagnosis')}",
            "",
            "/** What happened, and what to look at first. */",
            "export interface Why {",
            "  readonly sentence: string;",
            "  readonly lookAt: string;",
            "}",
            "",
            *_table(
                "WHY_STOPPED",
                "By the name of the stop's cause.",
                ((c.name, _words(LastStop(c))) for c in plain),
            ),
            *_table(
                "WHY_FAULT",
                "By the name of the fault.",
                ((str(f.name), _words(LastStop(StopCause.FAULT, faults=f))) for f in Fault),
            ),
            *_table(
                "WHY_SENSOR",
                "By the name of the hold.",
                ((str(flag.name), _sensor(flag)) for flag in BUMPERS_AND_SENSORS),
            ),
            *_table(
                "WHY_RESET",
                "By the name of the reset's reason.",
                ((r.name, _words(LastStop(StopCause.RESET, reset_reason=r))) for r in ResetReason),
            ),
            *_table(
                "WHY_HOST",
                "By the name of the cause.",
                ((name, (sentence_of((name,)), look_at_of((name,)))) for name in OF_HOST),
            ),
        ]
    )


if __name__ == "__main__":
    sys.exit(generated.write({TABLES: tables()}))
