"""Messages for viewers, written while a robot is recorded, and never read back."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Mapping

from ..errors import WheelwireError
from ..link.sample_stream import Measurement, Pacer
from ..link.sensor_stream import ImuMeasurement, InputsMeasurement, RangeMeasurement, SensorStream
from ..link.session import Session
from ..link.traffic import Happening, Kind, Record
from ..motion.kinematics import DifferentialDrive, WheelVelocities
from ..motion.odometry import Odometry
from ..samples import RangeSample, SensorEvent, WheelSample
from . import ros_messages
from .rerun import Rerun
from .ros_messages import OBSTACLES, Channel, obstacles

ODOM = Channel("/odom", *ros_messages.ODOMETRY)
TRANSFORMS = Channel("/tf", *ros_messages.TRANSFORMS)
JOINT_STATES = Channel("/joint_states", *ros_messages.JOINT_STATE)
BATTERY = Channel("/battery_state", *ros_messages.BATTERY_STATE)
IMU = Channel("/imu/data_raw", *ros_messages.IMU)
EVENTS = Channel("/wheelwire/events", *ros_messages.LOG)
CHANNELS = (ODOM, TRANSFORMS, JOINT_STATES, BATTERY, IMU, EVENTS)
"""Channels of every file. A sensor's channel begins with its first measurement."""
BUMPERS = Channel("/bumpers", *ros_messages.CLOUD)
RATE_HZ = 50.0
"""Rate of motion and IMU: the default rate at which the node publishes."""
BATTERY_PERIOD_S = 1.0
JOINTS = ("left_wheel_joint", "right_wheel_joint")
"""The default of the ROS node's parameters, as are the frames below."""
ODOM_FRAME, BASE_FRAME = "odom", "base_link"
BUMPER_RADIUS_M, BUMPER_HEIGHT_M = 0.2, 0.05

View = tuple[Channel, int, bytes]
"""Channel, time [ns since 1970], message."""


