"""Sensor messages into samples, on a device whose clock is 1 s ahead of the host's."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TypeVar

import pytest

from support.cases import each
from support.sensor_messages import AHEAD_US, BOOT, KINDS, Stream, distance, imu, info, inputs
from wheelwire.link.sensor_stream import INFO_ATTEMPTS, INFO_US, SensorStream
from wheelwire.samples import (
    EVENTS,
    IMU,
    INPUTS,
    POWER,
    RANGE,
    ImuSample,
    InputsSample,
    PowerSample,
    RangeSample,
)
from wheelwire_protocol.codes import BatteryLevel, PeripheralKind, RangeQuality, Reflex, SensorState
from wheelwire_protocol.codes import SensorEventCode as Code
from wheelwire_protocol.peripherals import SensorChip
from wheelwire_protocol.types import SensorEvent as EventMessage

SampleT = TypeVar("SampleT", ImuSample, InputsSample, PowerSample, RangeSample)
GROUPS = {ImuSample: IMU, InputsSample: INPUTS, PowerSample: POWER, RangeSample: RANGE}


@pytest.fixture
def known() -> Stream:
    return Stream()


def only(stream: Stream, kind: type[SampleT]) -> SampleT:
    """The one sample that was passed on, which has to be of this kind."""
    ((group, sample),) = stream.sensed
    assert group == GROUPS[kind]
    assert isinstance(sample, kind)
    return sample


def times(stream: Stream) -> list[int]:
    """When each of the samples of the IMU was measured."""
    return [one.t_us for _, one in stream.sensed if isinstance(one, ImuSample)]


def test_channels_are_known_in_their_order(known: Stream) -> None:
    names = [one.name for one in known.stream.infos.values()]
    assert names == [
        *("imu", "battery", "bumper.front_left", "cliff.front"),
        *("range.left", "analog_2"),
    ]
    assert known.stream.is_complete(len(KINDS))
    assert not known.stream.is_complete(None)
    assert known.stream.infos[0].gyro_noise == 0.01


def test_an_imu_is_in_the_robots_axes_and_on_the_hosts_clock(known: Stream) -> None:
    known.imu(3_000_000)
    sample = only(known, ImuSample)
    # Its y points forward: the robot's left is its -x.
    assert sample.gyro == (2.0, -1.0, 3.0)
    assert sample.acceleration == (-3.0, -2.0, 10.0)
    assert sample.temperature_c == 25.12
    assert sample.t_us == 3_000_000
    assert sample.stamp == pytest.approx(2.0, abs=1e-4)
    assert sample.stamp_error_s > 50e-6  # that of the chip, and that of the clock


def test_the_gyroscopes_bias_is_taken_off_in_the_chips_axes(known: Stream) -> None:
    known.stream.take_info(info(0, values=(1, -2, 6)))
    known.imu(3_000_000)
    sample = only(known, ImuSample)
    # 2, 4 and 6 counts of 0.5 rad/s without those of the bias; its y points forward.
    assert sample.gyro == (3.0, -0.5, 0.0)
    assert sample.acceleration == (-3.0, -2.0, 10.0)


def test_a_sample_that_the_line_doubled_is_one(known: Stream) -> None:
    for t_us in (3_000_000, 3_000_000, 2_995_000, 3_005_000):
        known.imu(t_us)
    assert times(known) == [3_000_000, 3_005_000]


def test_the_devices_clock_wraps(known: Stream) -> None:
    near = (1 << 32) - 2000
    for t_us in (near, near + 5000):
        known.imu(t_us)
    before, after = (one for _, one in known.sensed if isinstance(one, ImuSample))
    assert after.t_us - before.t_us == 5000
    assert after.stamp - before.stamp == pytest.approx(0.005, abs=1e-5)


@pytest.mark.parametrize("minutes", [1, 36, 50, 70])
def test_samples_that_waited_for_a_stopped_program_hide_no_fresh_one(
    known: Stream, minutes: int
) -> None:
    begin_us, stopped_us = 3_000_000, minutes * 60_000_000
    known.imu(begin_us)
    for t_us in (begin_us + 5_000, begin_us + stopped_us, begin_us + stopped_us + 5_000):
        # All of them come at the end; the first one waited on the line.
        known.imu(t_us, now_us=begin_us + stopped_us + 10_000 - AHEAD_US)
    assert times(known)[-1] == begin_us + stopped_us + 5_000
    assert times(known) == sorted(times(known))
    assert len(times(known)) == 4


def test_the_supply_by_a_divider_has_no_current(known: Stream) -> None:
    known.power(7400)
    sample = only(known, PowerSample)
    assert (sample.voltage_v, sample.current_a, sample.used_ah) == (7.4, None, None)
    assert sample.level is BatteryLevel.OK


def test_the_supply_by_a_sensor_has_one(known: Stream) -> None:
    known.stream.take_info(info(1, kind=PeripheralKind.POWER))
    known.power(7400, -1500, 250.0)
    sample = only(known, PowerSample)
    assert (sample.current_a, sample.used_ah) == (-1.5, 0.25)


def test_inputs_have_names(known: Stream) -> None:
    known.inputs(inputs(2_000_000, triggered=0b0100, reflexes=Reflex.NO_FORWARD))
    sample = only(known, InputsSample)
    assert sample.triggered == ("bumper.front_left",)
    assert sample.channels["bumper.front_left"] == (True, True, 5, SensorState.OK)
    assert sample.channels["cliff.front"] == (False, False, 6, SensorState.OK)
    assert sample.reflexes is Reflex.NO_FORWARD
    assert sample.level is BatteryLevel.WARN


def test_a_range_is_a_distance_with_what_the_sensor_can_measure(known: Stream) -> None:
    known.range(distance(3_000_000, sample=7))
    sample = only(known, RangeSample)
    assert (sample.name, sample.distance_m, sample.sample) == ("left", 0.85, 7)
    assert (sample.min_m, sample.max_m, sample.field_of_view_rad) == (0.02, 4.0, 0.26)
    assert sample.t_us == 3_000_000
    assert sample.stamp == pytest.approx(2.0, abs=1e-4)
    assert sample.stamp_error_s > 30e-6  # that of the echo, and that of the clock


@each(
    ("quality", "distance_m"),
    [(RangeQuality.FAR, float("inf")), (RangeQuality.NEAR, float("-inf"))],
)
def test_no_echo_is_infinitely_far_and_too_near_is_minus_infinite(
    quality: RangeQuality, distance_m: float
) -> None:
    known = Stream()
    known.range(distance(3_000_000, 850, quality))
    assert only(known, RangeSample).distance_m == distance_m


def test_a_stale_range_sensor_has_no_newest_sample_until_the_next(known: Stream) -> None:
    known.range(distance(2_000_000))
    known.range(distance(2_000_000))  # the line has doubled it
    assert len(known.sensed) == 1
    event = known.event(4, Code.STATE, SensorState.ABSENT)
    assert event.sentence.startswith("range.left: STALE, ABSENT: ")
    assert "range.left" not in known.stream.newest
    known.range(distance(3_000_000))
    assert known.stream.newest["range.left"].t_us == 3_000_000
    assert known.stream.states.get(4) is SensorState.OK


def test_analogue_inputs_have_names_and_volts(known: Stream) -> None:
    known.inputs(inputs(2_000_000))
    sample = only(known, InputsSample)
    assert sample.analog == {"analog_2": 3.3}
    assert "analog_2" not in sample.channels


def newest_inputs(known: Stream) -> InputsSample:
    sample = known.stream.newest[INPUTS].sample()
    assert isinstance(sample, InputsSample)
    return sample


def test_a_voltage_that_cannot_be_used_is_not_handed_out(known: Stream) -> None:
    known.inputs(inputs(2_000_000, stale=0b10_0000))
    assert newest_inputs(known).analog == {}
    # The event comes before the voltage that can be used.
    known.event(5, Code.STATE, SensorState.OK)
    assert newest_inputs(known).analog == {}
    known.inputs(inputs(2_100_000))
    assert newest_inputs(known).analog == {"analog_2": 3.3}
    known.event(5, Code.STATE, SensorState.MISSED)
    assert newest_inputs(known).analog == {}


def test_inputs_wait_until_all_names_are_known() -> None:
    early = Stream(knows=False)
    early.inputs(inputs(2_000_000, triggered=0b0100))
    for channel in range(len(KINDS)):
        assert early.sensed == []
        early.stream.take_info(info(channel))
    sample = only(early, InputsSample)
    assert sample.triggered == ("bumper.front_left",)


def test_what_has_no_units_yet_is_no_sample() -> None:
    early = Stream(knows=False)
    early.imu(2_000_000)
    early.power(7400)
    early.range(distance(2_000_000))
    early.stream.take_event(EventMessage(BOOT, 0, 0, 0, 1), early.clock, 0)
    assert early.sensed == []


def test_a_stale_sensor_has_no_newest_sample_until_the_next(known: Stream) -> None:
    known.imu(2_000_000)
    assert "imu" in known.stream.newest
    event = known.event(0, Code.STATE, SensorState.FROZEN)
    assert event.sentence.startswith("imu: STALE, FROZEN: it repeats one raw sample")
    assert event.is_warning
    assert known.stream.states.get(0) is SensorState.FROZEN
    assert "imu" not in known.stream.newest
    known.inputs(inputs(2_500_000, stale=0b0001))
    assert known.stream.states.get(0) is SensorState.FROZEN  # which says why
    known.imu(3_000_000)
    assert known.stream.states.get(0) is SensorState.OK
    assert known.stream.newest["imu"].t_us == 3_000_000


def test_a_lost_event_is_made_good_by_the_inputs(known: Stream) -> None:
    known.imu(2_000_000)
    known.inputs(inputs(2_500_000, stale=0b0001))
    assert known.stream.states.get(0) is SensorState.MISSED
    assert "imu" not in known.stream.newest
    known.inputs(inputs(2_600_000))
    assert known.stream.states.get(0) is SensorState.OK


BUMPER = "bumper.front_left"
WARNINGS = (
    (2, Code.TRIGGERED, Reflex.NO_FORWARD, f"{BUMPER} triggered: the robot only backs out"),
    (2, Code.TRIGGERED, Reflex.NO_REVERSE, f"{BUMPER} triggered: the robot only drives forward"),
    (3, Code.TRIGGERED, Reflex.STOP, "cliff.front triggered: the robot stops"),
    (
        1,
        Code.BATTERY,
        BatteryLevel.STOP,
        "battery: empty; the robot stops until the battery is charged",
    ),
    (0, Code.REDUCED, 100, "imu: the line carries only 100 samples a second"),
)
NEWS = (
    (0, Code.STATE, SensorState.OK, "imu: OK"),
    (3, Code.RELEASED, Reflex.STOP, "cliff.front is free again"),
    (1, Code.BATTERY, BatteryLevel.OK, "battery: charged"),
)


@each(
    ("channel", "code", "value", "sentence", "is_warning"),
    [(*event, True) for event in WARNINGS] + [(*event, False) for event in NEWS],
)
def test_an_event_has_a_sentence(
    known: Stream, channel: int, code: int, value: int, sentence: str, is_warning: bool
) -> None:
    event = known.event(channel, code, value)
    assert event.sentence == sentence
    assert event.is_warning is is_warning
    assert (event.code, event.value) == (code, value)
    assert event.stamp == pytest.approx(1.0, abs=1e-4)
    assert known.stream.sensed[-1].group == EVENTS


def test_a_reduced_rate_is_the_channels_from_then_on(known: Stream) -> None:
    known.event(0, Code.REDUCED, 100)
    assert known.stream.infos[0].rate_hz == 100
    assert resumed(known.stream).infos[0].rate_hz == 100


def test_an_event_waits_until_its_channel_says_what_it_is(known: Stream) -> None:
    stream = known.stream
    stream.forget()
    reduced = EventMessage(BOOT, 2_000_000, 0, Code.REDUCED, 116)
    stale = EventMessage(BOOT, 2_000_000, 0, Code.STATE, SensorState.ABSENT)
    for message in (stale, reduced):
        stream.take_event(message, known.clock, 1_000_000)
    stream.take_info(info(1))
    assert known.sensed == []
    stream.take_info(info(0))
    assert [what.sentence for _, what in known.sensed] == [  # type: ignore[attr-defined]
        "imu: STALE, ABSENT: it does not answer, or another chip does",
        "imu: the line carries only 116 samples a second",
    ]
    # What the channel says is newer.
    assert stream.states[0] is SensorState.OK
    assert stream.infos[0].rate_hz == 200


@each(
    ("said", "take"),
    [
        ("99", lambda known: known.stream.take_info(info(0, kind=99))),
        ("NONE", lambda known: known.stream.take_info(info(4)._replace(chip=SensorChip.NONE))),
        ("input 0", lambda known: known.stream.take_info(info(5, values=(2000, 0, 0)))),
        ("input 5", lambda known: known.stream.take_info(info(5, values=(2000, 5, 0)))),
        ("99", lambda known: known.range(distance(2_000_000, quality=99))),
        ("99", lambda known: known.event(0, 99, 0)),
        ("99", lambda known: known.event(0, Code.STATE, 99)),
        ("99", lambda known: known.power(7400, level=99)),
        ("99", lambda known: known.inputs(inputs(0)._replace(level=99))),
    ],
)
def test_a_code_that_means_nothing_is_invalid(
    known: Stream, said: str, take: Callable[[Stream], object]
) -> None:
    with pytest.raises(ValueError, match=said):
        take(known)
    assert known.sensed == []


def test_channels_that_did_not_say_what_they_are_are_asked_again() -> None:
    stream = SensorStream()
    stream.note_asked(200, None, 0)
    assert stream.due_us == INFO_US
    for channel in range(len(KINDS)):
        assert stream.due_us == INFO_US
        stream.take_info(info(channel))
    assert stream.due_us is None
    stream.note_asked(200, len(KINDS), 0)
    assert stream.due_us is None


def test_at_another_rate_each_channel_says_again_what_it_is(known: Stream) -> None:
    stream, size = known.stream, len(KINDS)
    stream.note_asked(50, size, 0)
    assert stream.due_us == INFO_US
    other = resumed(stream)
    for one in (stream, other):
        assert not one.is_complete(size)
        assert set(one.infos) == set(range(size))  # the samples meanwhile have their units
        for channel in range(size):
            assert not one.is_complete(size)
            one.take_info(info(channel))
        assert one.is_complete(size)
        assert one.due_us is None
        one.note_asked(50, size, 0)
        assert one.is_complete(size)


def test_they_are_not_asked_for_ever() -> None:
    stream = SensorStream()
    for _ in range(INFO_ATTEMPTS):
        assert stream.due_us is not None or stream.rate_hz == 0
        stream.note_asked(200, 1, 0)
    assert stream.due_us is None


def test_a_device_without_peripherals_has_nothing_to_say() -> None:
    stream = SensorStream()
    stream.note_asked(200, 0, 0)
    assert stream.due_us is None
    assert stream.is_complete(0)


def test_the_end_of_a_session_ends_what_is_known_but_not_the_wish(known: Stream) -> None:
    known.imu(2_000_000)
    known.stream.forget()
    assert known.stream.infos == {}
    assert known.stream.states == {}
    assert known.stream.newest == {}
    assert known.stream.rate_hz == 200


def resumed(stream: SensorStream) -> SensorStream:
    other = SensorStream()
    other.resume(json.loads(json.dumps(stream.snapshot())))
    return other


def test_another_session_goes_on_behind_a_snapshot(known: Stream) -> None:
    known.imu(2_000_000)
    known.event(0, Code.STATE, SensorState.HUNG)
    other = resumed(known.stream)
    assert other.infos == known.stream.infos
    assert other.states == known.stream.states
    assert other.rate_hz == 200
    for stream in (known.stream, other):
        stream.take_imu(imu(2_005_000), known.clock, AHEAD_US + 5000)
    assert other.newest["imu"].sample() == known.stream.newest["imu"].sample()
