"""Write the sentences of commands for the page: of `flash` and `setup`, and of `why`.

Each of `wheelwire flash` and `setup` is found in the command's source by its first words; `why`
says its own of a robot that reports a cause. So no sentence is written twice.

tools/write_page_words.py            writes web/src/generated/words.ts and causes.ts
tools/write_page_words.py --check    fails when they are not what the commands say
"""

from __future__ import annotations

import ast
import json
import sys
from collections.abc import Iterator, Mapping

import generated
from generated import ROOT
from wheelwire.link.holds import LastStop
from wheelwire.log.why.causes import look_at_of, sentence_of
from wheelwire.log.why.device import last_stop
from wheelwire.parameters import definition_of
from wheelwire.tools.setup import problems, wiring
from wheelwire_protocol.codes import Fault, Held, ResetReason, StopCause
from wheelwire_protocol.generate.text import banner, lines

NOT_WATCHING = ("reversal_duty", "rolling_velocity_mps")
"""Thresholds that setup raises to their maximum for a while."""
PAGE = ROOT / "web" / "src" / "generated"
HOST = ROOT / "host" / "wheelwire"
FLASH = {
    "keepTurning": ("tools/flash.py", "the wheels of the robot at "),
    "notSupported": ("tools/flash.py", "the chip at "),
    "tooSmall": ("tools/flash.py", "the {} at {} has "),
    "notAnImage": ("tools/flash.py", "{} is not a Wheelwire firmware image"),
    "otherBoard": ("tools/flash.py", "the firmware was written, but reports"),
    "otherChip": ("cli/flash.py", "{} is for the {}, but the chip at {} is an {}: use --image"),
}
SETUP = {
    "pulsed": ("tools/setup/wiring.py", "One motor is pulsed"),
    "otherMotor": ("tools/setup/wiring.py", "Now the other motor"),
    "whichWheel": ("tools/setup/wiring.py", "Which wheel turned"),
    "whichWay": ("tools/setup/wiring.py", "Which way did"),
    "byHand": ("tools/setup/wiring.py", "The {} wheel did not turn"),
    "turnsUndriven": ("tools/setup/wiring.py", "a wheel turns although"),
    "faultLasts": ("tools/setup/wiring.py", "a fault lasts"),
    "save": ("tools/setup/setup.py", "Save them on the robot?"),
    "bothTurn": ("tools/setup/setup.py", "Both wheels turn forward now"),
    "contradiction": ("tools/setup/setup.py", "parameters contradict each other"),
    "noSetpoint": ("tools/setup/driving.py", "no setpoint reaches the robot"),
    "reset": ("tools/setup/driving.py", "the board was reset while"),
    "linkLost": ("tools/setup/driving.py", "the link was lost for a while"),
    "estopPressed": ("tools/setup/driving.py", "the e-stop was pressed"),
    "faultStopped": ("tools/setup/driving.py", "a fault stopped the robot"),
}
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


def _templates(node: ast.AST) -> Iterator[str]:
    """Each text in a source, with {} in place of what is filled in."""
    if isinstance(node, ast.JoinedStr):
        yield "".join(str(p.value) if isinstance(p, ast.Constant) else "{}" for p in node.values)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    else:
        for child in ast.iter_child_nodes(node):
            yield from _templates(child)


def _text(source: str, beginning: str) -> str:
    """The one text of a source that begins like this."""
    tree = ast.parse((HOST / source).read_text("utf-8"))
    found = {text for text in _templates(tree) if text.startswith(beginning)}
    if len(found) != 1:
        raise SystemExit(f"{source} has {len(found)} texts that begin with {beginning!r}, not one")
    return found.pop()


def _extracted(sources: dict[str, tuple[str, str]]) -> dict[str, str]:
    return {key: _text(*where) for key, where in sources.items()}


def _table(name: str, doc: str, rows: Mapping[str, object], kind: str = "") -> str:
    texts = (f"  {key}: {json.dumps(row, ensure_ascii=False)}," for key, row in rows.items())
    head, end = (f"{name}: {kind}", "") if kind else (name, " as const")
    return f"/** {doc} */\nexport const {head} = {{\n{lines(texts)}\n}}{end};"


def words() -> str:
    """The text of words.ts."""
    defects = {
        name: f"{value.name}: {value.remedy}"
        for name, value in vars(problems).items()
        if isinstance(value, problems.Defect)
    }
    highest = {name: round(definition_of(name).maximum) for name in NOT_WATCHING}
    setup = {"raised": wiring.RAISED.text, **_extracted(SETUP)}
    return f"""\
// {banner("What `wheelwire flash` and `setup` say", "host/wheelwire")}

{_table("FLASH", "Of `wheelwire flash`; {} is filled in.", _extracted(FLASH))}

{_table("SETUP", "Of `wheelwire setup`; {} is filled in.", setup)}

{_table("HIGHEST", "The highest values of thresholds that setup raises for a while.", highest)}

{_table("DEFECTS", "What parameters cannot mend; {side} and {detail} are filled in.", defects)}
"""


def _why(name: str, what: str, said: Mapping[str, tuple[str, str]]) -> str:
    rows = {key: dict(zip(("sentence", "lookAt"), one, strict=True)) for key, one in said.items()}
    return _table(name, f"By the name of the {what}.", rows, "Readonly<Record<string, Why>>")


def _stops(name: str, what: str, stops: dict[str, LastStop]) -> str:
    said = {key: last_stop(stop, 0)[0] for key, stop in stops.items()}
    return _why(name, what, {key: (one.sentence, one.look_at) for key, one in said.items()})


def _of(flag: Held) -> LastStop:
    is_bumper = str(flag.name).startswith("BUMPER")
    return LastStop(StopCause.BUMPER if is_bumper else StopCause.CLIFF, held=flag)


def causes() -> str:
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

{_why("WHY_HOST", "cause", host)}
"""


if __name__ == "__main__":
    sys.exit(generated.write({PAGE / "words.ts": words(), PAGE / "causes.ts": causes()}))
