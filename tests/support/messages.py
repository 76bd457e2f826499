"""Hypothesis strategies: messages with any values, and damaged captures."""

from __future__ import annotations

import struct
from functools import partial
from typing import Any

from hypothesis import strategies as st

from wheelwire_protocol.codec import BY_ID, BY_TYPE
from wheelwire_protocol.framing import encode_frame
from wheelwire_protocol.message import Field, Message
from wheelwire_protocol.messages import MESSAGES
from wheelwire_protocol.types import AnyMessage

definitions = st.sampled_from(MESSAGES)
seqs = st.integers(0, 0xFFFF)
_DEFINITIONS = {BY_ID[definition.id].type: definition for definition in MESSAGES}


def values_of(field: Field, *, allow_nan: bool = False) -> st.SearchStrategy[Any]:
    """Any value of a field; by default not NaN, which is not equal to itself."""
    if field.is_text:
        length = field.subcon.length
        return st.binary(max_size=length).map(lambda text: text.ljust(length, b"\0"))
    if field.format == "f":
        return st.floats(width=32, allow_nan=allow_nan)
    bits = 8 * struct.calcsize("<" + field.format)
    low = 0 if field.format.isupper() else -(2 ** (bits - 1))
    return st.integers(low, low + 2**bits - 1)


def bodies(definition: Message, *, allow_nan: bool = False) -> st.SearchStrategy[dict[str, Any]]:
    """Field names to values, for a message's definition."""
    values = {field.name: values_of(field, allow_nan=allow_nan) for field in definition.fields}
    return st.fixed_dictionaries(values)


def messages_of(
    message_type: type[AnyMessage], *, allow_nan: bool = False
) -> st.SearchStrategy[Any]:
    """Any message of one class."""
    body = bodies(_DEFINITIONS[message_type], allow_nan=allow_nan)
    return body.map(lambda values: message_type(**values))


_TYPES = st.sampled_from(list(BY_TYPE))
any_message: st.SearchStrategy[AnyMessage] = _TYPES.flatmap(messages_of)
any_message_or_nan: st.SearchStrategy[AnyMessage] = _TYPES.flatmap(
    partial(messages_of, allow_nan=True)
)


@st.composite
def corrupted_captures(
    draw: st.DrawFn, messages: st.SearchStrategy[AnyMessage] = any_message
) -> bytes:
    """A sequence of frames with bytes changed, lost, doubled and inserted anywhere."""
    sent = draw(st.lists(messages, max_size=12))
    data = bytearray().join(encode_frame(message, seq) for seq, message in enumerate(sent))
    for _ in range(draw(st.integers(0, 6))):
        at = draw(st.integers(0, len(data)))
        kept = draw(st.integers(0, 3))
        data[at : at + kept] = draw(st.binary(max_size=4))
    return bytes(data)
