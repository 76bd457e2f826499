"""Write web/src/generated/words.ts: the sentences of `wheelwire flash` and `setup`, for the page.

The script finds each in the command's source by its first words, so no sentence is written twice.

tools/write_page_words.py            writes the file
tools/write_page_words.py --check    fails when it is not what the commands say
"""

from __future__ import annotations

import ast
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import generated
from generated import ROOT
from wheelwire.parameters import definition_of
from wheelwire.tools.setup import problems, wiring
from wheelwire_protocol.generate.text import banner, lines

NOT_WATCHING = ("reversal_duty", "rolling_velocity_mps")
"""Thresholds that setup raises to their maximum for a while."""
WORDS = ROOT / "web" / "src" / "generated" / "words.ts"
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


def _templates(path: Path) -> Iterator[str]:
    """Each text in a source, with {} in place of what is filled in."""
    tree = ast.parse(path.read_text("utf-8"))
    inner = {
        id(part)
        for node in ast.walk(tree)
        if isinstance(node, ast.JoinedStr)
        for part in node.values
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(
                str(p.value) if isinstance(p, ast.Constant) else "{}" for p in node.values
            )
        elif (
            isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inner
        ):
            yield node.value


def _text(source: str, beginning: str) -> str:
    """The one text of a source that begins like this."""
    found = {text for text in _templates(HOST / source) if text.startswith(beginning)}
    if len(found) != 1:
        raise SystemExit(f"{source} has {len(found)} texts that begin with {beginning!r}, not one")
    return found.pop()


def _table(name: str, doc: str, rows: dict[str, str]) -> str:
    texts = (f"  {key}: {json.dumps(text, ensure_ascii=False)}," for key, text in rows.items())
    return f"/** {doc} */\nexport const {name} = {{\n{lines(texts)}\n}} as const;"


def _extracted(sources: dict[str, tuple[str, str]]) -> dict[str, str]:
    return {key: _text(*where) for key, where in sources.items()}


def words() -> str:
    """The text of words.ts."""
    defects = {
        name: f"{value.name}: {value.remedy}"
        for name, value in vars(problems).items()
        if isinstance(value, problems.Defect)
    }
    setup = {"raised": wiring.RAISED.text, **_extracted(SETUP)}
    highest = (f"  {name}: {definition_of(name).maximum:g}," for name in NOT_WATCHING)
    return f"""\
// {banner("What `wheelwire flash` and `setup` say", "host/wheelwire")}

{_table("FLASH", "Of `wheelwire flash`; {} is filled in.", _extracted(FLASH))}

{_table("SETUP", "Of `wheelwire setup`; {} is filled in.", setup)}

/** The highest values of thresholds that setup raises for a while. */
export const HIGHEST = {{
{lines(highest)}
}} as const;

{_table("DEFECTS", "What parameters cannot mend; {side} and {detail} are filled in.", defects)}
"""


if __name__ == "__main__":
    sys.exit(generated.write({WORDS: words()}))
