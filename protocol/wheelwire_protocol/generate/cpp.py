"""The firmware's header: the messages as structs that encode and decode themselves.

clang-format indents what this writes.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Sequence

from ..board import CODES as BOARD_CODES
from ..codes import (
    ENUMERATIONS,
    FLAGS,
    RECORDER_CODES,
    DocumentedEnum,
    DocumentedFlag,
    Failure,
    Group,
)
from ..message import Field, Message
from ..messages import MAX_PAYLOAD, MESSAGES, PROTOCOL_VERSION
from ..parameters import PARAMETERS, PLATFORM_DEFAULTS, Changes, Kind, Parameter
from ..peripherals import CODES as SENSOR_CODES
from ..peripherals import FLAGS as SENSOR_FLAGS
from ..self_test import GROUP as SELF_TEST
from ..self_test import MESSAGES as SELF_TEST_MESSAGES
from ..self_test import PERMISSION
from .text import banner, blocks, constant_name, field_note, lines, unit_note
from .wire_layout import layout_hash, self_test_hash

_CPP_TYPES = {
    "B": "uint8_t",
    "b": "int8_t",
    "H": "uint16_t",
    "h": "int16_t",
    "L": "uint32_t",
    "l": "int32_t",
    "Q": "uint64_t",
    "f": "float",
}


def cpp_type(field: Field) -> str:
    """The C++ type of a field. Codes are typed; flags stay numbers, to be masked."""
    if field.enumeration and not issubclass(field.enumeration, enum.IntFlag):
        return field.enumeration.__name__
    return _CPP_TYPES[field.format]


def cpp_header(what: str, include: str, parts: Iterable[str]) -> str:
    """A header with these parts.

    Args:
        what: It holds.
        include: What it includes.
        parts: Parted by blank lines.
    """
    return f"""\
// {banner(what)}
#pragma once

{include}

namespace wheelwire {{

{blocks(parts)}

}}  // namespace wheelwire
"""


def cpp_enum(name: str, members: Iterable[str]) -> str:
    """An enumeration; a member has its comma, and what follows it."""
    return f"enum class {name} : uint8_t {{\n{lines(members)}\n}};"


def cpp_enumeration(enumeration: type[DocumentedEnum]) -> str:
    """An enumeration on the wire."""
    members = (f"{constant_name(m.name)} = {m.value},  ///< {m.doc}" for m in enumeration)
    return cpp_enum(enumeration.__name__, members)


def _flags(flags: type[DocumentedFlag]) -> str:
    namespace = flags.__name__.lower()
    members = (
        f"/// {m.doc}\nconstexpr uint32_t {constant_name(m.name or '')} = {m.value};" for m in flags
    )
    return f"namespace {namespace} {{\n{lines(members)}\n}}  // namespace {namespace}"


def cpp_switch(signature: str, cases: Iterable[tuple[str, str]], otherwise: str) -> str:
    """A function that switches by its parameter.

    Args:
        signature: What it is, its result, name and parameter.
        cases: A value of the parameter, and the result.
        otherwise: The result of other values; for an enumeration there is no default, so that a
            compiler reports a case that is missing.
    """
    kind, parameter = signature.partition("(")[2].partition(")")[0].split()
    other = f"return {otherwise};"
    default, end = (f"default: {other}", "") if kind == "uint8_t" else ("", other)
    return f"""\
{signature} {{
switch ({parameter}) {{
{lines(f"case {case}: return {result};" for case, result in cases)}
{default}
}}
{end}
}}"""


def cpp_is_one_of(signature: str, doc: str, members: Iterable[DocumentedEnum]) -> str:
    """A function that is true for these members of an enumeration, its only parameter."""
    kind, parameter = signature.partition("(")[2].rstrip(")").split()
    tests = " || ".join(f"{parameter} == {kind}::{constant_name(m.name)}" for m in members)
    return f"/// {doc}\nconstexpr bool {signature} {{\nreturn {tests};\n}}"


def _member(field: Field, pin: str) -> str:
    array = f"[{field.format[:-1]}]" if field.is_text else ""
    kind = "char" if array else cpp_type(field)
    initial = pin if field.format == "b" else ""
    note = field_note(field)
    comment = f"  ///< {note}" if note else ""
    return f"{kind} {field.name}{array}{{{initial}}};{comment}"


def cpp_struct(
    name: str,
    variable: str,
    fields: Sequence[Field],
    constants: str,
    *,
    methods: str = "",
    pin: str = "",
) -> str:
    """A struct whose fields travel in their order.

    Args:
        name: Of the struct.
        variable: The name of one that is being read.
        fields: Its members.
        constants: Before the members.
        methods: Behind them, with a blank line at their end.
        pin: What the number of a GPIO is at first.
    """
    return f"""\
struct {name} {{
{constants}

{lines(_member(field, pin) for field in fields)}

{methods}bool operator==(const {name}&) const = default;

/// Writes kSize bytes.
void encode(uint8_t* out) const {{
{lines(f"wire::put(out, {field.name});" for field in fields)}
}}

/// Reads kSize bytes.
static {name} decode(const uint8_t* in) {{
{name} {variable};
{lines(f"wire::get(in, {variable}.{field.name});" for field in fields)}
return {variable};
}}
}};"""


def _message(message: Message) -> str:
    constants = f"""\
