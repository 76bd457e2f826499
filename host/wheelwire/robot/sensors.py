"""A robot's sensors: the newest samples, all samples, states and events.

Each operation that waits is written once, for asyncio and for threads. The first use of a sensor
asks the device for samples; after that the link asks for them in each session.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Generic, NamedTuple, TypeAlias, TypeVar, cast

from wheelwire_protocol.codes import INPUTS as INPUT_KINDS
from wheelwire_protocol.codes import Group, PeripheralKind, SensorState
from wheelwire_protocol.types import ConfigurationGet, SensorStream

from ..arguments import timeout_s, whole
from ..errors import InvalidCommand, SensorMissing, SensorStale, shown
from ..link.sample_stream import LatestSample, SampleIterator
from ..samples import (
    EVENTS,
    IMU,
    INPUTS,
    POWER,
    RANGE,
    ImuSample,
    InputsSample,
    PowerSample,
    RangeSample,
    SensorEvent,
    SensorInfo,
    sentence_of_state,
)
from .calls import Requests, run

READ_WITHIN_S = 1.5  # then each channel has a sample, or a reason why not
POLL_S = 0.02
DEFAULT_RATE_HZ = 200
INFO_S = 3.0
"""Within this time each channel has sent its description, unless the line loses nearly all."""
FRESH_S = 0.1
"""`read` and `latest` return a sample up to this age, or up to three of its periods."""
_PERIODS = 3
_INPUTS_HZ = 1
MAX_RATE_HZ = 1000
_NO_ROOM = ", because the states of the wheels leave it no room on the line: lower their rate"
IN_FILE = (
    "in the board's file, and store that with `wheelwire board write`; a robot on a computer's own "
    "pins has it in the robot's file"
)
"""Where to name a sensor that a robot lacks."""

Sample = TypeVar("Sample", ImuSample, PowerSample, InputsSample)
AnySample: TypeAlias = ImuSample | PowerSample | RangeSample | InputsSample


Find: TypeAlias = Callable[[tuple[SensorInfo, ...]], SensorInfo | None]
"""Finds a sensor's channel on a robot."""


class SensorStatus(NamedTuple):
    """One channel at one moment.

    Attributes:
        info: Description of the channel.
        state: Whether the channel's samples can be used.
        age_s: Age of the newest sample; None if none can be used. [s]
        sample: The newest sample; for an input, that of all inputs.
        identity: The identity that a wrong chip in its place reports; 0: no wrong chip.
    """

    info: SensorInfo
    state: SensorState
    age_s: float | None
    sample: AnySample | None
    identity: int = 0

    @property
    def sentence(self) -> str:
        """Its state in words."""
        return sentence_of_state(self.state, self.identity)


