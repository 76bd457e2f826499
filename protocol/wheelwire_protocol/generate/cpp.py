"""The firmware's header: the messages as structs that encode and decode themselves."""

from __future__ import annotations

import enum
from collections.abc import Iterable
from itertools import chain

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
from ..self_test import GROUP as SELF_TEST
from ..self_test import MESSAGES as SELF_TEST_MESSAGES
from ..self_test import PERMISSION
from ..sensors import CODES as SENSOR_CODES
from ..sensors import FLAGS as SENSOR_FLAGS
from .text import banner, constant_name, field_note, unit_note
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


def cpp_enumeration(enumeration: type[DocumentedEnum]) -> list[str]:
    """An enumeration on the wire."""
    return [
        f"enum class {enumeration.__name__} : uint8_t {{",
        *(f"  {constant_name(m.name)} = {m.value},  ///< {m.doc}" for m in enumeration),
        "};",
        "",
    ]


def _flags(flags: type[DocumentedFlag]) -> list[str]:
    return [
        f"namespace {flags.__name__.lower()} {{",
        *(
            f"/// {m.doc}\nconstexpr uint32_t {constant_name(m.name or '')} = {m.value};"
            for m in flags
        ),
        f"}}  // namespace {flags.__name__.lower()}",
        "",
    ]


def cpp_member(field: Field, initial: str = "") -> str:
    """A field as a member of a struct."""
    array = f"[{field.format[:-1]}]" if field.format.endswith("s") else ""
    kind = "char" if array else cpp_type(field)
    note = field_note(field)
    comment = f"  ///< {note}" if note else ""
    return f"  {kind} {field.name}{array}{{{initial}}};{comment}"


def cpp_codec(struct: str, variable: str, fields: Iterable[Field]) -> list[str]:
    """The end of a struct whose fields travel in their order, from its comparison on."""
    names = [field.name for field in fields]
    return [
        f"  bool operator==(const {struct}&) const = default;",
        "",
        "  /// Writes kSize bytes.",
        "  void encode(uint8_t* out) const {",
        *[f"    wire::put(out, {name});" for name in names],
        "  }",
        "",
        "  /// Reads kSize bytes.",
        f"  static {struct} decode(const uint8_t* in) {{",
        f"    {struct} {variable};",
        *[f"    wire::get(in, {variable}.{name});" for name in names],
        f"    return {variable};",
        "  }",
        "};",
        "",
    ]


def _message(message: Message) -> list[str]:
    return [
        f"/// {message.doc}",
        f"struct {message.name} {{",
        f"  static constexpr uint8_t kId = 0x{message.id:02x};",
        f"  static constexpr size_t kSize = {message.body_size};",
        "",
        *[cpp_member(field) for field in message.fields],
        "",
        *cpp_codec(message.name, "message", message.fields),
    ]


def cpp_number(value: float) -> str:
    """A float's literal."""
    text = f"{value:.9g}"
    return text + ("f" if any(c in text for c in ".e") else ".0f")


def _parameter_row(parameter: Parameter) -> str:
    kind = constant_name(parameter.kind.value)
    changes = constant_name(parameter.changes.value)
    codes = f"ParameterKind::{kind}, ParameterChanges::{changes}"
    numbers = ", ".join(map(cpp_number, (parameter.default, parameter.minimum, parameter.maximum)))
    return f"    {{ParameterId::{constant_name(parameter.name)}, {codes}, {numbers}}},"


def _parameters() -> list[str]:
    return [
        "enum class ParameterId : uint8_t {",
        *(
            f"  {constant_name(p.name)} = {p.id},  ///< {p.doc}{unit_note(p.unit)}"
            for p in PARAMETERS
        ),
        "};",
        "",
        "enum class ParameterKind : uint8_t {",
        *(f"  {constant_name(kind.value)}," for kind in Kind),
        "};",
        "",
        "/// When the device takes another value.",
        "enum class ParameterChanges : uint8_t {",
        *(f"  {constant_name(changes.value)}," for changes in Changes),
        "};",
        "",
        "struct ParameterSpec {",
        "  ParameterId id;",
        "  ParameterKind kind;",
        "  ParameterChanges changes;",
        "  float default_value;",
        "  float minimum;",
        "  float maximum;",
        "};",
        "",
        f"constexpr size_t kParameterCount = {len(PARAMETERS)};",
        "constexpr ParameterSpec kParameters[kParameterCount] = {",
        *[_parameter_row(p) for p in PARAMETERS],
        "};",
        "",
    ]