static constexpr uint8_t kId = 0x{message.id:02x};
static constexpr size_t kSize = {message.body_size};"""
    return f"/// {message.doc}\n{cpp_struct(message.name, 'message', message.fields, constants)}"


def cpp_number(value: float) -> str:
    """A float's literal."""
    text = f"{value:.9g}"
    return text + ("f" if any(c in text for c in ".e") else ".0f")


def _parameter_row(parameter: Parameter) -> str:
    kind = constant_name(parameter.kind.value)
    changes = constant_name(parameter.changes.value)
    codes = f"ParameterKind::{kind}, ParameterChanges::{changes}"
    numbers = ", ".join(map(cpp_number, (parameter.default, parameter.minimum, parameter.maximum)))
    return f"{{ParameterId::{constant_name(parameter.name)}, {codes}, {numbers}}},"


def _parameters() -> str:
    ids = (
        f"{constant_name(p.name)} = {p.id},  ///< {p.doc}{unit_note(p.unit)}" for p in PARAMETERS
    )
    defaults = (
        f"{{Chip::{constant_name(board.name)}, ParameterId::{constant_name(name)}, "
        f"{cpp_number(value)}}},"
        for board, defaults in PLATFORM_DEFAULTS.items()
        for name, value in defaults.items()
    )
    return f"""\
{cpp_enum("ParameterId", ids)}

{cpp_enum("ParameterKind", (f"{constant_name(kind.value)}," for kind in Kind))}

/// When the device takes another value.
{cpp_enum("ParameterChanges", (f"{constant_name(changes.value)}," for changes in Changes))}

struct ParameterSpec {{
  ParameterId id;
  ParameterKind kind;
  ParameterChanges changes;
  float default_value;
  float minimum;
  float maximum;
}};

constexpr size_t kParameterCount = {len(PARAMETERS)};
constexpr ParameterSpec kParameters[kParameterCount] = {{
{lines(map(_parameter_row, PARAMETERS))}
}};

struct PlatformDefault {{
  Chip board;
  ParameterId id;
  float value;
}};

/// Where a board's defaults differ from those of kParameters.
constexpr PlatformDefault kPlatformDefaults[] = {{
{lines(defaults)}
}};"""


def _group_hashes() -> str:
    hashes = ((f"Group::{constant_name(g.name)}", f"0x{layout_hash(g):08x}") for g in Group)
    function = cpp_switch("constexpr uint32_t hash_of(Group group)", hashes, "0")
    return f"/// Of the layout of a group of messages; 0: there is none.\n{function}"


def _groups() -> str:
    groups = (
        (f"{m.name}::kId", f"Group::{constant_name(m.group.name)}")
        for m in MESSAGES
        if m.group is not Group.BASE
    )
    function = cpp_switch("constexpr Group group_of(uint8_t id)", groups, "Group::kBase")
    return f"/// The group of the message with this id; kBase also where there is none.\n{function}"


def _body_sizes(function: str, messages: Iterable[Message]) -> str:
    sizes = ((f"{m.name}::kId", f"{m.name}::kSize") for m in messages)
    text = cpp_switch(f"constexpr int {function}(uint8_t id)", sizes, "-1")
    return f"/// Body size of the message with this id; -1 where there is none.\n{text}"


def generate() -> str:
    """The text of `protocol.hpp`."""
    include = """\
#include <stddef.h>
#include <stdint.h>

#include "wire.hpp"
"""
    schema = f"""\
namespace schema {{
constexpr uint16_t kVersion = {PROTOCOL_VERSION};
constexpr uint32_t kHash = 0x{layout_hash():08x};
}}  // namespace schema

/// Bytes of the longest payload: id, seq, body, CRC.
constexpr size_t kMaxPayload = {MAX_PAYLOAD};"""
    parts = (
        schema,
        *map(cpp_enumeration, ENUMERATIONS),
        *map(_flags, FLAGS),
        _group_hashes(),
        *map(cpp_enumeration, (*BOARD_CODES, *RECORDER_CODES, *SENSOR_CODES)),
        *map(_flags, SENSOR_FLAGS),
        *map(_message, MESSAGES),
        _body_sizes("body_size", MESSAGES),
        _groups(),
        _parameters(),
    )
    return cpp_header("Messages and codes", include, parts)


def generate_self_test() -> str:
    """The text of `self_test_protocol.hpp`."""
    constants = f"""\
constexpr uint8_t kSelfTestGroup = {SELF_TEST};
constexpr uint32_t kSelfTestHash = 0x{self_test_hash():08x};
constexpr uint32_t kSelfTestPermission = 0x{PERMISSION:08x};"""
    parts = (
        constants,
        cpp_enumeration(Failure),
        *map(_message, SELF_TEST_MESSAGES),
        _body_sizes("self_test_body_size", SELF_TEST_MESSAGES),
    )
    return cpp_header("Messages of the self-test image", '#include "protocol.hpp"', parts)
