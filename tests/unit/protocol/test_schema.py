from dataclasses import replace
from typing import Any

import pytest
from construct import Int16ul, Int32ul

from wheelwire_protocol import schema_hash
from wheelwire_protocol.codes import Group, Unit
from wheelwire_protocol.generate import wire_layout
from wheelwire_protocol.message import Field, Message
from wheelwire_protocol.messages import MESSAGES
from wheelwire_protocol.parameters import PARAMETERS


def hash_with(monkeypatch: pytest.MonkeyPatch, name: str, value: Any) -> int:
    monkeypatch.setattr(wire_layout, name, value)
    return wire_layout.layout_hash()


def test_the_hash_is_that_of_the_definitions() -> None:
    assert schema_hash() == wire_layout.layout_hash()


def ping(subcon: Any, name: str, unit: Unit, doc: str) -> Message:
    field = Field(subcon, doc, unit=unit, name=name)
    return Message(id=0x1F, name="P", doc=doc, fields=(field,))


PING = ping(Int32ul, "host_us", Unit.MICROSECOND, "a doc")


def test_hash_ignores_prose(monkeypatch: pytest.MonkeyPatch) -> None:
    before = hash_with(monkeypatch, "MESSAGES", (PING,))
    again = ping(Int32ul, "host_us", Unit.MICROSECOND, "another doc")
    assert hash_with(monkeypatch, "MESSAGES", (again,)) == before
    reworded = tuple(parameter._replace(doc="another doc") for parameter in PARAMETERS)
    assert hash_with(monkeypatch, "PARAMETERS", reworded) == before


@pytest.mark.parametrize(
    "changed",
    [
        ping(Int16ul, "host_us", Unit.MICROSECOND, "a doc"),
        ping(Int32ul, "host_ms", Unit.MICROSECOND, "a doc"),
        replace(PING, id=0x1E),
        replace(PING, name="Q"),
    ],
    ids=["type", "field", "id", "message"],
)
def test_hash_changes_with_layout(changed: Message, monkeypatch: pytest.MonkeyPatch) -> None:
    before = hash_with(monkeypatch, "MESSAGES", (PING,))
    assert hash_with(monkeypatch, "MESSAGES", (changed,)) != before


def test_hash_changes_with_a_parameter(monkeypatch: pytest.MonkeyPatch) -> None:
    before = schema_hash()
    renamed = (PARAMETERS[0]._replace(name="radius"), *PARAMETERS[1:])
    assert hash_with(monkeypatch, "PARAMETERS", renamed) != before


@pytest.mark.parametrize("group", list(wire_layout.CODES))
def test_hash_changes_with_a_code(monkeypatch: pytest.MonkeyPatch, group: Group) -> None:
    fewer = {**wire_layout.CODES, group: wire_layout.CODES[group][1:]}
    monkeypatch.setattr(wire_layout, "CODES", fewer)
    for other in Group:
        assert (wire_layout.layout_hash(other) == schema_hash(other)) == (other is not group)


def test_a_message_changes_the_hash_of_its_group_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    more = (*MESSAGES, replace(PING, id=0x2F))
    assert hash_with(monkeypatch, "MESSAGES", more) == schema_hash()
    assert wire_layout.layout_hash(Group.CONFIGURATION) != schema_hash(Group.CONFIGURATION)


def test_the_ids_of_a_group_are_in_its_range() -> None:
    for message in MESSAGES:
        number = message.id & 0x7F
        assert (0x20 <= number <= 0x2F) == (message.group is Group.CONFIGURATION)
        assert (0x30 <= number <= 0x3F) == (message.group is Group.RECORDER)
        assert (0x40 <= number <= 0x4F) == (message.group is Group.STORE)


def test_the_groups_of_devices_in_the_field_are_as_they_were() -> None:
    assert schema_hash() == 0x4BC399F6
    assert schema_hash(Group.CONFIGURATION) == 0x3FE4DDFC
