"""Messages of a device with an IMU, a battery, a bumper and a cliff sensor, and their samples."""

from __future__ import annotations

from wheelwire.link.clock import ClockEstimator, Exchange
from wheelwire.link.sensor_stream import SensorStream
from wheelwire.sensors import SensorEvent
from wheelwire_protocol.sensors import (
    Axis,
    BatteryLevel,
    PeripheralKind,
    Place,
    SensorChip,
    SensorState,
)
from wheelwire_protocol.types import Imu, Inputs, SensorInfo
from wheelwire_protocol.types import SensorEvent as EventMessage

AHEAD_US = 1_000_000
BOOT = 77
KINDS = (
    (PeripheralKind.IMU, Place.NONE),
    (PeripheralKind.BATTERY, Place.NONE),
    (PeripheralKind.BUMPER, Place.FRONT_LEFT),
    (PeripheralKind.CLIFF, Place.FRONT),
)


def info(channel: int, state: SensorState = SensorState.OK, kind: int | None = None) -> SensorInfo:
    """What a channel is."""
    known, place = KINDS[channel]
    return SensorInfo(
        session_id=0,
        channel=channel,
        channel_count=len(KINDS),
        kind=known if kind is None else kind,
        chip=SensorChip.MPU6050 if channel == 0 else SensorChip.NONE,
        place=place,
        forward=Axis.Y,
        up=Axis.Z,
        state=state,
        rate_hz=(200, 2, 0, 0)[channel],
        gyro_scale=0.5,
        accelerometer_scale=0.25,
        gyro_noise=0.01,
        accelerometer_noise=0.02,
    )


def imu(t_us: int, sample: int = 1) -> Imu:
    """A sample; the chip's y points forward."""
    return Imu(BOOT, t_us & 0xFFFF_FFFF, 0, sample, 50, 2, 4, 6, 8, -12, 40, 2512)


def inputs(
    t_us: int,
    triggered: int = 0,
    stale: int = 0,
    reflexes: int = 0,
    level: BatteryLevel = BatteryLevel.WARN,
) -> Inputs:
    """All inputs: bit n is that of channel n."""
    return Inputs(
        *(BOOT, t_us, triggered, triggered, stale, reflexes, level),
        *(0, 0, 5, 6, 0, 0, 0, 0, 0, 0),
    )


class Stream:
    """A stream whose channels are known, and its clock: the device's is 1 s ahead of the host's."""

    def __init__(self, *, knows: bool = True) -> None:
        self.stream = SensorStream()
        self.clock = ClockEstimator()
        self.clock.add(Exchange(0, AHEAD_US + 100, AHEAD_US + 100, 200))
        self.stream.note_asked(200, len(KINDS), 0)
        for channel in reversed(range(len(KINDS))) if knows else ():
            self.stream.take_info(info(channel))

    def imu(self, t_us: int, now_us: int | None = None) -> None:
        """Take a sample of the IMU."""
        self.stream.take_imu(imu(t_us), self.clock, t_us - AHEAD_US if now_us is None else now_us)

    def inputs(self, message: Inputs) -> None:
        """Take all inputs."""
        self.stream.take_inputs(message, self.clock, message.t_us - AHEAD_US)

    def event(self, channel: int, code: int, value: int, t_us: int = 2_000_000) -> SensorEvent:
        """What an event becomes."""
        message = EventMessage(BOOT, t_us, channel, code, value)
        self.stream.take_event(message, self.clock, t_us - AHEAD_US)
        event = self.stream.sensed[-1].what
        assert isinstance(event, SensorEvent)
        return event

    @property
    def sensed(self) -> list[tuple[str, object]]:
        """What is passed on, as samples."""
        found = self.stream.sensed
        return [
            (one.group, one.what if isinstance(one.what, SensorEvent) else one.what.sample())
            for one in found
        ]
