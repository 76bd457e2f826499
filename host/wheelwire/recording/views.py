"""Messages for viewers, written while a robot is recorded, and never read back."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Mapping

from ..errors import WheelwireError
from ..link.news import Happening
from ..link.rerun import Rerun
from ..link.sensor_stream import ImuMeasurement, SensorStream
from ..link.session import Session
from ..link.state_stream import Measurement
from ..link.tap import Kind, Record
from ..motion.kinematics import DifferentialDrive, WheelVelocities
from ..motion.odometry import Odometry
from ..samples import WheelSample
from ..sensors import SensorEvent
from . import messages
from .writer import Channel

ODOM, JOINT_STATES = "/odom", "/joint_states"
BATTERY, EVENTS = "/battery_state", "/wheelwire/events"
IMU = "/imu/data_raw"
CHANNELS = (
    Channel(ODOM, *messages.ODOMETRY),
    Channel(JOINT_STATES, *messages.JOINT_STATE),
    Channel(BATTERY, *messages.BATTERY_STATE),
    Channel(IMU, *messages.IMU),
    Channel(EVENTS, *messages.LOG),
)
PERIOD_US = 20_000
"""Messages of the motion a second, more than a screen shows; each takes ten state frames' room."""
BATTERY_PERIOD_S = 1.0
JOINTS = ("left_wheel_joint", "right_wheel_joint")
"""The default of the ROS node's parameters, as are the frames below."""
ODOM_FRAME, BASE_FRAME = "odom", "base_link"

View = tuple[str, int, bytes]
"""Topic, time [ns since 1970], message."""


class Views:
    """Makes them of a tap's records, by running its session again.

    Args:
        unix_minus_monotonic_ns: What to add to the host's clock for the time of day.
    """

    def __init__(self, unix_minus_monotonic_ns: int) -> None:
        self._offset_ns = unix_minus_monotonic_ns
        self._rerun = Rerun()
        self._said: list[tuple[int, str]] = []
        """Levels and texts that wait to be written down."""
        self._state: tuple[object, ...] = ()
        self._values: Mapping[int, float] = {}
        self._odometry: Odometry | None = None
        self._turned = [0.0, 0.0]
        """Each wheel's angle since the beginning. [rad]"""
        self._last: WheelSample | None = None
        self._due_us = self._imu_due_us = 0
        self._battery_due_s = -math.inf
        self._odometry_layout = messages.odometry(ODOM_FRAME, BASE_FRAME)
        self._joints_layout = messages.joint_state(JOINTS)
        self._battery_layout = messages.battery_state(BASE_FRAME)
        self._imu_layout = messages.imu(BASE_FRAME)

    def feed(self, record: Record) -> Iterator[View]:
        """The messages for viewers that one record makes, in order."""
        measured = self._rerun.feed(record)
        session = self._rerun.session
        if session is None:
            return
        if record.kind is Kind.START:
            session.warn = session.warn_held = self._warn
        time_ns = record.host_us * 1000 + self._offset_ns
        for measurement in measured:
            self._note_state(measurement)
            if measurement.arrived_us >= self._due_us:
                self._due_us = measurement.arrived_us + PERIOD_US
                yield from self._motion(session, measurement.sample(), time_ns)
        yield from self._sensed(session.sensors, time_ns)
        while session.news:
            happening, subject = session.news.popleft()
            level = logging.INFO if happening is Happening.OPENED else logging.ERROR
            self._said.append((level, _text(happening, subject)))
        while self._said:
            level, text = self._said.pop(0)
            yield EVENTS, time_ns, messages.log(time_ns, level, text)

    def _warn(self, text: str, *args: object) -> None:
        self._said.append((logging.WARNING, text % args))

    def _note_state(self, measurement: Measurement) -> None:
        state = measurement.supervisor, measurement.faults
        if state != self._state:
            self._state = state
            faults = f": {measurement.faults!r}" if measurement.faults else ""
            self._said.append((logging.INFO, f"{measurement.supervisor.name}{faults}"))

    def _motion(self, session: Session, sample: WheelSample, time_ns: int) -> Iterator[View]:
        values = session.watched_values
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
        stamp = messages.stamp(round(sample.stamp * 1e9) + self._offset_ns)
        half_rad = pose.heading_rad / 2
        rotation = math.sin(half_rad), math.cos(half_rad)
        position = pose.x_m, pose.y_m
        data = self._odometry_layout.fill(*stamp, *position, *rotation, *[0.0] * 36, *twist)
        yield ODOM, time_ns, data
        yield JOINT_STATES, time_ns, self._joints(sample, drive, stamp)
        if sample.battery_v is not None and sample.stamp >= self._battery_due_s:
            self._battery_due_s = sample.stamp + BATTERY_PERIOD_S
            data = self._battery_layout.fill(*stamp, sample.battery_v, messages.UNKNOWN)
            yield BATTERY, time_ns, data

    def _sensed(self, sensors: SensorStream, time_ns: int) -> Iterator[View]:
        while sensors.sensed:
            what = sensors.sensed.popleft().what
            if isinstance(what, SensorEvent):
                level = logging.WARNING if what.is_warning else logging.INFO
                self._said.append((level, what.sentence))
            elif isinstance(what, ImuMeasurement) and what.arrived_us >= self._imu_due_us:
                self._imu_due_us = what.arrived_us + PERIOD_US
                yield IMU, time_ns, self._imu(what)

    def _imu(self, measurement: ImuMeasurement) -> bytes:
        sample, info = measurement.sample(), measurement.channel.info
        stamp = messages.stamp(round(sample.stamp * 1e9) + self._offset_ns)
        turning = *sample.gyro, *messages.variances(info.gyro_noise)
        pulling = *sample.acceleration, *messages.variances(info.acceleration_noise)
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
