"""Sensor messages into samples: none twice, on the host's clock, in the robot's axes. Sans-IO."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

from wheelwire_protocol import types as wire
from wheelwire_protocol.codes import (
    DIGITAL_INPUTS,
    BatteryLevel,
    PeripheralKind,
    Place,
    RangeQuality,
    Reflex,
    SensorEventCode,
    SensorState,
    channel_name,
)
from wheelwire_protocol.peripherals import MOST_ANALOG, RANGES, Axis, SensorChip

from ..samples import (
    EVENTS,
    IMU,
    INPUTS,
    POWER,
    RANGE,
    ImuSample,
    InputReading,
    InputsSample,
    PowerSample,
    RangeSample,
    SensorEvent,
    SensorInfo,
    Vector,
    sentence_of_event,
)
from .clock import ClockEstimator, Conversion, DeviceTime

WAITING = 4096
"""Most samples and events that wait to be passed on. In a re-run, nothing passes them on."""
INFO_US = 300_000
"""Within this after the request each channel says what it is; otherwise it is asked for again."""
INFO_ATTEMPTS = 10
EARLY_EVENTS = 32
"""Most events that wait until their channel has been identified, as they do on a slow line."""
IMU_PERIOD_US = 5_000
"""Period at which the firmware sets up each chip."""

Message = TypeVar("Message", wire.Imu, wire.Power, wire.Range)

_battery_level = cache(BatteryLevel)
_range_quality = cache(RangeQuality)
_reflex = cache(Reflex)


class _Channel(NamedTuple):
    info: SensorInfo
    message: wire.SensorInfo
    """What the device said of it, with the rate that it reported since."""
    turn: Callable[[Vector], Vector]
    """Turns a vector from an IMU's axes to the robot's."""


class _Measurement(Generic[Message]):
    """A channel's message, which becomes a sample when somebody asks for it."""

    __slots__ = ("arrived_us", "channel", "clock", "message", "t_us")

    def __init__(
        self, message: Message, t_us: int, arrived_us: int, channel: _Channel, clock: Conversion
    ) -> None:
        self.message: Message = message
        self.t_us = t_us
        self.arrived_us = arrived_us
        self.channel = channel
        self.clock = clock


class ImuMeasurement(_Measurement[wire.Imu]):
    """An IMU's message."""

    def sample(self) -> ImuSample:
        """The sample, with the stamp by the estimate at the arrival."""
        message, chip, turn = self.message, self.channel.message, self.channel.turn
        of_gyro, of_other = chip.gyro_scale, chip.accelerometer_scale
        host_us, error_us = self.clock.device_to_host(self.t_us)
        return ImuSample(
            t_us=self.t_us,
            sample=message.sample,
            gyro=turn(
                (
                    (message.gyro_x - chip.bias_x) * of_gyro,
                    (message.gyro_y - chip.bias_y) * of_gyro,
                    (message.gyro_z - chip.bias_z) * of_gyro,
                )
            ),
            acceleration=turn(
                (
                    message.accelerometer_x * of_other,
                    message.accelerometer_y * of_other,
                    message.accelerometer_z * of_other,
                )
            ),
            temperature_c=message.temperature_cdeg / 100,
            stamp=host_us / 1e6,
            stamp_error_s=(error_us + message.bound_us) / 1e6,
        )


class PowerMeasurement(_Measurement[wire.Power]):
    """A message about the supply."""

    def sample(self) -> PowerSample:
        """As `ImuMeasurement.sample`."""
        message = self.message
        has_current = self.channel.info.kind is PeripheralKind.POWER
        host_us, error_us = self.clock.device_to_host(self.t_us)
        return PowerSample(
            t_us=self.t_us,
            voltage_v=message.voltage_mv / 1000,
            current_a=message.current_ma / 1000 if has_current else None,
            used_ah=message.used_mah / 1000 if has_current else None,
            level=_battery_level(message.level),
            stamp=host_us / 1e6,
            stamp_error_s=error_us / 1e6,
        )