def _platform_defaults() -> list[str]:
    rows = [
        f"    {{Chip::{constant_name(board.name)}, ParameterId::{constant_name(name)}, "
        f"{cpp_number(value)}}},"
        for board, defaults in PLATFORM_DEFAULTS.items()
        for name, value in defaults.items()
    ]
    return [
        "struct PlatformDefault {",
        "  Chip board;",
        "  ParameterId id;",
        "  float value;",
        "};",
        "",
        "/// Where a board's defaults differ from those of kParameters.",
        "constexpr PlatformDefault kPlatformDefaults[] = {",
        *rows,
        "};",
        "",
    ]


def _group_hashes() -> list[str]:
    return [
        "/// Of the layout of a group of messages; 0: there is none.",
        "constexpr uint32_t hash_of(Group group) {",
        "  switch (group) {",
        *(
            f"    case Group::{constant_name(g.name)}:\n      return 0x{layout_hash(g):08x};"
            for g in Group
        ),
        "  }",
        "  return 0;",
        "}",
        "",
    ]


def _groups() -> list[str]:
    return [
        "/// The group of the message with this id; kBase also where there is none.",
        "constexpr Group group_of(uint8_t id) {",
        "  switch (id) {",
        *(
            f"    case {m.name}::kId:\n      return Group::{constant_name(m.group.name)};"
            for m in MESSAGES
            if m.group is not Group.BASE
        ),
        "    default:",
        "      return Group::kBase;",
        "  }",
        "}",
        "",
    ]


def _body_sizes(function: str, messages: Iterable[Message]) -> list[str]:
    return [
        "/// Body size of the message with this id; -1 where there is none.",
        f"constexpr int {function}(uint8_t id) {{",
        "  switch (id) {",
        *(f"    case {m.name}::kId:\n      return {m.name}::kSize;" for m in messages),
        "    default:",
        "      return -1;",
        "  }",
        "}",
        "",
    ]


def generate() -> str:
    """The text of `protocol.hpp`."""
    lines = [
        f"// {banner('Messages and codes')}",
        "#pragma once",
        "",
        "#include <stddef.h>",
        "#include <stdint.h>",
        "",
        '#include "wire.hpp"',
        "",
        "namespace wheelwire {",
        "",
        "namespace schema {",
        f"constexpr uint16_t kVersion = {PROTOCOL_VERSION};",
        f"constexpr uint32_t kHash = 0x{layout_hash():08x};",
        "}  // namespace schema",
        "",
        "/// Bytes of the longest payload: id, seq, body, CRC.",
        f"constexpr size_t kMaxPayload = {MAX_PAYLOAD};",
        "",
        *chain.from_iterable(map(cpp_enumeration, ENUMERATIONS)),
        *chain.from_iterable(map(_flags, FLAGS)),
        *_group_hashes(),
        *chain.from_iterable(map(cpp_enumeration, (*BOARD_CODES, *RECORDER_CODES, *SENSOR_CODES))),
        *chain.from_iterable(map(_flags, SENSOR_FLAGS)),
        *chain.from_iterable(map(_message, MESSAGES)),
        *_body_sizes("body_size", MESSAGES),
        *_groups(),
        *_parameters(),
        *_platform_defaults(),
        "}  // namespace wheelwire",
        "",
    ]
    return "\n".join(lines)


def generate_self_test() -> str:
    """The text of `self_test_protocol.hpp`."""
    lines = [
        f"// {banner('Messages of the self-test image')}",
        "#pragma once",
        "",
        '#include "protocol.hpp"',
        "",
        "namespace wheelwire {",
        "",
        f"constexpr uint8_t kSelfTestGroup = {SELF_TEST};",
        f"constexpr uint32_t kSelfTestHash = 0x{self_test_hash():08x};",
        f"constexpr uint32_t kSelfTestPermission = 0x{PERMISSION:08x};",
        "",
        *cpp_enumeration(Failure),
        *chain.from_iterable(map(_message, SELF_TEST_MESSAGES)),
        *_body_sizes("self_test_body_size", SELF_TEST_MESSAGES),
        "}  // namespace wheelwire",
        "",
    ]
    return "\n".join(lines)
