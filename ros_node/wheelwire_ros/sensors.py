"""What the robot's sensors measure: topics of IMU, ranges, bumpers and battery, words about them.

Nothing here has a thread: the thread that reads the wheels' samples takes the sensors' before each
of them, so that a filter gets them in the order of their stamps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import Imu, PointCloud2, Range

from wheelwire import (
    BaseDriver,
    BatteryLevel,
    DriverUnavailable,
    GroupUnavailable,
    ImuSample,
    InputReading,
    InputsSample,
    InvalidCommand,
    PowerSample,
    RangeSample,
    Reflex,
    SensorEventCode,
    SensorInfo,
    Sensors,
    SensorState,
    SensorStatus,
    WheelSample,
    WheelwireError,
)
from wheelwire.board import BatteryLevels
from wheelwire.link.sample_stream import SampleIterator
from wheelwire.log import ros_messages
from wheelwire.log.ros_messages import OBSTACLES, Layout, obstacles
from wheelwire.samples import sentence_of_event
from wheelwire_protocol.codes import REAR_PLACES, PeripheralKind
from wheelwire_protocol.peripherals import SensorChip

from .gyro_bias import GyroBias
from .parameter_values import Get
from .publishers import BatteryPublisher, Topics, frame, frame_prefix

IMU_DEPTH = 100
"""The samples of half a second: they come with the wheels', several at once."""
PASSING = (SensorState.UNREAD, SensorState.MISSED)
"""States that a busy computer sees for a moment, too: /diagnostics has them, ~/state does not."""

ToRosNs = Callable[[float, str], int | None]
"""A stamp on the ROS clock; None if it has none. The text names the stream of samples."""


class Limits(NamedTuple):
    """What the sensors forbid. By default nothing."""

    triggered: tuple[str, ...] = ()
    """Channels of the inputs that act on the robot."""
    reflexes: tuple[str, ...] = ()
    """What is forbidden now, by name."""
    sentences: tuple[str, ...] = ()
    """The same for people, and which sensors cannot be used."""


def start(robot: BaseDriver, rate_hz: int) -> Sensors | None:
    """Have the robot send its sensors' samples; None if it has no sensors.

    Raises:
        LinkLost, RequestTimeout: The robot was not reached.
    """
    try:
        sensors = robot.sensors
        sensors.start(rate_hz)
    except (DriverUnavailable, GroupUnavailable, InvalidCommand):
        return None
    return sensors


EMPTY_CELL_V, FULL_CELL_V = 3.3, 4.2
"""Voltages of a lithium-ion cell: where the board's `cells` stop the robot, and when charged."""


def with_battery_of_board(get: Get, robot: BaseDriver) -> Get:
    """The settings; the board's number of cells, if given, fills in the battery's missing ones.

    Args:
        get: The given settings.
        robot: Asked for the levels of its battery.
    """
    if not math.isnan(get("battery_empty_v")):
        return get
    with suppress(WheelwireError):  # what cannot be read is not known
        board = robot.board.read()[1]
        for one in () if board is None else board.peripherals:
            if isinstance(one, BatteryLevels):
                cells = round(one.stop_v / EMPTY_CELL_V)
                # Levels that were given one by one say nothing of the cells.
                if cells and abs(one.stop_v - cells * EMPTY_CELL_V) < 0.01:
                    own = {"battery_empty_v": one.stop_v, "battery_full_v": cells * FULL_CELL_V}
                    return lambda name: own[name] if name in own else get(name)
    return get


