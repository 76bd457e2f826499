"""Wheelwire: drive a wheeled robot whose real-time half runs on an ESP32.

with wheelwire.connect("/dev/ttyUSB0") as robot:
    while True:
        robot.set_velocity(0.2, 0.0, ttl=0.3)
        print(robot.read())
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .connect import connect as connect  # now: its module of the same name would hide it later

if TYPE_CHECKING:
    from wheelwire_protocol.codes import BatteryLevel as BatteryLevel
    from wheelwire_protocol.codes import EstopSource as EstopSource
    from wheelwire_protocol.codes import Fault as Fault
    from wheelwire_protocol.codes import Held as Held
    from wheelwire_protocol.codes import Reflex as Reflex
    from wheelwire_protocol.codes import RefusalCode as RefusalCode
    from wheelwire_protocol.codes import SensorEventCode as SensorEventCode
    from wheelwire_protocol.codes import SensorState as SensorState
    from wheelwire_protocol.codes import StopCause as StopCause
    from wheelwire_protocol.codes import SupervisorState as SupervisorState

    from . import aio as aio
    from .connect import driver_names as driver_names
    from .connect import open_driver as open_driver
    from .connect import open_robot as open_robot
    from .drivers.serial import SerialDriver as SerialDriver
    from .errors import ConfigurationError as ConfigurationError
    from .errors import DeviceRefused as DeviceRefused
    from .errors import DeviceSilent as DeviceSilent
    from .errors import DriverUnavailable as DriverUnavailable
    from .errors import Expired as Expired
    from .errors import ForeignDevice as ForeignDevice
    from .errors import GroupUnavailable as GroupUnavailable
    from .errors import InvalidArgument as InvalidArgument
    from .errors import InvalidCommand as InvalidCommand
    from .errors import LinkClosed as LinkClosed
    from .errors import LinkLost as LinkLost
    from .errors import ParameterOutOfRange as ParameterOutOfRange
    from .errors import PortUnavailable as PortUnavailable
    from .errors import ProtocolMismatch as ProtocolMismatch
    from .errors import RecordingError as RecordingError
    from .errors import RequestTimeout as RequestTimeout
    from .errors import RobotNotNamed as RobotNotNamed
    from .errors import SensorMissing as SensorMissing
    from .errors import SensorStale as SensorStale
    from .errors import SimulatorNotFound as SimulatorNotFound
    from .errors import UnknownParameter as UnknownParameter
    from .errors import WheelwireError as WheelwireError
    from .errors import WrongBoard as WrongBoard
    from .link.holds import HeldBy as HeldBy
    from .link.holds import LastStop as LastStop
    from .link.holds import Program as Program
    from .link.ports import SerialPort as SerialPort
    from .link.ports import ports as ports
    from .link.sample_stream import Latest as Latest
    from .link.sample_stream import SampleIterator as SampleIterator
    from .link.statistics import Health as Health
    from .link.statistics import LinkStatistics as LinkStatistics
    from .motion.covariance import PoseCovariance as PoseCovariance
    from .motion.kinematics import DifferentialDrive as DifferentialDrive
    from .motion.kinematics import Twist as Twist
    from .motion.kinematics import WheelVelocities as WheelVelocities
    from .motion.odometry import Odometry as Odometry
    from .motion.odometry import OdometryUpdate as OdometryUpdate
    from .motion.odometry import Pose as Pose
    from .pi.pins import Pins as Pins
    from .robot.robot import BaseDriver as BaseDriver
    from .robot.robot import Robot as Robot
    from .robot.sensors import Ranges as Ranges
    from .robot.sensors import Sensor as Sensor
    from .robot.sensors import Sensors as Sensors
    from .robot.sensors import SensorStatus as SensorStatus
    from .samples import ImuSample as ImuSample
    from .samples import InputReading as InputReading
    from .samples import InputsSample as InputsSample
    from .samples import PowerSample as PowerSample
    from .samples import RangeSample as RangeSample
    from .samples import SensorEvent as SensorEvent
    from .samples import SensorInfo as SensorInfo
    from .samples import WheelSample as WheelSample
    from .samples import WheelTravel as WheelTravel
    from .samples import asdict as asdict
    from .simulation.simulator import Simulator as Simulator
    from .tools.files.robot import RobotConfig as RobotConfig
    from .tools.files.robot import load_config as load_config

_MODULES = {
    "wheelwire_protocol.codes": "BatteryLevel EstopSource Fault Held Reflex RefusalCode "
    "SensorEventCode SensorState StopCause SupervisorState",
    ".motion.covariance": "PoseCovariance",
    ".connect": "driver_names open_driver open_robot",
    ".tools.files.robot": "load_config RobotConfig",
    ".robot.robot": "BaseDriver Robot",
    ".robot.sensors": "Ranges Sensor Sensors SensorStatus",
    ".drivers.serial": "SerialDriver",
    ".errors": (
        "ConfigurationError DeviceRefused DeviceSilent DriverUnavailable Expired "
        "ForeignDevice GroupUnavailable InvalidArgument InvalidCommand LinkClosed LinkLost "
        "ParameterOutOfRange PortUnavailable ProtocolMismatch RecordingError RequestTimeout "
        "RobotNotNamed SensorMissing SensorStale SimulatorNotFound UnknownParameter "
        "WheelwireError WrongBoard"
    ),
    ".motion.kinematics": "DifferentialDrive Twist WheelVelocities",
    ".pi.pins": "Pins",
    ".motion.odometry": "Odometry OdometryUpdate Pose",
    ".samples": (
        "asdict ImuSample InputReading InputsSample PowerSample RangeSample SensorEvent "
        "SensorInfo WheelSample WheelTravel"
    ),
    ".link.sample_stream": "Latest SampleIterator",
    ".simulation.simulator": "Simulator",
    ".link.holds": "HeldBy LastStop Program",
    ".link.statistics": "Health LinkStatistics",
    ".link.ports": "ports SerialPort",
}
"""Module -> what it has of the names below, which are loaded when first used."""
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = [  # loaded when first used, so that the import stays quick
    *_MODULE_OF,
    "__version__",
    "aio",
    "connect",
]


def __getattr__(name: str) -> Any:
    found: Any
    if name == "__version__":
        from .link.info import library_version

        found = library_version()
    elif name == "aio":
        found = import_module(".aio", __name__)
    elif name in _MODULE_OF:
        found = getattr(import_module(_MODULE_OF[name], __name__), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = found  # so that this is asked once
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