class Streams:
    """What the sensors of one robot share."""

    def __init__(self, requests: Requests, latest: LatestSample) -> None:
        self.requests = requests
        self.latest = latest

    @property
    def infos(self) -> tuple[SensorInfo, ...]:
        """The descriptions of the channels, by number."""
        return tuple(self.requests.link.sensors.infos.values())

    async def begin(self) -> None:
        """Ask for samples, unless somebody has asked."""
        link = self.requests.link
        if not link.knows_sensors:
            await self.start(link.sensors.rate_hz or DEFAULT_RATE_HZ)

    async def start(self, rate_hz: int) -> None:
        """Ask for samples at this rate, unless somebody has asked for it."""
        link = self.requests.link
        link.check()
        if link.sensors.rate_hz != rate_hz:
            await self.ask(rate_hz)
        elif not link.knows_sensors:  # since the request, another firmware may run
            await self.requests.check_group(Group.SENSOR)
        await self.requests.wait_for_sample(
            self.latest, lambda: link.has_ended or link.knows_sensors, INFO_S
        )
        if not link.knows_sensors:
            raise link.why_no_sensors(INFO_S)

    async def start_at(self, rate_hz: int) -> None:
        """As `start`, at the rate that a program gives."""
        await self.start(whole("rate_hz", rate_hz, 1, MAX_RATE_HZ))

    async def ask(self, rate_hz: int) -> None:
        """As `start`, but without waiting for a sample, and even if already asked for."""
        link = self.requests.link
        await self.requests.check_group(Group.SENSOR)
        try:
            if not link.knows_list:
                await self.requests.check_group(Group.CONFIGURATION)
                await self.requests.ask(ConfigurationGet(0, 0))
            await self.requests.ask(SensorStream(0, 0, rate_hz))
        except InvalidCommand as error:
            raise link.refused_rate(rate_hz, error) from None

    def known(self, info: SensorInfo | None) -> tuple[SensorState, AnySample | None]:
        """The state of a channel at this moment, and its newest sample while the state is OK.

        For an input, this is the sample of all inputs.
        """
        if info is None:
            return SensorState.UNREAD, None
        state = self.requests.link.sensors.states.get(info.channel, SensorState.UNREAD)
        if state is not SensorState.OK:
            return state, None
        if info.kind is PeripheralKind.BATTERY and not info.rate_hz:
            return SensorState.OK, None  # the samples of the power sensor have its level
        if info.kind not in INPUT_KINDS:
            return self._newest(info.name, info.rate_hz)
        state, sample = self._newest(INPUTS, _INPUTS_HZ)
        if info.kind is PeripheralKind.ANALOG and not (
            isinstance(sample, InputsSample) and info.name in sample.analog
        ):
            # The event that it can be used again came before the voltage.
            return (SensorState.UNREAD if state is SensorState.OK else state), None
        return state, sample

    def known_by(self, name: str, find: Find) -> tuple[SensorState, AnySample | None]:
        """As `known`; INPUTS means all inputs together, whatever the state of each."""
        info = find(self.infos)
        return self._newest(name, _INPUTS_HZ) if info and name == INPUTS else self.known(info)

    def _newest(self, name: str, rate_hz: int) -> tuple[SensorState, AnySample | None]:
        """The newest sample of this name, unless it is too old."""
        newest = self.requests.link.sensors.newest.get(name)
        if not rate_hz:
            return SensorState.MISSED, None
        if newest is None:
            return SensorState.UNREAD, None
        sample = newest.sample()
        if self.age_s(sample) > max(FRESH_S, _PERIODS / rate_hz):
            return SensorState.MISSED, None
        return SensorState.OK, sample

    def status(self, info: SensorInfo) -> SensorStatus:
        """A channel now."""
        state, sample = self.known(info)
        age_s = None if sample is None else self.age_s(sample)
        return SensorStatus(info, state, age_s, sample, self._identity(info))

    def _identity(self, info: SensorInfo | None) -> int:
        known = self.requests.link.sensors.identities
        return 0 if info is None else known.get(info.channel, 0)

    async def read(self, name: str, find: Find, limit_s: float) -> AnySample:
        """The newest sample of a channel; waits for the first one.

        Raises:
            SensorStale: The channel cannot be used.
        """
        waits = (SensorState.UNREAD, SensorState.MISSED)
        link = self.requests.link
        await self.requests.wait_for_sample(
            self.latest,
            lambda: link.has_ended or self.known_by(name, find)[0] not in waits,
            limit_s,
        )
        state, sample = self.known_by(name, find)
        if sample is None:
            link.check()
            info = find(self.infos)
            has_no_room = info is not None and not info.rate_hz and state is SensorState.MISSED
            sentence = sentence_of_state(state, self._identity(info))
            raise SensorStale(name, state, sentence + (_NO_ROOM if has_no_room else ""))
        return sample

    def age_s(self, sample: AnySample) -> float:
        """How long ago the device measured a sample, in seconds."""
        return max(0.0, self.latest.now_us() / 1e6 - sample.stamp)