class SensorPublisher:
    """Publishes what the sensors measure while the lifecycle node is active.

    Args:
        topics: The node's.
        sensors: The robot's; None: it has none.
        get: The node's settings.
        to_ros_ns: Converts the samples' stamps.
    """

    def __init__(
        self, topics: Topics, sensors: Sensors | None, get: Get, to_ros_ns: ToRosNs
    ) -> None:
        self._sensors = sensors
        self._to_ros_ns = to_ros_ns
        self._samples: dict[str, SampleIterator[Any]] = {}
        """What comes, by kind."""
        self._bias: GyroBias | None = None
        self._battery: BatteryPublisher | None = None
        self._ranges: dict[str, Any] = {}
        """Their topics, by the sensors' names."""
        self._bumpers: Any = None
        self._unstamped: list[InputsSample] = []
        self._is_turn_told = False
        if sensors is None:
            return

        self._log = topics.node.get_logger()
        self._samples["event"] = sensors.events()
        imu = sensors.imu.info
        if imu is not None:
            self._samples["imu"] = sensors.imu.samples()
            self._imu = topics.publisher(Imu, "imu/data_raw", IMU_DEPTH)
            noise_radps = imu.gyro_noise if get("imu_bias_at_rest") else 0.0
            self._bias = GyroBias(noise_radps, imu.acceleration_noise)
            self._imu_message = ros_messages.imu(frame("imu_frame_id", get))
            self._of_gyro = ros_messages.variances(imu.gyro_noise)
            self._of_acceleration = ros_messages.variances(imu.acceleration_noise)
        if sensors.power.info is not None:
            self._samples["power"] = sensors.power.samples()
            self._battery = BatteryPublisher(topics, get)
        if names := sensors.ranges.infos:
            self._samples["range"] = sensors.ranges.samples()
            self._ranges = {name: topics.publisher(Range, f"range/{name}") for name in names}
            self._range_frame = f"{frame_prefix(get)}range_"
        if sensors.inputs.info is not None:
            self._samples["inputs"] = sensors.inputs.samples()
        if any(status.info.kind in OBSTACLES for status in sensors.channels):
            self._bumpers = topics.publisher(PointCloud2, "bumpers")
            self._bumper_frame = frame("base_frame_id", get)
            self._bumper_place_m = get("bumper_radius"), get("bumper_height")

    @property
    def has_battery(self) -> bool:
        """Whether `battery_state` is published here."""
        return self._battery is not None

    @property
    def channels(self) -> tuple[SensorStatus, ...]:
        """All channels as they are now; none while the robot is out of reach."""
        with suppress(WheelwireError):
            return () if self._sensors is None else self._sensors.channels
        return ()

    def limits(self) -> Limits:
        """What the sensors forbid now."""
        channels = self.channels
        if self._sensors is None or not channels:
            return Limits()
        return limits_of(channels, self._sensors.inputs.latest)

    def take(self, wheels: WheelSample, *, publishes: bool) -> bool:
        """Take what has come up to a sample of the wheels, and publish it.

        Returns whether `limits` may have changed.
        """
        if self._sensors is None:
            return False
        if self._bias is not None:
            self._bias.note_wheels(wheels)
            for imu in self._taken("imu"):
                gyro = self._bias.corrected(imu)
                self._tell_of_turn(self._bias.turning_radps)
                if publishes:
                    numbers = *gyro, *self._of_gyro, *imu.acceleration, *self._of_acceleration
                    self._publish(self._imu, self._imu_message, imu.stamp, "imu", *numbers)
        powers, inputs = self._taken("power"), self._taken("inputs")
        ranges = self._taken("range")
        if publishes:
            for one in ranges:
                self._publish_range(one)
            for power in powers:
                self._publish_battery(power)
            if self._bumpers is not None:
                # One for which /clock had no time is not lost: the next comes after a second.
                self._unstamped = [
                    one for one in (*self._unstamped, *inputs) if not self._publish_bumpers(one)
                ][-1:]
        # The events as well: a sensor that becomes stale changes no input.
        return bool([*self._taken("event"), *powers, *inputs])

    def _taken(self, kind: str) -> list[Any]:
        """What waits of a kind; nothing once the driver is closed."""
        samples, found = self._samples.get(kind), []
        if samples is not None and samples.is_ready():
            # The reader of the wheels' samples learns of the end, too.
            with suppress(StopIteration, WheelwireError):
                while (sample := samples.poll()) is not None:
                    found.append(sample)
        return found

    def _tell_of_turn(self, radps: float) -> None:
        """Say once that a gyroscope turns while all else is at rest."""
        told, self._is_turn_told = self._is_turn_told, bool(radps)
        if radps and not told:
            self._log.warning(
                f"the gyroscope measures {radps:.3f} rad/s though wheels and accelerometer are at "
                "rest. Either something turns the robot, or it is a bias: then have `wheelwire "
                "setup` measure imu.bias"
            )

    def _publish(
        self, publisher: Any, message: Layout, stamp_s: float, stream: str, *numbers: float
    ) -> bool:
        """Whether the stamp has a time on the ROS clock; otherwise nothing is published."""
        stamp_ns = self._to_ros_ns(stamp_s, stream)
        if stamp_ns is not None:
            publisher.publish(message.fill(*ros_messages.stamp(stamp_ns), *numbers))
        return stamp_ns is not None

    def _publish_range(self, sample: RangeSample) -> None:
        publisher = self._ranges.get(sample.name)  # None: it was added to its board since
        if publisher is not None:
            message = ros_messages.range_(self._range_frame + sample.name, sample)
            self._publish(publisher, message, sample.stamp, "ranges")

    def _publish_battery(self, sample: PowerSample) -> None:
        stamp_ns = self._to_ros_ns(sample.stamp, "power")
        if stamp_ns is not None and self._battery is not None:
            self._battery.publish(stamp_ns, sample.voltage_v, sample.current_a)

    def _publish_bumpers(self, sample: InputsSample) -> bool:
        """Whether it had a stamp."""
        infos = [status.info for status in self.channels]
        points = obstacles(infos, sample, *self._bumper_place_m)
        message = ros_messages.cloud(self._bumper_frame, points)
        return self._publish(self._bumpers, message, sample.stamp, "inputs")