class RangeMeasurement(_Measurement[wire.Range]):
    """A message of a range sensor."""

    def sample(self) -> RangeSample:
        """As `ImuMeasurement.sample`."""
        message, info = self.message, self.channel.info
        table = RANGES[info.chip]
        host_us, error_us = self.clock.device_to_host(self.t_us)
        return RangeSample(
            t_us=self.t_us,
            sample=message.sample,
            name=info.place.name.lower(),
            distance_m=_distance_m(message),
            min_m=table.nearest_mm / 1000,
            max_m=table.farthest_mm / 1000,
            field_of_view_rad=table.cone_rad,
            stamp=host_us / 1e6,
            stamp_error_s=(error_us + message.bound_us) / 1e6,
        )


class InputsMeasurement(NamedTuple):
    """A message about all inputs; otherwise the same as for a channel."""

    message: wire.Inputs
    t_us: int
    arrived_us: int
    infos: Mapping[int, SensorInfo]
    states: Mapping[int, SensorState]
    clock: Conversion

    def sample(self) -> InputsSample:
        """As `ImuMeasurement.sample`."""
        message = self.message
        host_us, error_us = self.clock.device_to_host(self.t_us)
        return InputsSample(
            t_us=self.t_us,
            channels={
                info.name: InputReading(
                    triggered=bool(message.triggered >> number & 1),
                    level=bool(message.levels >> number & 1),
                    edges=getattr(message, f"edges_{number}"),
                    state=self.states[number],
                )
                for number, info in self.infos.items()
                if info.kind in DIGITAL_INPUTS
            },
            reflexes=_reflex(message.reflexes),
            level=_battery_level(message.level),
            stamp=host_us / 1e6,
            stamp_error_s=error_us / 1e6,
            analog={
                info.name: getattr(message, f"{info.name}_mv") / 1000
                for number, info in self.infos.items()
                if info.kind is PeripheralKind.ANALOG
                # Both: each may be the newer one.
                and not message.stale >> number & 1
                and self.states[number] is SensorState.OK
            },
        )


SensorMeasurement: TypeAlias = (
    ImuMeasurement | PowerMeasurement | RangeMeasurement | InputsMeasurement
)


SensorMessage: TypeAlias = wire.Imu | wire.Power | wire.Range | wire.Inputs | wire.SensorEvent


class Sensed(NamedTuple):
    """What an iterator returns: a measurement or an event."""

    group: str
    """One of IMU, POWER, RANGE, INPUTS and EVENTS."""
    what: SensorMeasurement | SensorEvent
    arrived_us: int


