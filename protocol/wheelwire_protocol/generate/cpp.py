"""The firmware's header: the messages as structs that encode and decode themselves."""

from __future__ import annotations

import enum
from collections.abc import Iterable

from ..board import CODES as BOARD_CODES
from ..codes import ENUMERATIONS, FLAGS, RECORDER_CODES, DocumentedEnum, DocumentedFlag, Group
from ..message import Field, Message
from ..messages import MAX_PAYLOAD, MESSAGES, PROTOCOL_VERSION
from ..parameters import PARAMETERS, PLATFORM_DEFAULTS, Changes, Kind, Parameter
from ..sensors import CODES as SENSOR_CODES
from ..sensors import FLAGS as SENSOR_FLAGS
from .text import banner, constant_name
from .wire_layout import layout_hash

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
    lines = [f"namespace {flags.__name__.lower()} {{"]
    for member in flags:
        lines += [
            f"/// {member.doc}",
            f"constexpr uint32_t {constant_name(member.name or '')} = {member.value};",
        ]
    return [*lines, f"}}  // namespace {flags.__name__.lower()}", ""]


def cpp_member(field: Field, initial: str = "") -> str:
    """A field as a member of a struct."""
    unit = f" [{field.unit.value}]" if field.unit.value else ""
    array = f"[{field.format[:-1]}]" if field.format.endswith("s") else ""
    kind = "char" if array else cpp_type(field)
    return f"  {kind} {field.name}{array}{{{initial}}};  ///< {field.docs}{unit}"


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
    lines = ["enum class ParameterId : uint8_t {"]
    for p in PARAMETERS:
        unit = f" [{p.unit.value}]" if p.unit.value else ""
        lines.append(f"  {constant_name(p.name)} = {p.id},  ///< {p.doc}{unit}")
    lines += ["};", "", "enum class ParameterKind : uint8_t {"]
    lines += [f"  {constant_name(kind.value)}," for kind in Kind]
    lines += [
        "};",
        "",
        "/// When the device takes another value.",
        "enum class ParameterChanges : uint8_t {",
    ]
    lines += [f"  {constant_name(changes.value)}," for changes in Changes]
    lines += [
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
    return lines


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
    lines = [
        "/// Of the layout of a group of messages; 0: there is none.",
        "constexpr uint32_t hash_of(Group group) {",
        "  switch (group) {",
    ]
    for group in Group:
        lines += [
            f"    case Group::{constant_name(group.name)}:",
            f"      return 0x{layout_hash(group):08x};",
        ]
    return [*lines, "  }", "  return 0;", "}", ""]


def _body_sizes() -> list[str]:
    lines = [
        "/// Body size of the message with this id; -1 where there is none.",
        "constexpr int body_size(uint8_t id) {",
        "  switch (id) {",
    ]
    for message in MESSAGES:
        lines += [f"    case {message.name}::kId:", f"      return {message.name}::kSize;"]
    return [*lines, "    default:", "      return -1;", "  }", "}", ""]


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
    ]
    for enumeration in ENUMERATIONS:
        lines += cpp_enumeration(enumeration)
    for flags in FLAGS:
        lines += _flags(flags)
    lines += _group_hashes()
    for enumeration in (*BOARD_CODES, *RECORDER_CODES, *SENSOR_CODES):
        lines += cpp_enumeration(enumeration)
    for flags in SENSOR_FLAGS:
        lines += _flags(flags)
    for message in MESSAGES:
        lines += _message(message)
    lines += _body_sizes()
    lines += _parameters()
    lines += _platform_defaults()
    return "\n".join([*lines, "}  // namespace wheelwire", ""])
