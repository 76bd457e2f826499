"""The vectors as a C++ header, for the firmware's unit tests."""

from __future__ import annotations

import json
import re
from typing import Any

from ..message import Field
from ..messages import MESSAGES
from .cpp import cpp_type
from .text import banner, lines

_BY_NAME = {message.name: message for message in MESSAGES}

_COUNTS = ("frames", "bad_crc", "bad_cobs", "unknown_id", "wrong_length", "seq_lost", "repeated")

_HEAD = """\
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "framing.hpp"
#include "protocol.hpp"

namespace wheelwire::vectors {

/// As std::span, which bare-metal tool chains without a C++ library do not have.
class Bytes {
 public:
  template <size_t kSize>
  constexpr Bytes(const uint8_t (&bytes)[kSize]) : begin_(bytes), end_(bytes + kSize) {}

  constexpr const uint8_t* begin() const { return begin_; }
  constexpr const uint8_t* end() const { return end_; }

 private:
  const uint8_t* begin_;
  const uint8_t* end_;
};

/// Bytes from a line, and what a receiver of the host's messages has counted after them.
struct Stream {
  const char* name;
  Bytes bytes;
  ReceiveCounters counters;
};

// One vector a line.
// clang-format off
"""


def _literal(field: Field, value: float | str) -> str:
    if field.is_text:  # in hexadecimal
        letters = (f"static_cast<char>(0x{byte:02x})" for byte in bytes.fromhex(str(value)))
        return "{" + ", ".join(letters) + "}"
    if field.format == "f":
        return f"{float(value)!r}f"
    number = f"{value}u" if field.format.isupper() else str(value)
    if cpp_type(field) == getattr(field.enumeration, "__name__", None):
        return f"static_cast<{cpp_type(field)}>({number})"
    return number


def _array(name: str, data: bytes) -> str:
    return f"inline constexpr uint8_t {name}[] = {{{', '.join(f'0x{b:02x}' for b in data)}}};"


def _array_name(prefix: str, words: str) -> str:
    return f"k{prefix}" + "".join(word.capitalize() for word in re.findall(r"\w+", words))


def _frame(vector: dict[str, Any]) -> tuple[str, str]:
    """The array of a frame, and the call that visits it."""
    message = _BY_NAME[vector["message"]]
    name = f"{message.name}, {vector['name']}"
    array = _array_name(message.name, vector["name"])
    members = ", ".join(
        f".{field.name} = {_literal(field, vector['fields'][field.name])}"
        for field in message.fields
    )
    call = (
        f'  visit("{name}", {message.name}{{{members}}}, uint16_t{{{vector["seq"]}}}, '
        f"Bytes({array}));"
    )
    return _array(array, bytes.fromhex(vector["frame"])), call


def _stream(stream: dict[str, Any]) -> tuple[str, str]:
    """The array of a stream's bytes, and its row in the table."""
    array = _array_name("Stream", stream["name"])
    counters = ", ".join(f".{name} = {stream['counters'].get(name, 0)}" for name in _COUNTS)
    row = f'    {{.name = "{stream["name"]}", .bytes = {array}, .counters = {{{counters}}}}},'
    return _array(array, bytes.fromhex("".join(stream["bytes"]))), row


def generate(handmade: str, generated: str) -> str:
    """The text of `vectors.hpp`.

    Args:
        handmade: The text of `handmade.json`.
        generated: The text of `generated.json`.
    """
    by_hand = json.loads(handmade)
    frames = [_frame(vector) for vector in by_hand["frames"] + json.loads(generated)["frames"]]
    streams = [_stream(stream) for stream in by_hand["streams"]]
    return f"""\
// {banner("Vectors", "protocol/vectors")}
{_HEAD}
{lines(array for array, _ in frames + streams)}

/// Calls visit(name, message, seq, frame) for every vector; `message` has its own type.
template <typename Visit>
void for_each_frame(Visit&& visit) {{
{lines(call for _, call in frames)}
}}

inline constexpr Stream kStreams[] = {{
{lines(row for _, row in streams)}
}};
// clang-format on

}}  // namespace wheelwire::vectors
"""
