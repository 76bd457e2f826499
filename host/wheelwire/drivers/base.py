"""The interface of every driver, and what all of them share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from types import TracebackType
from typing import TypeVar

from ..arguments import LONGEST_WAIT_S, is_number, timeout_s
from ..errors import InvalidCommand, RequestTimeout, WheelwireError, shown
from ..link.clock import host_clock_us
from ..link.info import LinkStatistics
from ..link.latest_sample import LatestSample
from ..link.sample_iterator import SampleIterator
from ..motion.kinematics import DifferentialDrive, Twist, WheelVelocities
from ..parameters import Parameters
from ..samples import WheelSample

DEFAULT_TTL_S = 0.5
FIRST_SAMPLE_S = 1.0

Self = TypeVar("Self", bound="BaseDriver")


class BaseDriver(ABC):
    """A robot with two driven wheels.

    A setpoint is valid for its `ttl` and no longer; the library never renews one. Methods may be
    called from any thread and in a signal handler, whatever it interrupts: each returns within its
    timeout, or raises an error of `wheelwire.errors`. Used as a context manager, a driver stops the
    robot at the exit.

    All methods that reach the robot raise `LinkLost` while it is out of reach.
    """

    def __init__(self) -> None:
        self._latest_sample = LatestSample()

    # --- driving -------------------------------------------------------------------------------

    def set_velocity(
        self,
        linear: float,
        angular: float,
        ttl: float = DEFAULT_TTL_S,
        *,
        stamp: float | None = None,
    ) -> None:
        """Drive at a body velocity. Does not wait for the robot.

        Beyond the wheels' limit both are scaled by one factor, so the path keeps its curvature.

        Args:
            linear: Forward positive. [m/s]
            angular: Counter-clockwise positive. [rad/s]
            ttl: For how long, from `stamp`. [s] The robot may stop earlier by the error bound of
                its clock, never later.
            stamp: When the command was made, on `time.monotonic()`. [s] None: now.

        Raises:
            InvalidCommand: NaN, infinity; a ttl that is not above zero, has run out since `stamp`
                or is below the error bound of the robot's clock; a stamp in the future. Nothing
                was sent.
            DeviceRefused: An e-stop or a fault is latched, or the setpoint before was refused.
            LinkLost: The robot is out of reach.
        """
        expiry_us = self._expiry_us(ttl, stamp)
        linear, angular = _finite("linear", linear), _finite("angular", angular)
        geometry = self.geometry
        left, right = geometry.wheel_velocities(Twist(linear, angular))
        wheels = WheelVelocities(_finite("left", left), _finite("right", right))
        self._drive_velocity(geometry.saturate(wheels), expiry_us)

    def set_wheel_velocity(
        self,
        left: float,
        right: float,
        ttl: float = DEFAULT_TTL_S,
        *,
        stamp: float | None = None,
    ) -> None:
        """Drive each wheel at its own velocity, in m/s at the rim; otherwise as `set_velocity`."""
        expiry_us = self._expiry_us(ttl, stamp)
        left, right = _finite("left", left), _finite("right", right)
        self._drive_velocity(self.geometry.saturate(WheelVelocities(left, right)), expiry_us)

    def set_duty(
        self,
        left: float,
        right: float,
        ttl: float = DEFAULT_TTL_S,
        *,
        stamp: float | None = None,
    ) -> None:
        """Drive each wheel at a duty, -1..1, open loop; otherwise as `set_velocity`."""
        expiry_us = self._expiry_us(ttl, stamp)
        left, right = _finite("left", left), _finite("right", right)
        if max(abs(left), abs(right)) > 1:
            raise InvalidCommand(f"duty ({left:g}, {right:g}): give numbers from -1 to 1")
        self._drive_duty(left, right, expiry_us)

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
        self._latest_sample.close()
        self.shutdown()

    @abstractmethod
    def shutdown(self) -> None:
        """Stop the robot and release all resources. Safe to call more than once."""

    # --- measuring -----------------------------------------------------------------------------

    def read(self, timeout: float = 1.0) -> WheelSample:
        """Return the newest unread sample, waiting for one if necessary.

        Waits through a reconnection if `timeout` [s], at most an hour, is long enough.

        Raises:
            InvalidArgument: The timeout is not a valid number.
            LinkLost: The robot was still out of reach after `timeout`, or the link is closed.
            RequestTimeout: The robot is in reach, but sent no new sample.
        """
        timeout = timeout_s("timeout", timeout)
        try:
            return self._latest_sample.take(timeout)
        except RequestTimeout:
            self._check_link()
            raise

    def samples(self) -> SampleIterator:
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
        self._check_link()
        try:
            return self._latest_sample.ticks(FIRST_SAMPLE_S)
        except RequestTimeout:
            self._check_link()  # it may have been lost meanwhile
            raise

    @property
    @abstractmethod
    def geometry(self) -> DifferentialDrive:
        """The robot's current dimensions and limits."""

    @property
    @abstractmethod
    def parameters(self) -> Parameters:
        """The robot's parameters, by name."""

    @property
    @abstractmethod
    def statistics(self) -> LinkStatistics:
        """Counters and timing of the link to the robot."""

    @property
    def sessions(self) -> int:
        """Number of sessions opened. The device loses its session state when one ends."""
        return self.statistics.sessions

    # --- for drivers ---------------------------------------------------------------------------

    @abstractmethod
    def _drive_velocity(self, wheels: WheelVelocities, expiry_us: int) -> None:
        """Send a finite setpoint within the limits, without waiting.

        It expires at `expiry_us`, on the clock of `_now_us`.
        """

    @abstractmethod
    def _drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        """Send a setpoint, each -1..1, without waiting; otherwise as `_drive_velocity`."""

    @abstractmethod
    def _check_link(self) -> None:
        """Raise `LinkLost` if the robot is out of reach."""

    def _now_us(self) -> int:
        """The clock of stamps and expiries."""
        return host_clock_us()

    def _expiry_us(self, ttl: float, stamp: float | None) -> int:
        """When a command of `stamp` expires. Called first: the call's own time counts too."""
        now_us = self._now_us()
        life_us = round(_checked_ttl(ttl) * 1e6)
        if stamp is None:
            return now_us + life_us
        age_us = now_us - _finite("stamp", stamp) * 1e6
        # Rounding can put a stamp at most 1 us into the future; further means another clock.
        if age_us < -1:
            raise InvalidCommand(
                f"stamp = {stamp:g} is {age_us / -1e6:g} s in the future: "
                "give the time.monotonic() at which the command was made"
            )
        if age_us >= life_us:
            raise InvalidCommand(
                f"the command is {age_us / 1e6:.3g} s old and its ttl is {life_us / 1e6:g} s: "
                "send it sooner after its stamp, or give it a longer ttl"
            )
        return now_us - max(0, round(age_us)) + life_us

    def __repr__(self) -> str:
        try:
            self._check_link()
        except WheelwireError as error:
            state = str(error)
        else:
            state = "open"
        return f"<{type(self).__name__} {self._name}: {state}>"

    @property
    def _name(self) -> str:
        """The robot's name, for display."""
        return "robot"

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def _finite(name: str, value: float) -> float:
    if not is_number(value):
        raise InvalidCommand(f"{name} = {shown(value)}: give a finite number")
    return float(value)


def _checked_ttl(ttl: float) -> float:
    if not (is_number(ttl) and ttl > 0):
        raise InvalidCommand(f"ttl = {shown(ttl)}: give the setpoint a time to live above 0 s")
    return min(float(ttl), LONGEST_WAIT_S)
