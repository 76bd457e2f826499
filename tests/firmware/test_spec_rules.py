"""What SPEC.md decides, on the firmware."""

from __future__ import annotations

import math
import os
import pty
import re
import termios
from pathlib import Path

import pytest

from support.raw import NONCE, RawHost
from wheelwire.link.port_policy import USUAL_RATES
from wheelwire.link.transports import SerialTransport
from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.codes import RefusalCode
from wheelwire_protocol.framing import MAX_ENCODED
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import (
    Ack,
    DeviceHello,
    Estop,
    Hello,
    LinkCounters,
    LinkCountersGet,
    ParameterSet,
    Refuse,
    SetWheelVelocity,
    Stop,
)

ROOT = Path(__file__).parents[2]
LAST = (1 << 32) - 1


@pytest.fixture
def host() -> RawHost:
    return RawHost()


def velocity(host: RawHost, seq: int, mps: float = 0.2, ttl_us: int = 300_000) -> SetWheelVelocity:
    return SetWheelVelocity(host.session_id, seq, host.device_us + ttl_us, mps, mps)


def refusals(host: RawHost, *messages: SetWheelVelocity | ParameterSet) -> list[RefusalCode]:
    host.received.clear()
    host.send(*messages)
    host.run_ms(5)
    return [RefusalCode(refuse.code) for refuse in host.of(Refuse)]


def drives(host: RawHost) -> bool:
    host.run_ms(20)
    return bool(host.sim.get("drive_on"))


@pytest.mark.parametrize(
    ("mps", "ttl_us", "code"),
    [(math.nan, 300_000, RefusalCode.NOT_FINITE), (0.2, -1000, RefusalCode.EXPIRED)],
)
def test_a_refused_setpoint_uses_up_its_number(
    host: RawHost, mps: float, ttl_us: int, code: RefusalCode
) -> None:
    host.open()
    host.send(velocity(host, 1, 0.0))
    assert refusals(host, velocity(host, 7, mps, ttl_us)) == [code]
    assert refusals(host, velocity(host, 7)) == []
    assert not drives(host)
    assert refusals(host, velocity(host, 8)) == []
    assert drives(host)


def test_refusals_of_a_setpoint_have_an_order(host: RawHost) -> None:
    host.boot_id = host.hello().boot_id
    bad = velocity(host, 1, math.nan, -1000)
    assert refusals(host, bad._replace(session_id=1)) == [RefusalCode.NO_SESSION]
    assert refusals(host, bad) == [RefusalCode.NOT_FINITE]
    expired = velocity(host, 2, 0.2, -1000)
    assert refusals(host, expired) == [RefusalCode.CLOCK_UNSYNCHRONISED]
    host.open()
    host.ask(Estop(host.session_id, 1), Ack)
    assert refusals(host, velocity(host, 3, 0.2, -1000)) == [RefusalCode.EXPIRED]
    assert refusals(host, velocity(host, 4)) == [RefusalCode.ESTOPPED]


def test_refusals_of_a_parameter_have_an_order(host: RawHost) -> None:
    host.open()
    host.send(velocity(host, 1))
    host.run_ms(5)
    counts = PARAMETER_BY_NAME["counts_per_revolution"].id
    for request_id, (parameter, value, code) in enumerate(
        [
            (200, math.nan, RefusalCode.UNKNOWN_PARAMETER),
            (counts, math.nan, RefusalCode.NOT_FINITE),
            (counts, 0.5, RefusalCode.OUT_OF_RANGE),
            (counts, 360.5, RefusalCode.NOT_INTEGRAL),
            (counts, 400.0, RefusalCode.NOT_STOPPED),
        ],
        start=1,
    ):
        message = ParameterSet(host.session_id, request_id, parameter, value)
        assert refusals(host, message) == [code]


def test_the_version_is_looked_at_before_the_schema(host: RawHost) -> None:
    both = Hello(1, PROTOCOL_VERSION + 1, schema_hash() ^ 1)
    answer = host.ask(both, DeviceHello)
    assert (answer.refusal, answer.schema_hash) == (RefusalCode.PROTOCOL_VERSION, schema_hash())


@pytest.mark.parametrize("mode", [4, 255])
def test_a_stop_of_an_unknown_mode_stops(host: RawHost, mode: int) -> None:
    host.open()
    host.send(velocity(host, 1))
    assert drives(host)
    ack = host.ask(Stop(host.session_id, 9, 1, mode), Ack)
    assert (ack.request_id, ack.message_id) == (9, 2)
    assert not drives(host)


def test_a_stop_of_all_numbers_voids_them_until_a_new_session(host: RawHost) -> None:
    host.open()
    host.ask(Stop(host.session_id, 1, LAST, 0), Ack)
    assert refusals(host, velocity(host, 1)) == [RefusalCode.COMMAND_SEQ_SPENT]
    assert refusals(host, velocity(host, LAST)) == []
    assert not drives(host)
    host.hello(nonce=NONCE + 1)
    host.open()
    host.send(velocity(host, 1))
    assert drives(host)


def test_an_overlong_chunk_is_counted_before_it_ends(host: RawHost) -> None:
    host.open()
    host.sim.write(b"\x41" * (MAX_ENCODED + 1))
    host.run_ms(5)
    host.sim.write(b"\0")
    first = host.ask(LinkCountersGet(host.session_id, 1), LinkCounters)
    assert first.bad_cobs == 1


def test_the_line_is_8n1_at_the_rates_that_the_page_names() -> None:
    page = " ".join((ROOT / "protocol" / "SPEC.md").read_text("utf-8").split())
    rates = re.search(r"a host that hears nothing tries ([\d, and]+)\.", page)
    assert rates is not None
    assert tuple(map(int, re.findall(r"\d+", rates[1]))) == USUAL_RATES
    built_in = re.search(r"built into the firmware, (\d+) baud", page)
    kconfig = (ROOT / "firmware/esp32/main/Kconfig.projbuild").read_text("utf-8")
    default = re.search(r"config WHEELWIRE_BAUD_RATE.*?default (\d+)", kconfig, re.DOTALL)
    assert built_in is not None
    assert default is not None
    assert built_in[1] == default[1] == str(USUAL_RATES[0])

    leader, follower = pty.openpty()
    try:
        settings = termios.tcgetattr(follower)
        settings[2] |= termios.CSTOPB | termios.PARENB | termios.CRTSCTS
        termios.tcsetattr(follower, termios.TCSANOW, settings)
        transport = SerialTransport(os.ttyname(follower), USUAL_RATES[0])
        flags = termios.tcgetattr(transport.fileno())[2]
        transport.close()
    finally:
        os.close(leader)
        os.close(follower)
    assert flags & termios.CSIZE == termios.CS8
    assert not flags & (termios.CSTOPB | termios.PARENB | termios.CRTSCTS)
