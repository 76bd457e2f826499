"""The simulated robot's range sensors and analogue inputs: values, and each fault by name."""

from __future__ import annotations

import struct

import pytest

from support.cases import each
from support.raw import RawHost
from support.sensing import SensingHost
from wheelwire_protocol.codec import BOARD, BY_TYPE, assembled, fingerprint_of
from wheelwire_protocol.codes import (
    PeripheralKind,
    Place,
    RangeQuality,
    SensorState,
    SupervisorState,
)
from wheelwire_protocol.peripherals import RANGES, SensorChip
from wheelwire_protocol.types import (
    LAYOUTS,
    Ack,
    BoardSet,
    ConfigurationConfirm,
    ConfigurationGet,
    ConfigurationValue,
    ConfigurationWrite,
    Inputs,
    PeripheralSet,
    Range,
    Restart,
    SensorInfo,
    SensorStream,
    WheelState,
)

_HEAD_FIELDS = 3
"""Fields of a PeripheralSet before the entry: session, request, channel."""
_ENTRY = "<" + next(
    layout[_HEAD_FIELDS:] for _, message, layout in LAYOUTS if message is PeripheralSet
)


def entry(**fields: int) -> PeripheralSet:
    """An entry with these fields, and nothing in the others."""
    nothing = dict.fromkeys(PeripheralSet._fields, 0) | {"pin_a": -1, "pin_b": -1, "pin_c": -1}
    return PeripheralSet(**(nothing | fields))


def write_list(host: RawHost, *entries: PeripheralSet) -> None:
    """Replace the list, restart, and confirm it; leaves a session that is open.

    Raises:
        ValueError: The device does not take it.
    """
    host.open()
    session = host.session_id
    value = host.ask(ConfigurationGet(session, 1), ConfigurationValue)
    board = BY_TYPE[ConfigurationValue].pack_body(*value)[-BOARD.size :]
    host.ask(BoardSet(session, 2, *BOARD.unpack(board)), Ack)
    for channel, one in enumerate(entries):
        host.ask(one._replace(session_id=session, request_id=3 + channel, channel=channel), Ack)
    packed = [struct.pack(_ENTRY, *one[_HEAD_FIELDS:]) for one in entries]
    fingerprint = fingerprint_of(assembled(board, packed))
    host.ask(ConfigurationWrite(session, 20, len(entries), fingerprint), Ack)
    host.ask(Restart(session, 21), Ack)
    host.run_ms(1000)
    host.open()
    host.ask(ConfigurationConfirm(host.session_id, 1, fingerprint), Ack)


RANGE, FIRST, SECOND = range(3)
"""Channels."""
TABLE = RANGES[SensorChip.HC_SR04]
ROUND_MS = TABLE.period_us // 1000
POLL_MS = 1
ANALOG_MS = 100
DIVIDER = 3


class RangingHost(SensingHost):
    """A host that asks for all samples, of a robot with a range sensor and two analogue inputs."""

    def __init__(self, seed: int = 1) -> None:
        super().__init__(seed)
        write_list(
            self,
            entry(
                kind=PeripheralKind.RANGE,
                chip=SensorChip.HC_SR04,
                place=Place.FRONT,
                pin_a=21,
                pin_b=39,
            ),
            entry(kind=PeripheralKind.ANALOG, pin_a=35, value_a=1000 * DIVIDER, value_b=1),
            entry(kind=PeripheralKind.ANALOG, pin_a=36, value_a=1000, value_b=4),
        )
        self.send(SensorStream(self.session_id, 2, 200))
        self.run_ms(300)

    def newest(self, milliseconds: int = 2 * ROUND_MS + 2 * POLL_MS) -> Range:
        """The newest measurement after this time."""
        self.received.clear()
        self.run_ms(milliseconds)
        return self.of(Range)[-1]

    def inputs(self, milliseconds: int) -> list[Inputs]:
        """Those that come within this time."""
        self.received.clear()
        self.run_ms(milliseconds)
        return self.of(Inputs)


@pytest.fixture
def host() -> RangingHost:
    return RangingHost()


# --- a range sensor ------------------------------------------------------------------------------


