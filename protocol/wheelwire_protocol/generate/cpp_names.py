"""The explorer's header: messages and codes in words."""

from __future__ import annotations

from ..codes import (
    ConfigurationState,
    DocumentedEnum,
    RefusalCode,
    SupervisorEvent,
    SupervisorState,
)
from ..messages import MESSAGES
from .text import banner, constant_name

NAMED = (RefusalCode, SupervisorState, SupervisorEvent, ConfigurationState)


def _names(enumeration: type[DocumentedEnum]) -> list[str]:
    """A function from a code to its name; a code that has none is told by its number."""
    name = enumeration.__name__
    return [
        f"inline std::string name_of({name} code) {{",
        "  switch (code) {",
        *(
            f'    case {name}::{constant_name(m.name)}:\n      return "{m.name}";'
            for m in enumeration
        ),
        "  }",
        '  return "code " + std::to_string(static_cast<int>(code));',
        "}",
        "",
    ]


def generate() -> str:
    """The text of `protocol_names.hpp`."""
    answers = {m: f"{m.answer or 'Ack'}::kId" if m.is_request else "0" for m in MESSAGES}
    lines = [
        f"// {banner('Names on the wire')}",
        "#pragma once",
        "",
        "#include <string>",
        "",
        '#include "protocol.hpp"',
        "",
        "namespace wheelwire {",
        "",
        "struct MessageName {",
        "  uint8_t id;",
        "  const char* name;",
        "  uint8_t answer;  ///< Of a request: the message that answers it.",
        "};",
        "",
        "constexpr MessageName kMessageNames[] = {",
        *(f'    {{{m.name}::kId, "{m.name}", {answer}}},' for m, answer in answers.items()),
        "};",
        "",
        *(line for enumeration in NAMED for line in _names(enumeration)),
        "}  // namespace wheelwire",
        "",
    ]
    return "\n".join(lines)