class KnownSensor(Generic[Sample]):
    """What is known of a sensor without waiting, and how it is read, for threads and asyncio.

    Args:
        streams: The robot's streams.
        name: One of IMU, POWER and INPUTS.
        find: Finds the sensor's channel.
    """

    def __init__(self, streams: Streams, name: str, find: Find) -> None:
        self._streams = streams
        self._name = name
        self._find = find

    @property
    def info(self) -> SensorInfo | None:
        """Description of the sensor; None before its first use, out of reach, and without one."""
        return self._find(self._streams.infos)

    @property
    def state(self) -> SensorState:
        """Whether the samples can be used; UNREAD before the first use. Never waits."""
        return self._known()[0]

    @property
    def latest(self) -> Sample | None:
        """The newest usable sample; None if there is none. Never waits.

        A sample can be used up to an age of 0.1 s or three periods, and while its sensor is not
        STALE. There are samples only after the first use: see `read` and `Sensors.start`.
        """
        return cast("Sample | None", self._known()[1])

    def _known(self) -> tuple[SensorState, AnySample | None]:
        return self._streams.known_by(self._name, self._find)

    async def _begin(self) -> SensorInfo:
        """Ask for samples, unless somebody has asked; returns the sensor's description."""
        await self._streams.begin()
        info = self.info
        if info is None:
            raise SensorMissing(f"the robot has no {self._name}: name it {IN_FILE}")
        return info

    async def _read(self, timeout: float) -> Sample:
        limit_s = timeout_s("timeout", timeout)
        await self._begin()
        return cast("Sample", await self._streams.read(self._name, self._find, limit_s))


class Sensor(KnownSensor[Sample]):
    """One sensor of a robot, or all its inputs together."""

    def read(self, timeout: float = 1.0) -> Sample:
        """Return the newest sample, like `latest`; waits for the first one.

        The first use of a sensor asks the robot for samples: see `Sensors.start`.

        Args:
            timeout: How long to wait for the first sample. [s]

        Raises:
            SensorMissing: The robot has no such sensor.
            SensorStale: The samples cannot be used; `state` says why.
            GroupUnavailable: The firmware has no messages about sensors, or those of another
                release.
            InvalidCommand: It is a recording without samples, or the program that holds the robot
                refuses to ask for them.
            InvalidArgument: The timeout is not a valid number.
            LinkLost, RequestTimeout: The robot was not reached.
        """
        return run(self._read, timeout)

    def samples(self) -> SampleIterator[Sample]:
        """All samples from now on, like `Robot.samples`; raises as `read` does."""
        run(self._begin)
        return self._streams.latest.iterate_sensor(self._name)


class KnownRanges:
    """What is known of the range sensors without waiting, and how each is read."""

    def __init__(self, streams: Streams) -> None:
        self._streams = streams

    @property
    def infos(self) -> dict[str, SensorInfo]:
        """The descriptions by name; empty before the first use, and while out of reach."""
        return ranges_in(self._streams.infos)

    @property
    def latest(self) -> dict[str, RangeSample]:
        """The newest sample of each sensor that can be used, like `Sensor.latest`. Never waits."""
        samples = {name: self._streams.known(info)[1] for name, info in self.infos.items()}
        return {name: one for name, one in samples.items() if isinstance(one, RangeSample)}

    async def _begin(self) -> None:
        """Ask for samples, unless somebody has asked."""
        await self._streams.begin()
        if not self.infos:
            raise SensorMissing(f"the robot has no range sensor: name it {IN_FILE}")

    async def _read(self, name: str, timeout: float) -> RangeSample:
        limit_s = timeout_s("timeout", timeout)
        await self._begin()
        known = self.infos
        if name not in tuple(known):  # a tuple, because a list has no hash
            raise SensorMissing(
                f"the robot has no range sensor {shown(name)}: choose one of {', '.join(known)}, "
                f"or name it {IN_FILE}"
            )
        read = self._streams.read(known[name].name, range_named(name), limit_s)
        return cast("RangeSample", await read)


class Ranges(KnownRanges):
    """The range sensors of a robot. A sensor's name is its place, such as `front`."""

    def read(self, name: str, timeout: float = 1.0) -> RangeSample:
        """Return the newest sample of one sensor, like `latest`; waits for the first one.

        Args:
            name: Name of the sensor, as in the board's file.
            timeout: How long to wait for the first sample. [s]

        Raises:
            SensorMissing: The robot has no such sensor.
            SensorStale, GroupUnavailable, InvalidCommand, InvalidArgument, LinkLost,
                RequestTimeout: As `Sensor.read`.
        """
        return run(self._read, name, timeout)

    def samples(self) -> SampleIterator[RangeSample]:
        """All samples of all range sensors from now on, like `Sensor.samples`."""
        run(self._begin)
        return self._streams.latest.iterate_sensor(RANGE)


