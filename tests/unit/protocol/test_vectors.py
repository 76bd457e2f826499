"""The vectors, in Python; firmware/esp32/test runs the same ones in C++."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from support.cases import each
from wheelwire_protocol import types
from wheelwire_protocol.decoder import NativeDecoder
from wheelwire_protocol.framing import encode_frame, encode_payload
from wheelwire_protocol.messages import MESSAGES
from wheelwire_protocol.python_decoder import PythonDecoder

DECODERS = (PythonDecoder, NativeDecoder)
VECTORS = Path(__file__).parents[3] / "protocol/vectors"
HANDMADE = json.loads((VECTORS / "handmade.json").read_text("utf-8"))
GENERATED = json.loads((VECTORS / "generated.json").read_text("utf-8"))


def name(vector: dict[str, Any]) -> str:
    return f"{vector.get('message', 'stream')}, {vector['name']}"


def message(vector: dict[str, Any]) -> types.AnyMessage:
    kind = getattr(types, vector["message"])
    values = {
        name: bytes.fromhex(value) if isinstance(value, str) else value
        for name, value in vector["fields"].items()
    }
    made: types.AnyMessage = kind(**values)
    return made


@each("vector", HANDMADE["frames"] + GENERATED["frames"], ids=name)
def test_frame(vector: dict[str, Any]) -> None:
    payload, frame = bytes.fromhex(vector["payload"]), bytes.fromhex(vector["frame"])
    assert encode_payload(message(vector), vector["seq"]) == payload
    assert encode_frame(message(vector), vector["seq"]) == frame
    for decoder in DECODERS:
        assert decoder().feed(frame) == [message(vector)]


@each("stream", HANDMADE["streams"], ids=name)
@each("make", DECODERS)
def test_stream_split_anywhere(
    stream: dict[str, Any], make: type[PythonDecoder | NativeDecoder]
) -> None:
    data = bytes.fromhex("".join(stream["bytes"]))
    for split in range(len(data) + 1):
        decoder = make()
        delivered = decoder.feed(data[:split]) + decoder.feed(data[split:])
        assert delivered == [message(expected) for expected in stream["delivered"]]
        counted = {counter: count for counter, count in asdict(decoder.counters).items() if count}
        assert counted == stream["counters"]


def test_every_message_has_vectors() -> None:
    assert {vector["message"] for vector in GENERATED["frames"]} == {m.name for m in MESSAGES}


def test_every_counter_has_a_stream() -> None:
    counted = {counter for stream in HANDMADE["streams"] for counter in stream["counters"]}
    assert counted == set(asdict(PythonDecoder().counters))