class SensorStream:
    """The sensors of a device, across its sessions.

    One thread changes it; any may read the attributes, which are replaced as a whole.

    Attributes:
        rate_hz: What the application asked for; 0 before it did.
        infos: What each channel is, by its number, as far as the session knows.
        states: Whether its samples can be used, by the same number.
        identities: What a wrong chip in place of a channel's reports as its identity.
        newest: The newest measurement by the channel's name, while its state is OK; also of INPUTS.
        sensed: What was not passed on yet, in order.
        stopped: The newest inputs that reported that a sensor stops the robot; None before the
            first.
        due_us: When to ask again what the channels are; None: no need.
    """

    def __init__(self) -> None:
        self.rate_hz = 0
        self.infos: Mapping[int, SensorInfo] = {}
        self.states: Mapping[int, SensorState] = {}
        self.identities: Mapping[int, int] = {}
        self.newest: dict[str, SensorMeasurement] = {}
        self.sensed: deque[Sensed] = deque(maxlen=WAITING)
        self.stopped: InputsMeasurement | None = None
        self.due_us: int | None = None
        self._takers: Mapping[type[SensorMessage], Callable[[Any, ClockEstimator, int], None]] = {
            wire.Imu: self.take_imu,
            wire.Power: self.take_power,
            wire.Range: self.take_range,
            wire.Inputs: self.take_inputs,
            wire.SensorEvent: self.take_event,
        }
        self._attempts = 0
        self._channels: dict[int, _Channel] = {}
        self._outdated: frozenset[int] = frozenset()
        """The channels that have not said what they are since another rate was asked for."""
        self._early: tuple[wire.Inputs, ClockEstimator, int] | None = None
        """The newest inputs, while not all channels have said what they are."""
        self._early_events: list[tuple[wire.SensorEvent, int, Conversion, int]] = []
        """Events of channels that are not identified yet, with the device's time."""
        self._time = DeviceTime()

    def forget(self) -> None:
        """A session ends: nothing of it is known to be true from now on."""
        self.infos, self.states, self.identities = {}, {}, {}
        self.newest.clear()
        self._channels.clear()
        self._early = self.stopped = None
        self._early_events.clear()
        self.due_us = None
        self._attempts = 0
        self._outdated = frozenset()
        self._time = DeviceTime()

    def is_complete(self, size: int | None) -> bool:
        """Whether all channels are known; `size`: of the device's list, None: not known."""
        return (
            self.rate_hz != 0
            and size is not None
            and len(self.infos) >= size
            and not self._outdated
        )

    def note_asked(self, rate_hz: int, size: int | None, now_us: int) -> None:
        """The device has granted a stream, and says what its channels are."""
        if self.rate_hz not in (0, rate_hz):
            self._outdated = frozenset(self.infos)
            self._attempts = 0
        self.rate_hz = rate_hz
        self._attempts += 1
        wants_more = not self.is_complete(size) and self._attempts < INFO_ATTEMPTS
        self.due_us = now_us + INFO_US if rate_hz and wants_more else None

    def take_info(self, message: wire.SensorInfo) -> None:
        """Take what a channel is.

        Raises:
            ValueError: A code means nothing.
        """
        number = message.channel
        kind, place, chip = _codes_of(message)
        info = SensorInfo(
            channel=number,
            # An analogue input's number is the second one of its entry.
            name=channel_name(kind, place, message.bias_y),
            kind=kind,
            chip=chip,
            place=place,
            rate_hz=_rate_hz(kind, message.rate_hz),
            gyro_noise=message.gyro_noise,
            acceleration_noise=message.accelerometer_noise,
        )
        state = SensorState(message.state)
        turn = _turn(Axis(message.forward), Axis(message.up))
        self._channels[number] = _Channel(info, message, turn)
        self._outdated -= {number}
        # Sorted by channel: they do not arrive in that order.
        self.infos = dict(sorted({**self.infos, number: info}.items()))
        self._set_state(number, state)
        # What they changed the message has already.
        events, self._early_events = self._early_events, []
        for event in events:
            self._sense_event(*event)
        if self._knows_all():
            if not self._outdated:
                self.due_us = None
            early, self._early = self._early, None
            if early is not None:
                self.take_inputs(*early)

    def take(self, message: SensorMessage, clock: ClockEstimator, now_us: int) -> None:
        """Take a sample or an event by the session's clock, at the host's time.

        Raises:
            ValueError: A code means nothing.
        """
        self._takers[type(message)](message, clock, now_us)

    def take_imu(self, message: wire.Imu, clock: ClockEstimator, now_us: int) -> None:
        """Take a sample."""
        channel = self._channels.get(message.channel)
        if channel is None or channel.info.kind is not PeripheralKind.IMU:
            return  # its units are not known yet
        t_us = self._unwrapped(message.t_us, clock, now_us)
        self._put(IMU, ImuMeasurement(message, t_us, now_us, channel, clock.conversion))

    def take_power(self, message: wire.Power, clock: ClockEstimator, now_us: int) -> None:
        """Take a sample.

        Raises:
            ValueError: A code means nothing.
        """
        _battery_level(message.level)
        channel = self._channels.get(message.channel)
        if channel is not None:
            t_us = self._unwrapped(message.t_us, clock, now_us)
            self._put(POWER, PowerMeasurement(message, t_us, now_us, channel, clock.conversion))

    def take_range(self, message: wire.Range, clock: ClockEstimator, now_us: int) -> None:
        """Take a measurement.

        Raises:
            ValueError: A code means nothing.
        """
        _range_quality(message.quality)
        channel = self._channels.get(message.channel)
        if channel is not None and channel.info.kind is PeripheralKind.RANGE:
            t_us = self._unwrapped(message.t_us, clock, now_us)
            self._put(RANGE, RangeMeasurement(message, t_us, now_us, channel, clock.conversion))

    def take_inputs(self, message: wire.Inputs, clock: ClockEstimator, now_us: int) -> None:
        """Take the levels of all inputs, and which channels are stale.

        Raises:
            ValueError: A code means nothing.
        """
        _battery_level(message.level)
        if not self._knows_all():
            self._early = message, clock, now_us
            return
        for number in self.infos:
            is_stale, known = message.stale >> number & 1, self.states[number]
            if is_stale and known is SensorState.OK:
                self._set_state(number, SensorState.MISSED)  # the event that says why was lost
            elif not is_stale and known is not SensorState.OK:
                self._set_state(number, SensorState.OK)
        t_us = self._unwrapped(message.t_us, clock, now_us)
        newest = self.newest.get(INPUTS)
        if newest is None or newest.t_us < t_us:
            measurement = InputsMeasurement(
                message, t_us, now_us, self.infos, self.states, clock.conversion
            )
            self.newest[INPUTS] = measurement
            if message.reflexes & Reflex.STOP:
                self.stopped = measurement
            self.sensed.append(Sensed(INPUTS, measurement, now_us))

    def take_event(self, message: wire.SensorEvent, clock: ClockEstimator, now_us: int) -> None:
        """Take what happened to a channel.

        Raises:
            ValueError: A code means nothing.
        """
        code, number = SensorEventCode(message.code), message.channel
        sentence_of_event("", code, message.value)  # raises before anything changes
        t_us = self._unwrapped(message.t_us, clock, now_us)
        self._sense_event(message, t_us, clock.conversion, now_us)
        if number not in self._channels:
            return
        if code is SensorEventCode.STATE:
            self._set_state(number, SensorState(message.value))
        elif code is SensorEventCode.REDUCED:
            self._set_rate(number, message.value)
        elif code is SensorEventCode.IDENTITY:
            self.identities = {**self.identities, number: message.value}

    def _sense_event(
        self, message: wire.SensorEvent, t_us: int, conversion: Conversion, now_us: int
    ) -> None:
        """Pass an event on, once its channel has said what it is."""
        channel = self._channels.get(message.channel)
        if channel is None:
            if len(self._early_events) < EARLY_EVENTS:
                self._early_events.append((message, t_us, conversion, now_us))
            return
        name, code = channel.info.name, SensorEventCode(message.code)
        host_us, error_us = conversion.device_to_host(t_us)
        event = SensorEvent(
            *(name, code, message.value, sentence_of_event(name, code, message.value)),
            *(t_us, host_us / 1e6, error_us / 1e6),
        )
        self.sensed.append(Sensed(EVENTS, event, now_us))

    # --- the state, for another session like this ------------------------------------------------

    def snapshot(self) -> dict[str, Any]:
        """What `resume` takes."""
        return {
            "rate_hz": self.rate_hz,
            "infos": [channel.message for channel in self._channels.values()],
            "states": list(self.states.items()),
            "clock": list(self._time.snapshot()),
            "asking": [self._attempts, self.due_us],
            "outdated": sorted(self._outdated),
        }

    def resume(self, known: Mapping[str, Any]) -> None:
        """Go on behind a snapshot."""
        self.rate_hz = known["rate_hz"]
        for fields in known["infos"]:
            self.take_info(wire.SensorInfo(*fields))
        self.states = {number: SensorState(state) for number, state in known["states"]}
        self._time.resume(*known["clock"])
        self._attempts, self.due_us = known["asking"]
        self._outdated = frozenset(known["outdated"])

    # ---------------------------------------------------------------------------------------------

    def _put(
        self, group: str, measured: ImuMeasurement | PowerMeasurement | RangeMeasurement
    ) -> None:
        info = measured.channel.info
        number, name = info.channel, info.name
        newest = self.newest.get(name)
        if newest is not None and newest.t_us >= measured.t_us:
            return  # the line has doubled it
        if self.states[number] is not SensorState.OK:
            self._set_state(number, SensorState.OK)  # no other is sent
        self.newest[name] = measured
        self.sensed.append(Sensed(group, measured, measured.arrived_us))

    def _knows_all(self) -> bool:
        counts = [channel.message.channel_count for channel in self._channels.values()]
        return bool(counts) and len(counts) >= counts[0]

    def _set_state(self, number: int, state: SensorState) -> None:
        self.states = {**self.states, number: state}
        if state is not SensorState.ABSENT and number in self.identities:
            self.identities = {n: it for n, it in self.identities.items() if n != number}
        if state is not SensorState.OK:
            self.newest.pop(self.infos[number].name, None)
        inputs = self.newest.get(INPUTS)
        if isinstance(inputs, InputsMeasurement):
            self.newest[INPUTS] = inputs._replace(states=self.states)

    def _set_rate(self, number: int, rate_hz: int) -> None:
        channel = self._channels[number]
        info = channel.info._replace(rate_hz=_rate_hz(channel.info.kind, rate_hz))
        message = channel.message._replace(rate_hz=rate_hz)
        self._channels[number] = channel._replace(info=info, message=message)
        self.infos = {**self.infos, number: info}

    def _unwrapped(self, t_us: int, clock: ClockEstimator, now_us: int) -> int:
        # As for state frames; samples of several channels may be slightly out of order.
        self._time.follow(t_us, clock, now_us)
        return self._time.t_us


