"""The messages of the self-test image, which `make hil` asks and nothing else does.

They are apart from `messages`: the ordinary firmware, hosts and the page have none of them.
"""

from __future__ import annotations

from .codes import Failure, Unit
from .message import i32, u8, u16, u32, u64
from .messages import answer, request

GROUP = 6
"""Their group, as GroupGet asks for it."""

PERMISSION = 0x0FF_5AFE
"""What a host sends once the user has said that the motor supply is off."""

# --- from the host: ids 0x70 to 0x7f --------------------------------------------------------------

MESSAGES = (
    request(
        0x70,
        "SelfTestAllow",
        "The user says that the motor supply is off: allows the others, and drives, until a reset.",
        u32("permission", f"0x{PERMISSION:08x}."),
    ),
    request(
        0x71,
        "SelfTestFail",
        "Makes a core fail, shortly after the Ack.",
        u8("failure", codes=Failure),
        u8("core", "From 0."),
        u16("delay_us", "Added to the time after the Ack.", unit=Unit.MICROSECOND),
    ),
    request(
        0x72,
        "SelfTestTurn",
        "Plays the encoder at two outputs of the power stage; SelfTestReport says when it is done.",
        u8("pin_a", "GPIO that leads to A."),
        u8("pin_b", "GPIO that leads to B."),
        i32("edges", "How far, forward positive.", unit=Unit.TICK),
        u16("edge_us", "From one edge to the next, from 4 on.", unit=Unit.MICROSECOND),
        u16(
            "spikes",
            "Before that, so many edges forward, each in a pulse of 500 ns of the other input.",
        ),
    ),
    request(
        0x73,
        "SelfTestWatch",
        "Measures the edges at an input from now on; the answer tells of the time before.",
        u8("edge_pin", "GPIO of an encoder, whose edges are measured."),
        u8("level_pin", "GPIO whose level tells one direction's pulses."),
        u8("core", "Core that measures. It cannot change until a reset."),
        answer="SelfTestReport",
    ),
    request(
        0x74,
        "SelfTestLastGet",
        "Asks what the failure before the last reset led to.",
        answer="SelfTestLast",
    ),
    # --- from the device: ids 0xf0 to 0xff ---
    answer(
        0xF0,
        "SelfTestReport",
        "The edges at a pin since the last SelfTestWatch.",
        u32("resolution_hz", "Ticks in a second; 0: it cannot measure.", unit=Unit.HERTZ),
        u32("rises"),
        u32("falls"),
        u32("least_period", "Ticks from one rise to the next; 0: none."),
        u32("most_period", "As least_period."),
        u32("least_high", "Ticks from a rise to the fall; 0: none."),
        u32("most_high", "As least_high."),
        u32("most_high_other", "As most_high, while level_pin was low."),
        u64("last_fall_us", "Device clock; 0: none.", unit=Unit.MICROSECOND),
        u8("turns", "1: SelfTestTurn is at work."),
    ),
    answer(
        0xF1,
        "SelfTestLast",
        "The failure before the last reset.",
        u8("failure", codes=Failure),
        u8("core"),
        u64("failed_us", "Device clock when it did.", unit=Unit.MICROSECOND),
        u64("last_fall_us", "Of the last pulse at edge_pin; 0: none.", unit=Unit.MICROSECOND),
    ),
)
"""In the order in which the group's hash covers their layouts."""