class Views:
    """Makes them of a link's records, by running its session again.

    Args:
        unix_minus_monotonic_ns: What to add to the host's clock for the time of day.

    Attributes:
        offset_ns: The same, as it is now.
    """

    def __init__(self, unix_minus_monotonic_ns: int) -> None:
        self.offset_ns = unix_minus_monotonic_ns
        self._rerun = Rerun()
        self._said: list[tuple[int, str]] = []
        """Levels and texts that wait to be written down."""
        self._state: tuple[object, ...] = ()
        self._values: Mapping[int, float] = {}
        self._odometry: Odometry | None = None
        self._turned = [0.0, 0.0]
        """Each wheel's angle since the beginning. [rad]"""
        self._last: WheelSample | None = None
        self._pacer, self._imu_pacer = Pacer(RATE_HZ), Pacer(RATE_HZ)
        self._battery_due_s = -math.inf
        self._odometry_layout = ros_messages.odometry(ODOM_FRAME, BASE_FRAME)
        self._transform_layout = ros_messages.transforms(ODOM_FRAME, BASE_FRAME)
        self._joints_layout = ros_messages.joint_state(JOINTS)
        self._battery_layout = ros_messages.battery_state(BASE_FRAME)
        self._imu_layout = ros_messages.imu(BASE_FRAME)

    def feed(self, record: Record) -> Iterator[View]:
        """The messages for viewers that one record makes, in order."""
        measured = self._rerun.feed(record)
        session = self._rerun.session
        if session is None:
            return
        if record.kind is Kind.START:
            session.warn = session.warn_held = self._warn
        time_ns = record.host_us * 1000 + self.offset_ns
        for measurement in measured:
            self._note_state(measurement)
            if self._pacer.is_due(measurement.t_us, measurement.state.boot_id):
                yield from self._motion(session, measurement.sample(), time_ns)
        yield from self._sensed(session.sensors, time_ns)
        while session.notices:
            happening, subject = session.notices.popleft()
            level = logging.INFO if happening is Happening.OPENED else logging.ERROR
            self._said.append((level, _text(happening, subject)))
        while self._said:
            level, text = self._said.pop(0)
            yield EVENTS, time_ns, ros_messages.log(time_ns, level, text)

    def _warn(self, text: str, *args: object) -> None:
        self._said.append((logging.WARNING, text % args))

    def _note_state(self, measurement: Measurement) -> None:
        state = measurement.supervisor, measurement.faults
        if state != self._state:
            self._state = state
            faults = f": {measurement.faults!r}" if measurement.faults else ""
            self._said.append((logging.INFO, f"{measurement.supervisor.name}{faults}"))

    def _motion(self, session: Session, sample: WheelSample, time_ns: int) -> Iterator[View]:
        values = session.reported.watched_values
        if values is None:
            return
        odometry = self._odometry
        if odometry is None or values is not self._values:
            self._values = values
            drive = DifferentialDrive.of_device(values)
            odometry = self._odometry = odometry or Odometry(drive)
            odometry.drive = drive
        pose = odometry.update(sample).pose
        drive = odometry.drive
        twist = drive.twist(WheelVelocities(sample.left_mps, sample.right_mps))
        stamp = self._stamp(sample.stamp)
        half_rad = pose.heading_rad / 2
        rotation = math.sin(half_rad), math.cos(half_rad)
        position = pose.x_m, pose.y_m
        data = self._odometry_layout.fill(*stamp, *position, *rotation, *[0.0] * 36, *twist)
        yield ODOM, time_ns, data
        yield TRANSFORMS, time_ns, self._transform_layout.fill(*stamp, *position, *rotation)
        yield JOINT_STATES, time_ns, self._joints(sample, drive, stamp)
        if sample.battery_v is not None and sample.stamp >= self._battery_due_s:
            self._battery_due_s = sample.stamp + BATTERY_PERIOD_S
            unknown = ros_messages.UNKNOWN
            data = self._battery_layout.fill(*stamp, sample.battery_v, unknown, unknown, 0)
            yield BATTERY, time_ns, data

    def _sensed(self, sensors: SensorStream, time_ns: int) -> Iterator[View]:
        while sensors.sensed:
            what = sensors.sensed.popleft().what
            if isinstance(what, SensorEvent):
                level = logging.WARNING if what.is_warning else logging.INFO
                self._said.append((level, what.sentence))
            elif isinstance(what, ImuMeasurement):
                if self._imu_pacer.is_due(what.t_us, what.message.boot_id):
                    yield IMU, time_ns, self._imu(what)
            elif isinstance(what, RangeMeasurement):
                yield self._range(what.sample(), time_ns)
            elif isinstance(what, InputsMeasurement):
                yield from self._bumpers(what, time_ns)

    def _range(self, sample: RangeSample, time_ns: int) -> View:
        channel = Channel(f"/range/{sample.name}", *ros_messages.RANGE)
        layout = ros_messages.range_(f"range_{sample.name}", sample)
        return channel, time_ns, layout.fill(*self._stamp(sample.stamp))

    def _bumpers(self, measurement: InputsMeasurement, time_ns: int) -> Iterator[View]:
        infos = list(measurement.infos.values())
        if any(info.kind in OBSTACLES for info in infos):
            sample = measurement.sample()
            points = obstacles(infos, sample, BUMPER_RADIUS_M, BUMPER_HEIGHT_M)
            data = ros_messages.cloud(BASE_FRAME, points).fill(*self._stamp(sample.stamp))
            yield BUMPERS, time_ns, data

    def _stamp(self, stamp_s: float) -> tuple[int, int]:
        return ros_messages.stamp(round(stamp_s * 1e9) + self.offset_ns)

    def _imu(self, measurement: ImuMeasurement) -> bytes:
        sample, info = measurement.sample(), measurement.channel.info
        stamp = self._stamp(sample.stamp)
        turning = *sample.gyro, *ros_messages.variances(info.gyro_noise)
        pulling = *sample.acceleration, *ros_messages.variances(info.acceleration_noise)
        return self._imu_layout.fill(*stamp, *turning, *pulling)

    def _joints(
        self, sample: WheelSample, drive: DifferentialDrive, stamp: tuple[int, int]
    ) -> bytes:
        travel = sample.since(self._last or sample)
        self._last = sample
        for wheel, ticks in enumerate((travel.left, travel.right)):
            self._turned[wheel] += ticks / drive.counts_per_revolution * 2 * math.pi
        speeds = sample.left_mps / drive.wheel_radius, sample.right_mps / drive.wheel_radius
        return self._joints_layout.fill(*stamp, *self._turned, *speeds)


def _text(happening: Happening, subject: object) -> str:
    if happening is Happening.OPENED:
        return f"in reach: {getattr(subject, 'board_id', '')}"
    if isinstance(subject, WheelwireError):
        return f"out of reach: {subject}"
    return f"latched: {subject!r}"
