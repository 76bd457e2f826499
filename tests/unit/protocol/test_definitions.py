import enum
import struct

from support.cases import each
from wheelwire_protocol.codes import ENUMERATIONS, FLAGS, Capability, DocumentedFlag, Fault
from wheelwire_protocol.message import Message
from wheelwire_protocol.messages import MAX_PAYLOAD, MESSAGES
from wheelwire_protocol.parameters import PARAMETERS, Kind, Parameter


def test_ids_and_names_are_unique() -> None:
    for definitions in (MESSAGES, PARAMETERS):
        assert len({d.id for d in definitions}) == len(definitions)
        assert len({d.name for d in definitions}) == len(definitions)


def test_payloads_need_one_cobs_code_byte_more_at_most() -> None:
    assert MAX_PAYLOAD < 254


@each("message", MESSAGES, ids=lambda message: message.name)
def test_message_is_documented(message: Message) -> None:
    assert message.doc.endswith(".")
    assert all(field.docs.endswith(".") for field in message.fields if field.docs)


@each("flags", FLAGS, ids=lambda flags: flags.__name__)
def test_flags_are_inverted(flags: type[DocumentedFlag]) -> None:
    every = flags(sum(flags))
    assert ~flags(0) == every
    for flag in flags:
        assert ~flag == every ^ flag
        assert ~flag & flag == flags(0)
        assert ~~flag == flag


@each("message", MESSAGES, ids=lambda message: message.name)
def test_codes_fit_their_fields(message: Message) -> None:
    for field in message.fields:
        if field.enumeration:
            struct.pack("<" + field.format, max(field.enumeration))


@each("parameter", PARAMETERS, ids=lambda parameter: parameter.name)
def test_parameter(parameter: Parameter) -> None:
    assert parameter.minimum <= parameter.default <= parameter.maximum
    assert parameter.doc.endswith(".")
    if parameter.kind is not Kind.REAL:
        for value in (parameter.minimum, parameter.default, parameter.maximum):
            assert value == int(value)
            assert struct.unpack("<f", struct.pack("<f", value))[0] == value


@each("codes", [*ENUMERATIONS, *FLAGS], ids=lambda codes: codes.__name__)
def test_codes_have_a_sentence_each(codes: type[enum.Enum]) -> None:
    docs = [getattr(member, "doc", "") for member in codes]
    assert all(doc.endswith(".") for doc in docs)


def test_equal_bits_of_two_kinds_of_flags_have_their_own_docs() -> None:
    assert int(Fault.LEFT_NOT_COUNTING) == int(Capability.BATTERY)
    assert Fault.LEFT_NOT_COUNTING.doc != Capability.BATTERY.doc


@each("message", MESSAGES, ids=lambda m: m.name)
def test_no_field_hides_what_every_tuple_has(message: Message) -> None:
    assert not {field.name for field in message.fields} & set(dir(tuple))
