"""The explorer's header: messages and codes in words."""

from __future__ import annotations

from ..codes import (
    ConfigurationState,
    DocumentedEnum,
    RefusalCode,
    SupervisorEvent,
    SupervisorState,
)
from ..message import Message
from ..messages import MESSAGES
from .cpp import cpp_header, cpp_switch
from .text import constant_name, lines

NAMED = (RefusalCode, SupervisorState, SupervisorEvent, ConfigurationState)


def _row(message: Message) -> str:
    answer = f"{message.answer or 'Ack'}::kId" if message.is_request else "0"
    return f'{{{message.name}::kId, "{message.name}", {answer}}},'


def _names(enumeration: type[DocumentedEnum]) -> str:
    """A function from a code to its name; a code that has none is told by its number."""
    name = enumeration.__name__
    cases = ((f"{name}::{constant_name(m.name)}", f'"{m.name}"') for m in enumeration)
    other = '"code " + std::to_string(static_cast<int>(code))'
    return cpp_switch(f"inline std::string name_of({name} code)", cases, other)


def generate() -> str:
    """The text of `protocol_names.hpp`."""
    table = f"""\
struct MessageName {{
uint8_t id;
const char* name;
uint8_t answer;  ///< Of a request: the message that answers it.
}};

constexpr MessageName kMessageNames[] = {{
{lines(map(_row, MESSAGES))}
}};"""
    include = '#include <string>\n\n#include "protocol.hpp"'
    return cpp_header("Names on the wire", include, (table, *map(_names, NAMED)))
