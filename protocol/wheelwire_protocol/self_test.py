"""The messages of the self-test image, which `make hil` asks and nothing else does.

They are apart from `messages`: the ordinary firmware, hosts and the page have none of them.
"""

from __future__ import annotations

from .codes import Failure, Unit
from .message import i32, messages_in, u8, u16, u32, u64
from .messages import Answer, Request

GROUP = 6
"""Their group, as GroupGet asks for it."""

PERMISSION = 0x0FF_5AFE
"""What a host sends once the user has said that the motor supply is off."""

# --- from the host: ids 0x70 to 0x7f --------------------------------------------------------------


class SelfTestAllow(Request, id=0x70):
    """The user says that the motor supply is off: allows the others, and drives, until a reset."""

    permission = u32(f"0x{PERMISSION:08x}.")


class SelfTestFail(Request, id=0x71):
    """Makes a core fail, shortly after the Ack."""

    failure = u8(codes=Failure)
    core = u8("From 0.")
    delay_us = u16("Added to the time after the Ack.", unit=Unit.MICROSECOND)


class SelfTestTurn(Request, id=0x72):
    """Plays the encoder at two outputs of the power stage; SelfTestReport says when it is done."""

    pin_a = u8("GPIO that leads to A.")
    pin_b = u8("GPIO that leads to B.")
    edges = i32("How far, forward positive.", unit=Unit.TICK)
    edge_us = u16("From one edge to the next, from 4 on.", unit=Unit.MICROSECOND)
    spikes = u16(
        "Before that, so many edges forward, each in a pulse of 500 ns of the other input."
    )


class SelfTestWatch(Request, id=0x73, answer="SelfTestReport"):
    """Measures the edges at an input from now on; the answer tells of the time before."""

    edge_pin = u8("GPIO of an encoder, whose edges are measured.")
    level_pin = u8("GPIO whose level tells one direction's pulses.")
    core = u8("Core that measures. It cannot change until a reset.")


class SelfTestLastGet(Request, id=0x74, answer="SelfTestLast"):
    """Asks what the failure before the last reset led to."""


# --- from the device: ids 0xf0 to 0xff -----------------------------------------------------------


class SelfTestReport(Answer, id=0xF0):
    """The edges at a pin since the last SelfTestWatch."""

    resolution_hz = u32("Ticks in a second; 0: it cannot measure.", unit=Unit.HERTZ)
    rises = u32()
    falls = u32()
    least_period = u32("Ticks from one rise to the next; 0: none.")
    most_period = u32("As least_period.")
    least_high = u32("Ticks from a rise to the fall; 0: none.")
    most_high = u32("As least_high.")
    most_high_other = u32("As most_high, while level_pin was low.")
    last_fall_us = u64("Device clock; 0: none.", unit=Unit.MICROSECOND)
    turns = u8("1: SelfTestTurn is at work.")


class SelfTestLast(Answer, id=0xF1):
    """The failure before the last reset."""

    failure = u8(codes=Failure)
    core = u8()
    failed_us = u64("Device clock when it did.", unit=Unit.MICROSECOND)
    last_fall_us = u64("Of the last pulse at edge_pin; 0: none.", unit=Unit.MICROSECOND)


MESSAGES = messages_in(globals().values())
"""In the order in which the group's hash covers their layouts."""