class KnownSensors:
    """What is known of all sensors without waiting."""

    def __init__(self, requests: Requests, latest: LatestSample) -> None:
        self._streams = Streams(requests, latest)

    @property
    def channels(self) -> tuple[SensorStatus, ...]:
        """All channels as they are now, by number; empty before the first use. Never waits."""
        return tuple(map(self._streams.status, self._streams.infos))


class Sensors(KnownSensors):
    """All sensors of a robot.

    Attributes:
        imu: Gyroscope and accelerometer.
        power: The supply, by a power sensor or by the battery divider.
        inputs: All digital and analogue inputs together.
        ranges: The range sensors, by name.
    """

    def __init__(self, requests: Requests, latest: LatestSample) -> None:
        super().__init__(requests, latest)
        self.imu: Sensor[ImuSample] = Sensor(self._streams, *OF_IMU)
        self.power: Sensor[PowerSample] = Sensor(self._streams, *OF_POWER)
        self.inputs: Sensor[InputsSample] = Sensor(self._streams, *OF_INPUTS)
        self.ranges = Ranges(self._streams)

    def start(self, rate_hz: int = DEFAULT_RATE_HZ) -> None:
        """Ask for samples from now on, in this session and in all later ones.

        The first use of a sensor does this by itself, with 200 Hz.

        Args:
            rate_hz: Highest rate of the IMU, which gets what the wheels' samples leave of the line.
                The device sends each measurement of a range sensor, the supply twice a second, and
                the inputs on each change and once a second.

        Raises:
            InvalidArgument: The rate is not a whole number from 1 to 1000.
            GroupUnavailable, InvalidCommand, LinkLost, RequestTimeout: As `Sensor.read`.
        """
        run(self._streams.start_at, rate_hz)

    def events(self) -> SampleIterator[SensorEvent]:
        """All events of the sensors from now on; raises as `start` does.

        The logger `wheelwire.sensors` logs them, too.
        """
        # First: the device reports a line that is too slow as soon as it is asked for samples.
        events: SampleIterator[SensorEvent] = self._streams.latest.iterate_sensor(EVENTS)
        run(self._streams.begin)
        return events


def wait_until_read(sensors: Sensors) -> None:
    """Wait until each channel has a sample, or the device has reported why not; at most 1.5 s.

    This computer may have been held up: a sample that is too old gives way to the next one.
    """
    end_s = time.monotonic() + READ_WITHIN_S
    while time.monotonic() < end_s and any(map(_is_awaited, sensors.channels)):
        time.sleep(POLL_S)


def _is_awaited(status: SensorStatus) -> bool:
    # A channel without a rate has no room on the line.
    is_late = status.state is SensorState.MISSED and status.info.rate_hz > 0
    return is_late or status.state is SensorState.UNREAD


def of_kind(*kinds: PeripheralKind) -> Find:
    """The first channel of the first of these kinds that there is."""

    def find(infos: tuple[SensorInfo, ...]) -> SensorInfo | None:
        return next((info for kind in kinds for info in infos if info.kind is kind), None)

    return find


def range_named(name: str) -> Find:
    """The range sensor of this name."""

    def find(infos: tuple[SensorInfo, ...]) -> SensorInfo | None:
        return ranges_in(infos).get(name)

    return find


def ranges_in(infos: tuple[SensorInfo, ...]) -> dict[str, SensorInfo]:
    """The range sensors among these channels, by name."""
    return {info.place.name.lower(): info for info in infos if info.kind is PeripheralKind.RANGE}


OF_IMU = IMU, of_kind(PeripheralKind.IMU)
OF_POWER = POWER, of_kind(PeripheralKind.POWER, PeripheralKind.BATTERY)
OF_INPUTS = INPUTS, of_kind(*INPUT_KINDS)
