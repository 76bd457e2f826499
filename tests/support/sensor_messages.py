"""Messages of a device with one sensor of most kinds, and their samples."""

from __future__ import annotations

from wheelwire.link.clock import ClockEstimator, Exchange
from wheelwire.link.sensor_stream import SensorStream
from wheelwire.samples import SensorEvent
from wheelwire_protocol.codes import BatteryLevel, PeripheralKind, Place, RangeQuality, SensorState
from wheelwire_protocol.peripherals import Axis, SensorChip
from wheelwire_protocol.types import Imu, Inputs, Power, Range, SensorInfo
from wheelwire_protocol.types import SensorEvent as EventMessage

AHEAD_US = 1_000_000
BOOT = 77
KINDS = (
    (PeripheralKind.IMU, Place.NONE),
    (PeripheralKind.BATTERY, Place.NONE),
    (PeripheralKind.BUMPER, Place.FRONT_LEFT),
    (PeripheralKind.CLIFF, Place.FRONT),
    (PeripheralKind.RANGE, Place.LEFT),
    (PeripheralKind.ANALOG, Place.NONE),
)
CHIPS = {0: SensorChip.MPU6050, 4: SensorChip.HC_SR04}
VALUES = {5: (2000, 2, 0)}
"""Numbers of a channel's entry: the analogue input is number 2."""


def info(
    channel: int,
    state: SensorState = SensorState.OK,
    kind: int | None = None,
    values: tuple[int, int, int] | None = None,
) -> SensorInfo:
    """What a channel is."""
    known, place = KINDS[channel]
    numbers = values or VALUES.get(channel, (0, 0, 0))
    return SensorInfo(
        session_id=0,
        channel=channel,
        channel_count=len(KINDS),
        kind=known if kind is None else kind,
        chip=CHIPS.get(channel, SensorChip.NONE),
        place=place,
        forward=Axis.Y,
        up=Axis.Z,
        state=state,
        rate_hz=(200, 2, 0, 0, 16, 0)[channel],
        gyro_scale=0.5,
        accelerometer_scale=0.25,
        gyro_noise=0.01,
        accelerometer_noise=0.02,
        **dict(zip(("bias_x", "bias_y", "bias_z"), numbers, strict=True)),
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
        *(0, 3300, 0, 0),
    )


def distance(
    t_us: int, distance_mm: int = 850, quality: int = RangeQuality.GOOD, sample: int = 1
) -> Range:
    """A measurement of the range sensor."""
    return Range(BOOT, t_us & 0xFFFF_FFFF, 4, sample, 30, distance_mm, quality)


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

    def range(self, message: Range) -> None:
        """Take a measurement of the range sensor."""
        self.stream.take_range(message, self.clock, message.t_us - AHEAD_US)

    def power(
        self,
        voltage_mv: int,
        current_ma: int = 0,
        used_mah: float = 0.0,
        level: int = BatteryLevel.OK,
    ) -> None:
        """Take a measurement of the supply."""
        message = Power(BOOT, 2_000_000, 1, voltage_mv, current_ma, used_mah, level)
        self.stream.take_power(message, self.clock, message.t_us - AHEAD_US)

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
