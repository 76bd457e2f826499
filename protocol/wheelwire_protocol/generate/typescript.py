"""The messages and codes for the page in `web/`: types for its compiler, tables for its codec."""

from __future__ import annotations

import json

from ..board import CODES as BOARD_CODES
from ..codes import ENUMERATIONS, FLAGS, RECORDER_CODES, DocumentedEnum, DocumentedFlag, Group
from ..message import Field, Message
from ..messages import MAX_PAYLOAD, MESSAGES, PROTOCOL_VERSION
from ..parameters import PARAMETERS
from .text import banner, blocks, field_note, lines, unit_note
from .wire_layout import layout_hash

_WIDE = ("Q", "q")
"""Formats whose values a JavaScript number does not hold exactly."""


def _type(field: Field) -> str:
    if field.is_text:
        return "Uint8Array"
    return "bigint" if field.format in _WIDE else "number"


def _interface(message: Message) -> str:
    fields = (
        (f"  /** {note} */\n" if (note := field_note(field)) else "")
        + f"  {field.name}: {_type(field)};"
        for field in message.fields
    )
    return f"""\
/** {message.doc} */
export interface {message.name} {{
{lines(fields)}
}}"""


def _layout(message: Message) -> str:
    fields = " ".join(f"{field.name}:{field.format}" for field in message.fields)
    return f"  {message.name}: [0x{message.id:02x}, {json.dumps(fields)}],"


def _codes(codes: type[DocumentedEnum] | type[DocumentedFlag]) -> str:
    """Values and sentences apart, so that a bundle has the sentences that it shows alone."""
    return f"""\
/** {(codes.__doc__ or "").strip()} */
export const {codes.__name__} = {{
{lines(f"  {member.name}: {member.value}," for member in codes)}
}} as const;
export const {codes.__name__}Docs: Sentences<typeof {codes.__name__}> = {{
{lines(f"  {member.name}: {json.dumps(member.doc)}," for member in codes)}
}};"""


def generate() -> str:
    """The text of `protocol.ts`."""
    ids = (f"  /** {p.doc}{unit_note(p.unit)} */\n  {p.name}: {p.id}," for p in PARAMETERS)
    return f"""\
// {banner("Messages and codes")}

export const PROTOCOL_VERSION = {PROTOCOL_VERSION};
/** Of the group BASE: what a hello compares. */
export const SCHEMA_HASH = 0x{layout_hash():08x};
/** Bytes of the longest payload: id, seq, body, CRC. */
export const MAX_PAYLOAD = {MAX_PAYLOAD};

/** What users are shown of each code. */
export type Sentences<Codes> = Readonly<Record<keyof Codes, string>>;

{blocks(map(_codes, (*ENUMERATIONS, *BOARD_CODES, *RECORDER_CODES)))}

{blocks(map(_codes, FLAGS))}

{blocks(map(_interface, MESSAGES))}

/** All messages by name. */
export interface Messages {{
{lines(f"  {message.name}: {message.name};" for message in MESSAGES)}
}}

/** Of each message the id, and its fields with their formats as in Python's `struct`. */
export const LAYOUTS: Readonly<Record<keyof Messages, readonly [number, string]>> = {{
{lines(map(_layout, MESSAGES))}
}};

/** The hash of each group of messages. */
export const GROUP_HASHES: Readonly<Record<keyof typeof Group, number>> = {{
{lines(f"  {group.name}: 0x{layout_hash(group):08x}," for group in Group)}
}};

/** The ids of the parameters. */
export const Parameter = {{
{lines(ids)}
}} as const;

/** Their defaults, in their units. */
export const DEFAULTS = {{
{lines(f"  {p.name}: {p.default:.9g}," for p in PARAMETERS)}
}} as const;
"""