# --- words ---------------------------------------------------------------------------------------


def limits_of(channels: Sequence[SensorStatus], inputs: InputsSample | None) -> Limits:
    """What the sensors forbid the robot.

    Args:
        channels: All of them.
        inputs: The newest sample of the inputs, or None.
    """
    sentences = [
        f"{status.info.name}: {status.sentence}"
        for status in channels
        if status.state is not SensorState.OK and status.state not in PASSING
    ]
    for status in channels:
        sentences += filter(None, [_sentence(status)])
    if inputs is None:
        return Limits(sentences=tuple(sentences))
    reflexes = tuple(str(one.name) for one in Reflex if one in inputs.reflexes)
    return Limits(inputs.triggered, reflexes, tuple(sentences))


def _sentence(status: SensorStatus) -> str:
    """What a channel does to the robot; empty: nothing."""
    info, sample = status.info, status.sample
    if isinstance(sample, PowerSample) and sample.level > BatteryLevel.OK:
        return sentence_of_event(info.name, SensorEventCode.BATTERY, sample.level)
    if isinstance(sample, InputsSample) and info.name in sample.triggered:
        return sentence_of_event(info.name, SensorEventCode.TRIGGERED, _reflex(info))
    return ""


def _reflex(info: SensorInfo) -> Reflex:
    """What a digital input does when it has triggered."""
    if info.kind is not PeripheralKind.BUMPER:
        return Reflex.STOP
    return Reflex.NO_REVERSE if info.place in REAR_PLACES else Reflex.NO_FORWARD


def channel_words(status: SensorStatus) -> tuple[bytes, str, dict[str, Any]]:
    """A channel's level in /diagnostics, its state in words, and its values."""
    info, sample = status.info, status.sample
    values: dict[str, Any] = {
        "state": "OK" if status.state is SensorState.OK else "STALE",
        "reason": "" if status.state is SensorState.OK else status.state.name,
        "kind": info.kind.name,
        "chip": "" if info.chip is SensorChip.NONE else info.chip.name,
        "rate_hz": info.rate_hz,
        "age_s": math.nan if status.age_s is None else status.age_s,
    }
    if isinstance(sample, ImuSample):
        values["yaw_rate_radps"] = sample.gyro[2]
        values["temperature_c"] = sample.temperature_c
    elif isinstance(sample, PowerSample):
        values["voltage_v"] = sample.voltage_v
        values["current_a"] = math.nan if sample.current_a is None else sample.current_a
        values["level"] = sample.level.name
    elif isinstance(sample, RangeSample):
        values["distance_m"] = sample.distance_m
    elif isinstance(sample, InputsSample) and info.kind is PeripheralKind.ANALOG:
        values["voltage_v"] = sample.analog.get(info.name, math.nan)
    elif isinstance(sample, InputsSample):
        reading: InputReading = sample.channels[info.name]
        values["triggered"] = reading.triggered
        values["edges"] = reading.edges
    sentence = _sentence(status)
    level = DiagnosticStatus.WARN if sentence else DiagnosticStatus.OK
    if status.state is not SensorState.OK:
        level = DiagnosticStatus.STALE
    return level, sentence or status.sentence, values