@each(
    ("distance_m", "quality"),
    [
        (0.0, RangeQuality.NEAR),
        (0.015, RangeQuality.NEAR),
        (0.02, RangeQuality.GOOD),
        (0.25, RangeQuality.GOOD),
        (1.0, RangeQuality.GOOD),
        (2.5, RangeQuality.GOOD),
        (4.0, RangeQuality.GOOD),
        (4.1, RangeQuality.FAR),
        (10, RangeQuality.FAR),
    ],
)
def test_it_measures_what_is_ahead_or_says_that_it_is_out_of_range(
    host: RangingHost, distance_m: float, quality: RangeQuality
) -> None:
    host.sim.set("range.front_m", distance_m)
    found = host.newest()
    assert found.quality == quality
    measured_mm = 1000 * distance_m if quality is RangeQuality.GOOD else 0
    assert found.distance_mm == pytest.approx(measured_mm, abs=1)


def test_its_info_says_how_often(host: RangingHost) -> None:
    host.received.clear()
    host.send(SensorStream(host.session_id, 3, 200))
    host.run_ms(20)
    infos = {info.channel: info for info in host.of(SensorInfo)}
    assert infos[RANGE].kind == PeripheralKind.RANGE
    assert infos[RANGE].place == Place.FRONT
    assert infos[RANGE].rate_hz == 1000 // ROUND_MS
    assert infos[FIRST].kind == PeripheralKind.ANALOG
    assert infos[FIRST].rate_hz == 0


def test_one_whose_plug_is_off_is_absent_within_two_rounds(host: RangingHost) -> None:
    host.sim.set("range.absent", 1)
    assert host.ms_until(SensorState.ABSENT) <= 2 * ROUND_MS + 5
    host.received.clear()
    host.run_ms(1000)
    assert not host.of(Range)
    host.sim.set("range.absent", 0)
    assert host.ms_until(SensorState.OK) <= 2 * ROUND_MS + 5


def test_one_whose_echo_stays_high_is_hung_and_delays_no_control_step() -> None:
    calm, hung = RangingHost(), RangingHost()
    hung.sim.set("range.hung", 1)
    assert hung.ms_until(SensorState.HUNG) <= 250 + 2 * ROUND_MS + 5
    calm.run_ms(round((hung.device_us - calm.device_us) / 1e3))
    for one in (calm, hung):
        one.received.clear()
        one.drive(0.1, 0.1, 2000)
    assert not hung.of(Range)
    assert hung.sim.state is SupervisorState.DRIVING
    assert hung.of(WheelState)  # the same states, at the same times
    assert hung.of(WheelState) == calm.of(WheelState)
    hung.sim.set("range.hung", 0)
    assert hung.ms_until(SensorState.OK) <= 2 * ROUND_MS + 5


# --- analogue inputs -----------------------------------------------------------------------------


def test_they_are_measured_before_their_dividers(host: RangingHost) -> None:
    host.sim.set("analog.1_v", 6.5)
    host.sim.set("analog.4_v", 1.25)
    newest = host.inputs(ANALOG_MS + 30)[-1]
    assert newest.analog_1_mv == pytest.approx(6500, abs=DIVIDER)
    assert (newest.analog_2_mv, newest.analog_3_mv) == (0, 0)
    assert newest.analog_4_mv == pytest.approx(1250, abs=1)
    assert newest.stale == 0


def test_zero_volts_are_a_value_and_no_reading_is_missing(host: RangingHost) -> None:
    assert host.inputs(1100)[-1].stale == 0
    host.sim.set("analog.4_v", 2)
    assert host.inputs(1100)[-1].analog_4_mv == 2000
    host.sim.set("analog.failed", 1)
    assert host.ms_until(SensorState.MISSED, SECOND) <= 3 * ANALOG_MS + 2
    host.run_ms(30)
    newest = host.of(Inputs)[-1]
    assert newest.stale == 1 << FIRST | 1 << SECOND
    assert newest.analog_4_mv == 0
    host.sim.set("analog.failed", 0)
    assert host.ms_until(SensorState.OK, SECOND) <= ANALOG_MS + 2
