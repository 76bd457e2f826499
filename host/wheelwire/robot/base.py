"""The interface of every driver, and what all of them share."""

from __future__ import annotations

from abc import abstractmethod
from types import TracebackType
from typing import TYPE_CHECKING, TypeVar

from ..arguments import timeout_s
from ..errors import DriverUnavailable, RequestTimeout
from ..link.sample_stream import LatestSample, SampleIterator
from ..parameters import Parameters
from ..samples import WheelSample
from .callbacks import InlineCallbacks, ThreadCallbacks
from .driving import Driving

if TYPE_CHECKING:
    from ..samples import ImuSample, InputsSample, PowerSample
    from .sensors import Ranges, Sensor, Sensors

FIRST_SAMPLE_S = 1.0

Self = TypeVar("Self", bound="BaseDriver")


class BaseDriver(Driving):
    """A robot with two driven wheels.

    A setpoint is valid for its `ttl` and no longer; the library never renews one. Methods may be
    called from any thread and in a signal handler, whatever it interrupts: each returns within its
    timeout, or raises an error of `wheelwire.errors`. Used as a context manager, a driver stops the
    robot at the exit.

    All methods that reach the robot raise `LinkLost` while it is out of reach, and `LinkClosed`
    once the driver is closed.
    """

    def __init__(self) -> None:
        self._latest_sample = LatestSample()
        self._callbacks: ThreadCallbacks | InlineCallbacks = ThreadCallbacks()

    # --- stopping ------------------------------------------------------------------------------

    @abstractmethod
    def stop(self) -> None:
        """Stop both wheels and wait until the robot has acknowledged it."""

    @abstractmethod
    def estop(self) -> None:
        """Stop both wheels, and refuse to drive until `clear_estop`."""

    @abstractmethod
    def clear_estop(self) -> None:
        """End the emergency stop; `DeviceRefused` while its cause lasts."""

    @abstractmethod
    def clear_fault(self) -> None:
        """Clear the latched faults; `DeviceRefused` while their cause lasts."""

    def close(self) -> None:
        """Same as `shutdown`; the name that files and sockets use."""
        self._callbacks.close()
        # First: iterators then end, instead of raising that the link is closed.
        self._latest_sample.close()
        self.shutdown()
        self._callbacks.wait()

    @abstractmethod
    def shutdown(self) -> None:
        """Stop the robot and release all resources. Safe to call more than once."""

    # --- measuring -----------------------------------------------------------------------------

    def read(self, timeout: float = 1.0) -> WheelSample:
        """Return the newest unread sample, waiting for one if necessary.

        A sample that was left unread for 0.1 s, or for two periods of a slower stream, is too old:
        this waits for the next one. It also waits through a reconnection if `timeout` [s], at most
        an hour, is long enough.

        Raises:
            InvalidArgument: The timeout is not a valid number.
            LinkLost: The robot was still out of reach after `timeout`.
            LinkClosed: The driver was closed, or its link has failed.
            RequestTimeout: The robot is in reach, but sent no new sample.
        """
        timeout = timeout_s("timeout", timeout)
        try:
            return self._latest_sample.take(timeout)
        except RequestTimeout:
            # Out of reach is the better explanation, if that is why nothing came.
            self._check_link()
            raise

    def samples(self) -> SampleIterator[WheelSample]:
        """All samples from now on, for `for sample in robot.samples():`.

        Each iterator has a queue of its own that holds one second of samples; its `dropped` counts
        those that were not taken in time. It waits while the robot is out of reach, however long,
        and ends when the driver is closed.
        """
        return self._latest_sample.iterate()

    def get_encoder_ticks(self) -> tuple[int, int]:
        """(left, right) ticks of the newest sample, forward positive, without bounds.

        They continue across wraps of the device's counters and across its resets.

        Raises:
            LinkLost: The robot is out of reach.
            RequestTimeout: The robot is in reach, but sends no samples.
        """
        # First: a lost robot is reported at once, and not after the wait.
        self._check_link()
        try:
            return self._latest_sample.ticks(FIRST_SAMPLE_S)
        except RequestTimeout:
            self._check_link()  # it may have been lost meanwhile
            raise

    @property
    @abstractmethod
    def parameters(self) -> Parameters:
        """The robot's parameters, by name."""

    @property
    def sensors(self) -> Sensors:
        """All sensors of the robot; `DriverUnavailable` if the driver has none."""
        raise DriverUnavailable(f"the driver of {self._name} has no sensors: name another robot")

    @property
    def imu(self) -> Sensor[ImuSample]:
        """The robot's gyroscope and accelerometer."""
        return self.sensors.imu

    @property
    def power(self) -> Sensor[PowerSample]:
        """The robot's supply: a power sensor, or the battery's divider."""
        return self.sensors.power

    @property
    def inputs(self) -> Sensor[InputsSample]:
        """The robot's inputs: bumpers, cliff sensors, fault outputs of power stages, voltages."""
        return self.sensors.inputs

    @property
    def ranges(self) -> Ranges:
        """The robot's range sensors, by name."""
        return self.sensors.ranges

    @property
    def sessions(self) -> int:
        """Number of sessions opened. The device loses its session state when one ends."""
        return self.statistics.sessions

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()
