"""The layout of each message of the base group on the wire, by a table written by hand.

The table is from SPEC.md and MESSAGES.md, not from the definitions: everything else that knows a
layout is generated from those.
"""

from __future__ import annotations

import struct
from enum import IntEnum

from support.cases import each
from wheelwire_protocol import types
from wheelwire_protocol.codes import (
    Fault,
    Group,
    ResetReason,
    StopMode,
    SupervisorEvent,
    SupervisorState,
)
from wheelwire_protocol.decoder import NativeDecoder
from wheelwire_protocol.framing import encode_frame, encode_payload
from wheelwire_protocol.message import Message
from wheelwire_protocol.messages import MESSAGES
from wheelwire_protocol.python_decoder import PythonDecoder

HEADER = 3
"""Bytes before a body: the id, and the number of the frame in two."""
CRC = 4
REQUEST = "session_id I0 request_id H4"
COMMAND = "session_id I0 command_seq I4 expiry_us Q8"

TABLE = f"""
01 Hello 10: nonce I0 protocol_version H4 schema_hash I6
02 Stop 11: {REQUEST} command_seq I6 mode B10
03 Estop 6: {REQUEST}
04 SetWheelVelocity 24: {COMMAND} left_mps f16 right_mps f20
05 SetDuty 20: {COMMAND} left_duty_q15 h16 right_duty_q15 h18
06 Ping 14: {REQUEST} host_us Q6
07 ClearEstop 6: {REQUEST}
08 ClearFault 6: {REQUEST}
09 SetStreamRate 8: {REQUEST} rate_hz H6
0a ParameterGet 7: {REQUEST} parameter B6
0b ParameterSet 11: {REQUEST} parameter B6 value f7
0c ParameterSave 7: {REQUEST} parameter B6
0d ParameterReset 6: {REQUEST}
0e ParameterList 7: {REQUEST} parameter_index B6
0f LinkCountersGet 6: {REQUEST}
10 ControlCountersGet 6: {REQUEST}
11 ParameterTrial 11: {REQUEST} action B6 timeout_s f7
12 GroupGet 7: {REQUEST} group B6
13 Restart 6: {REQUEST}
14 ContradictionsGet 6: {REQUEST}
15 HoldGet 6: {REQUEST}
80 DeviceHello 44: nonce I0 protocol_version H4 schema_hash I6 refusal B10 boot_id I11 device_us Q15
   reset_reason B23 board B24 board_id Q25 capabilities I33 version_major B37 version_minor B38
   version_patch B39 git_hash I40
81 WheelState 39: boot_id I0 t_us I4 left_ticks i8 right_ticks i12 left_mps f16 right_mps f20
   left_duty_q15 h24 right_duty_q15 h26 command_seq I28 supervisor B32 faults H33 overruns H35
   battery_mv H37
82 Refuse 10: session_id I0 message_id B4 code B5 reference I6
83 Ack 7: {REQUEST} message_id B6
84 Pong 30: {REQUEST} host_us Q6 received_us Q14 sent_us Q22
85 ParameterValue 11: {REQUEST} parameter B6 value f7
86 ParameterEntry 25: {REQUEST} parameter_index B6 parameter_count B7 parameter B8 value f9
   default_value f13 minimum f17 maximum f21
87 Event 18: boot_id I0 t_us I4 code B8 cause B9 before B10 after B11 faults H12 speed_mps f14
88 LinkCounters 44: {REQUEST} frames_received I6 frames_sent I10 bad_crc I14 bad_cobs I18
   unknown_id I22 wrong_length I26 seq_lost I30 send_dropped I34 refused I38 faults_tripped H42
89 ControlCounters 26: {REQUEST} late_steps I6 latest_step_us I10 saturated_steps I14
   left_illegal I18 right_illegal I22
8a GroupInfo 11: {REQUEST} group B6 hash I7
8b Contradictions 14: {REQUEST} active I6 refused I10
8c Hold 44: {REQUEST} held I6 estop_source B10 contradictions I11 stop_cause B15 stop_flags B16
   stop_reset B17 stop_held I18 stop_faults H22 stop_session I24 stop_command I28 stop_us Q32
   stop_mmps H40 rolled_mm H42
"""
"""Id, name, size of the body, and each field's type and place in it: the letters are those of
Python's struct, little-endian."""