def _codes_of(message: wire.SensorInfo) -> tuple[PeripheralKind, Place, SensorChip]:
    """Those of a channel.

    Raises:
        ValueError: One means nothing.
    """
    kind, place = PeripheralKind(message.kind), Place(message.place)
    chip = SensorChip(message.chip)
    if kind is PeripheralKind.RANGE and chip not in RANGES:
        raise ValueError(f"{chip!r} is not a range sensor")
    if kind is PeripheralKind.ANALOG and not 1 <= message.bias_y <= MOST_ANALOG:
        raise ValueError(f"there is no analogue input {message.bias_y}")
    return kind, place, chip


def _rate_hz(kind: PeripheralKind, most_hz: int) -> int:
    """Rate of the samples; the device sends each sample of an IMU, or every 2nd, or every 3rd."""
    if kind is not PeripheralKind.IMU or not most_hz:
        return most_hz
    interval_us = 1_000_000 // most_hz
    interval_us -= interval_us // 16  # which the device leaves to the chips' clocks
    every = max(1, math.ceil(interval_us / IMU_PERIOD_US))
    return round(1_000_000 / (every * IMU_PERIOD_US))


def _distance_m(message: wire.Range) -> float:
    """As REP-117 has it."""
    if message.quality == RangeQuality.GOOD:
        return message.distance_mm / 1000
    return math.inf if message.quality == RangeQuality.FAR else -math.inf


def _turn(forward: Axis, up: Axis) -> Callable[[Vector], Vector]:
    """From a chip's axes to the robot's: x forward, y left, z up."""
    x, x_sign = forward % 3, 1.0 if forward < Axis.MINUS_X else -1.0
    z, z_sign = up % 3, 1.0 if up < Axis.MINUS_X else -1.0
    # Left is up x forward: of two axes in cyclic order the third one, else its opposite.
    y = 3 - x - z
    y_sign = x_sign * z_sign * (1.0 if (z + 1) % 3 == x else -1.0)

    def turn(vector: Vector) -> Vector:
        return x_sign * vector[x], y_sign * vector[y], z_sign * vector[z]

    return turn
