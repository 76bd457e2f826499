"""What SPEC.md says in numbers is what the code does."""

import json
import re
from pathlib import Path

from wheelwire_protocol.codec import MIN_PAYLOAD
from wheelwire_protocol.framing import CRC_RESIDUE, SEQ_MODULUS
from wheelwire_protocol.messages import MAX_PAYLOAD, MESSAGES
from wheelwire_protocol.python_decoder import REPEAT_WINDOW

PROTOCOL = Path(__file__).parents[3] / "protocol"
SPEC = (PROTOCOL / "SPEC.md").read_text("utf-8")
ONE_LINE = " ".join(SPEC.split())


def test_worked_example_is_the_handmade_frame() -> None:
    vector = json.loads((PROTOCOL / "vectors/handmade.json").read_text("utf-8"))["frames"][0]
    blocks = [block.strip() for block in re.findall(r"```\n(.*?)```", SPEC, re.DOTALL)]
    assert vector["payload"] in blocks
    assert vector["frame"] in blocks


def test_steps_of_the_worked_example_add_up() -> None:
    example = SPEC.split("### One frame by hand")[1].split("\n## ")[0]
    fields = re.findall(r"^\| \w+ \| \w+ \| `([0-9a-f ]+)` \|$", example, re.MULTILINE)
    register = dict(zip(*steps(example), strict=True))
    covered = bytes.fromhex("".join(fields))
    assert list(register) == [covered[: end + 1] for end in range(len(covered))]
    for prefix, value in register.items():
        assert value == bitwise_register(prefix)
    encoded = re.findall(r"^\| (?:`[0-9a-f ]+`|empty) \| `([0-9a-f ]+)` \|$", example, re.MULTILINE)
    frame = f"00 {' '.join(encoded)} 00"
    assert f"```\n{frame}\n```" in example


def steps(example: str) -> tuple[list[bytes], list[int]]:
    """Every prefix of the covered bytes, and the register that the page gives after it."""
    found = re.findall(r"\b([0-9a-f]{2}): ([0-9a-f]{8})\b", example)
    data = bytes.fromhex("".join(byte for byte, _ in found))
    return [data[: end + 1] for end in range(len(data))], [int(value, 16) for _, value in found]


def bitwise_register(data: bytes) -> int:
    """CRC-32 as the page describes it, before the final XOR."""
    register = 0xFFFFFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xEDB88320 if register & 1 else 0)
    return register


def test_limits() -> None:
    assert f"Payloads are at most {MAX_PAYLOAD} bytes" in ONE_LINE
    assert f"shorter than {MIN_PAYLOAD} bytes decoded" in ONE_LINE
    assert f"always 0x{CRC_RESIDUE:08x}" in ONE_LINE
    assert f"(at most {REPEAT_WINDOW} behind)" in ONE_LINE
    assert f"modulo {SEQ_MODULUS}" in ONE_LINE


def test_frozen_messages() -> None:
    listed = re.search(r"\*\*([\w, ]+) keep their layout", ONE_LINE)
    assert listed
    assert set(re.split(r", | and ", listed[1])) == {m.name for m in MESSAGES if m.frozen}


def test_every_request_is_in_the_table_of_requests() -> None:
    table = SPEC.split("| request | answer |")[1].split("\n\n")[0]
    listed = " ".join(re.findall(r"^\| ([\w, ]+) \|", table, re.MULTILINE))
    from_host = [message for message in MESSAGES if not message.from_device]
    assert set(re.findall(r"\w+", listed)) == {
        message.name
        for message in from_host
        if any(field.name == "request_id" for field in message.fields)
    }
