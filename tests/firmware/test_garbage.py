"""Bytes that form no good frame move nothing, and all of them are counted."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from support.examples import examples
from support.raw import RawHost
from wheelwire_protocol.codes import SupervisorState
from wheelwire_protocol.types import LinkCounters, LinkCountersGet, SetWheelVelocity


def counters(host: RawHost) -> LinkCounters:
    return host.ask(LinkCountersGet(host.session_id, 1), LinkCounters)


def check_alive_and_still(host: RawHost) -> LinkCounters:
    """The device answers, and never drove."""
    host.sim.write(b"\0")  # ends what garbage began
    host.run_ms(50)
    host.received.clear()
    found = counters(host)
    assert not host.sim.get("drive_on")
    assert host.sim.get("drive_removed_us") == 0
    assert host.sim.get("state") == SupervisorState.IDLE
    return found


@given(st.binary(max_size=2000))
def test_random_bytes(data: bytes) -> None:
    host = RawHost().open()
    host.sim.write(data)
    host.run_ms(20)
    found = check_alive_and_still(host)
    chunks = sum(1 for chunk in data.split(b"\0") if chunk)
    bad = found.bad_cobs + found.bad_crc + found.unknown_id + found.wrong_length
    assert bad == chunks


@examples(200)
@given(st.data())
def test_a_setpoint_with_any_change_is_not_obeyed(data: st.DataObject) -> None:
    host = RawHost().open()
    message = SetWheelVelocity(host.session_id, 1, host.device_us + 500_000, 0.3, 0.3)
    frame = bytearray(host.encoder.encode(message))
    position = data.draw(st.integers(1, len(frame) - 2))
    frame[position] ^= data.draw(st.integers(1, 255))
    host.sim.write(bytes(frame))
    host.run_ms(20)
    check_alive_and_still(host)
