"""The firmware's end of the wire, with bytes laid out by hand: no encoder of ours is between.

Both wheels are told apart: one drives forward, the other one back, each at its own speed.
"""

from __future__ import annotations

import struct
import zlib

import pytest

from support.raw import RawHost

SET_WHEEL_VELOCITY, SET_DUTY, STOP, WHEEL_STATE = 0x04, 0x05, 0x02, 0x81
LIFE_US = 900_000
COAST, BRAKE = 1, 2


def frame(number: int, body: bytes) -> bytes:
    """By SPEC.md: COBS of id, number of the frame, body and CRC-32, between two delimiters."""
    payload = struct.pack("<BH", number, 0) + body
    payload += struct.pack("<I", zlib.crc32(payload))
    parts = payload.split(b"\0")
    return b"\0" + b"".join(bytes([len(part) + 1]) + part for part in parts) + b"\0"


def last_body(data: bytes, number: int) -> bytes:
    """The body of the last whole frame of this id."""
    found = b""
    for stuffed in data.split(b"\0"):
        payload, at = b"", 0
        while at < len(stuffed):
            payload += stuffed[at + 1 : at + stuffed[at]] + b"\0"
            at += stuffed[at]
        if payload[:1] == bytes([number]) and zlib.crc32(payload[:-1]) == 0x2144DF1C:
            found = payload[3:-5]
    assert found, "no such frame"
    return found


class ByHand:
    """A session whose setpoints and states are bytes."""

    def __init__(self) -> None:
        self.host = RawHost().open()
        self.sim = self.host.sim

    def drive(self, number: int, left: float, right: float, wheels: str) -> None:
        """`wheels`: the types of the two values."""
        expiry_us = self.host.device_us + LIFE_US
        body = struct.pack("<IIQ" + wheels, self.host.session_id, 5, expiry_us, left, right)
        self.sim.write(frame(number, body))

    def state(self, ms: int) -> bytes:
        """The last state within this time."""
        data = b""
        for _ in range(ms):
            self.sim.advance_us(1000)
            data += self.sim.read()
        return last_body(data, WHEEL_STATE)


@pytest.fixture
def by_hand() -> ByHand:
    return ByHand()


def test_a_velocity_is_that_of_its_wheel(by_hand: ByHand) -> None:
    by_hand.drive(SET_WHEEL_VELOCITY, 0.2, -0.1, "ff")
    body = by_hand.state(800)
    (boot_id,) = struct.unpack_from("<I", body, 0)
    left_ticks, right_ticks = struct.unpack_from("<ii", body, 8)
    left_mps, right_mps = struct.unpack_from("<ff", body, 16)
    left_duty, right_duty = struct.unpack_from("<hh", body, 24)
    (command_seq,) = struct.unpack_from("<I", body, 28)
    assert boot_id == by_hand.host.boot_id
    assert (left_mps, right_mps) == pytest.approx((0.2, -0.1), abs=0.02)
    assert left_ticks / right_ticks == pytest.approx(-2, rel=0.15)
    assert left_ticks > 100
    assert left_duty > 5000
    assert -5000 > right_duty > -left_duty
    assert command_seq == 5
    assert body[32] == 2  # DRIVING
    assert struct.unpack_from("<HHH", body, 33)[:2] == (0, 0)
    assert len(body) == 39


def test_a_duty_is_that_of_its_wheel(by_hand: ByHand) -> None:
    by_hand.drive(SET_DUTY, -12_000, 7_000, "hh")
    body = by_hand.state(300)
    assert struct.unpack_from("<hh", body, 24) == (-12_000, 7_000)
    left_ticks, right_ticks = struct.unpack_from("<ii", body, 8)
    assert left_ticks < 0 < right_ticks


def test_a_setpoint_ends_at_the_device_s_time_that_it_names(by_hand: ByHand) -> None:
    by_hand.drive(SET_WHEEL_VELOCITY, 0.2, 0.2, "ff")
    assert by_hand.state(LIFE_US // 1000 - 20)[32] == 2  # DRIVING
    assert by_hand.state(40)[32] == 3  # TIMED_OUT


def speed_after(mode: int) -> tuple[float, float]:
    """Speed of both wheels 0.5 s after a stop of this mode from 0.4 m/s."""
    robot = ByHand()
    robot.drive(SET_WHEEL_VELOCITY, 0.4, 0.4, "ff")
    robot.state(800)
    robot.sim.write(frame(STOP, struct.pack("<IHIB", robot.host.session_id, 9, 5, mode)))
    left_mps, right_mps = struct.unpack_from("<ff", robot.state(500), 16)
    return left_mps, right_mps


def test_a_stop_is_of_its_mode() -> None:
    assert min(speed_after(COAST)) > 2 * max(speed_after(BRAKE))


@pytest.mark.parametrize(("voided", "state"), [(4, 2), (5, 1)])
def test_a_stop_voids_the_setpoints_up_to_the_one_that_it_names(
    by_hand: ByHand, voided: int, state: int
) -> None:
    stop = struct.pack("<IHIB", by_hand.host.session_id, 9, voided, COAST)
    by_hand.sim.write(frame(STOP, stop))
    by_hand.drive(SET_WHEEL_VELOCITY, 0.2, 0.2, "ff")
    assert by_hand.state(100)[32] == state  # 1: IDLE