def parsed() -> dict[str, tuple[int, int, list[tuple[str, str, int]]]]:
    """Name of a message -> id, size, and name, type and offset of each field."""
    found = {}
    for entry in TABLE.replace("\n   ", " ").strip().splitlines():
        head, _, rest = entry.partition(": ")
        number, name, size = head.split()
        words = rest.split()
        fields = [
            (field, place[0], int(place[1:]))
            for field, place in zip(words[::2], words[1::2], strict=True)
        ]
        found[name] = (int(number, 16), int(size), fields)
    return found


LAYOUTS = parsed()
BASE = [message for message in MESSAGES if message.group is Group.BASE]


def test_the_table_has_each_message_of_the_base_group() -> None:
    assert list(LAYOUTS) == [message.name for message in BASE]


def values_of(message: Message) -> dict[str, int | float]:
    """A value for each field: no two are equal, and their bytes differ."""
    values: dict[str, int | float] = {}
    for number, field in enumerate(message.fields):
        _, kind, _ = LAYOUTS[message.name][2][number]
        raw = bytes(16 * (byte + 1) + number for byte in range(struct.calcsize("<" + kind)))
        values[field.name] = struct.unpack("<" + kind, raw)[0]
    return values


@each("message", BASE, ids=lambda message: message.name)
def test_each_field_is_where_the_table_has_it(message: Message) -> None:
    number, size, fields = LAYOUTS[message.name]
    values = values_of(message)
    record = getattr(types, message.name)(**values)
    payload = encode_payload(record, 0)
    body = payload[HEADER:-CRC]
    assert payload[0] == number
    assert len(body) == size
    found = {name: struct.unpack_from("<" + kind, body, at)[0] for name, kind, at in fields}
    assert found == values
    for decoder in (PythonDecoder, NativeDecoder):
        assert decoder().feed(encode_frame(record, 0)) == [record]
    # No byte between two fields, and none behind the last one.
    assert sum(struct.calcsize("<" + kind) for _, kind, _ in fields) == size


@each(
    ("codes", "names"),
    [
        (SupervisorState, "BOOT IDLE DRIVING TIMED_OUT ESTOPPED FAULT"),
        (StopMode, "CONFIGURED COAST BRAKE BRAKE_UNTIL_DRIVEN"),
        (
            SupervisorEvent,
            "STARTED SESSION SETPOINT STOP DEADLINE ESTOP CLEAR_ESTOP FAULT CLEAR_FAULT",
        ),
        (
            ResetReason,
            "UNKNOWN POWER_ON EXTERNAL SOFTWARE PANIC TASK_WATCHDOG INTERRUPT_WATCHDOG BROWNOUT",
        ),
    ],
)
def test_what_stops_a_robot_is_numbered_as_in_the_first_release(
    codes: type[IntEnum], names: str
) -> None:
    assert [code.name for code in sorted(codes)] == names.split()


FAULTS = """
LEFT_NOT_COUNTING RIGHT_NOT_COUNTING LEFT_REVERSED RIGHT_REVERSED CONTROL_OVERRUN DRIVER_FAILED
LEFT_ENCODER_IMPLAUSIBLE RIGHT_ENCODER_IMPLAUSIBLE STORE_FULL STORE_NEWER STORE_UNREADABLE NO_BOARD
EXTERNAL OVERSPEED STORE_OUTDATED
"""


def test_each_fault_has_the_bit_of_the_first_release() -> None:
    bits = {name: 1 << bit for bit, name in enumerate(FAULTS.split())}
    assert {fault.name: int(fault) for fault in Fault} == bits
