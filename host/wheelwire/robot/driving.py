"""Checks, limits and dates setpoints: the part of a driver that never waits."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from math import isfinite
from typing import Any, NoReturn

from wheelwire_protocol.codes import Fault, SupervisorState

from ..arguments import LONGEST_WAIT_S, is_number
from ..errors import (
    NO_FAULT,
    Expired,
    InvalidArgument,
    InvalidCommand,
    WheelwireError,
    meant,
    shown,
)
from ..holds import HeldBy, LastStop
from ..link.info import DeviceInfo, Health, LinkStatistics
from ..link.notices import Happening
from ..link.sample_stream import Latest, LatestSample
from ..motion.kinematics import DifferentialDrive, Twist, WheelVelocities
from .callbacks import Callbacks

DEFAULT_TTL_S = 0.5

_LATCHED = (SupervisorState.ESTOPPED, SupervisorState.FAULT)


class Driving(ABC):
    """A robot with two driven wheels that takes setpoints."""

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
            InvalidCommand: NaN, infinity; a stamp in the future; a ttl that is not above zero, or
                above the robot's parameter `ttl_max_s`. Nothing was sent. While that limit is not
                known, the robot shortens a ttl above it.
            Expired: The ttl has run out since `stamp`, or what is left of it is below the error
                bound of the robot's clock. Nothing was sent. One that runs out on the line is
                counted in `statistics` and `health`, and raises nothing.
            DeviceRefused: An e-stop or a fault is latched, or the setpoint before was refused for
                another reason than its age.
            LinkLost: The robot is out of reach.
            LinkClosed: The driver is closed.
        """
        expiry_us = self._expiry_us(ttl, stamp)
        linear, angular = _finite("linear", linear), _finite("angular", angular)
        # Asked for once: a parameter may change between two uses.
        geometry = self.geometry
        wheels = geometry.wheel_velocities(Twist(linear, angular))
        # Finite numbers can overflow in the conversion.
        if not (isfinite(wheels.left_mps) and isfinite(wheels.right_mps)):
            raise InvalidCommand(
                f"linear = {linear:g}, angular = {angular:g}: no wheel can turn that fast; "
                "give smaller numbers"
            )
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

    @property
    @abstractmethod
    def geometry(self) -> DifferentialDrive:
        """The robot's current dimensions and limits."""

    # --- what is known without waiting ---------------------------------------------------------

    @property
    def latest(self) -> Latest | None:
        """The newest sample and its age, whether it was read or not; None before the first.

        Never waits, and takes nothing from `read`. While the robot is out of reach this is the last
        sample before that: look at `age_s`.
        """
        return self._latest_sample.latest

    @property
    def is_open(self) -> bool:
        """Whether the robot is in reach at this moment. Never waits."""
        try:
            self._check_link()
        except WheelwireError:
            return False
        return True

    @property
    def ttl_max_s(self) -> float | None:
        """The longest time to live that the robot takes, in seconds; None while not known."""
        return None

    @property
    @abstractmethod
    def statistics(self) -> LinkStatistics:
        """Counters and timing of the link to the robot."""

    @property
    def health(self) -> Health:
        """Whether the robot is in reach and fit to drive, in one look. Never waits."""
        counted, latest = self.statistics, self._latest_sample.latest
        state = latest.sample.state if latest else SupervisorState.BOOT
        return Health(
            is_open=self.is_open,
            age_s=self._latest_sample.age_s,
            rate_hz=counted.state_rate_hz,
            loss=counted.recent_loss,
            clock_error_s=counted.clock_error_us / 1e6,
            latched=state if state in _LATCHED else None,
            faults=latest.sample.faults if latest else NO_FAULT,
            setpoints_expired=counted.setpoints_expired,
            ttl_max_s=self.ttl_max_s,
            held_by=self.held_by,
        )

    @property
    def held_by(self) -> HeldBy | None:
        """What keeps the robot from driving now, or from driving one way. Never waits.

        False if nothing does; None while that is not known, as out of reach. `str` says it in
        words, `names` has the stable codes.
        """
        return None

    @property
    def last_stop(self) -> LastStop | None:
        """What ended the robot's last motion, whichever program drove; None while not known."""
        return None

    # --- what is reported ----------------------------------------------------------------------

    @property
    def on_lost(self) -> Callable[[WheelwireError], object] | None:
        """Called with the error when the robot is out of reach, whatever the reason.

        Assign a function, or None, to this and to the other three. The functions may call the
        robot: they run on a thread of their own, one after the other and in order. With asyncio
        they run in the loop, and may be coroutines; in virtual time they run in the call that lets
        it pass. The driver logs what they raise, and calls none after `close` has returned. A
        function that is assigned while the robot is out of reach, a fault is latched or something
        holds the robot is called for that.
        """
        return self._callbacks.get(Happening.LOST)

    @on_lost.setter
    def on_lost(self, handler: Callable[[WheelwireError], object] | None) -> None:
        self._set_callback(Happening.LOST, handler)

    @property
    def on_opened(self) -> Callable[[DeviceInfo], object] | None:
        """Called with the device when a session was opened again; see `on_lost`.

        If the device was reset, its parameters have the values that it has saved, and it drives
        nothing before a zero setpoint or a pause.
        """
        return self._callbacks.get(Happening.OPENED)

    @on_opened.setter
    def on_opened(self, handler: Callable[[DeviceInfo], object] | None) -> None:
        self._set_callback(Happening.OPENED, handler)

    @property
    def on_fault(self) -> Callable[[Fault], object] | None:
        """Called with all latched faults when one more is latched; see `on_lost`."""
        return self._callbacks.get(Happening.FAULT)

    @on_fault.setter
    def on_fault(self, handler: Callable[[Fault], object] | None) -> None:
        self._set_callback(Happening.FAULT, handler)

    @property
    def on_held(self) -> Callable[[HeldBy], object] | None:
        """Called with all that holds the robot when that has changed; see `on_lost`.

        With one that is false, `held_by`, nothing holds it any more. Assigned while something
        does, it is called for that. It needs no sensor stream.
        """
        return self._callbacks.get(Happening.HELD)

    @on_held.setter
    def on_held(self, handler: Callable[[HeldBy], object] | None) -> None:
        self._set_callback(Happening.HELD, handler)

    def _set_callback(self, happening: Happening, handler: Callable[[Any], object] | None) -> None:
        self._callbacks.set(happening, handler)
        if handler is not None:
            self._listen(happening)

    # --- for drivers ---------------------------------------------------------------------------

    _latest_sample: LatestSample
    _callbacks: Callbacks

    def _listen(self, happening: Happening) -> None:
        """Pass news on to `_callbacks`; of `happening` also what is so already."""
        raise InvalidCommand(
            f"{self._name} does not report {happening.name} by itself: ask `is_open` and `read`"
        )

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
        return self._latest_sample.now_us()

    def _expiry_us(self, ttl: float, stamp: float | None) -> int:
        """When a command of `stamp` expires. Called first: the call's own time counts too."""
        now_us = self._now_us()
        # Nearly every ttl is a plain float within the bounds, and needs no further check.
        if type(ttl) is not float or not 0.0 < ttl <= LONGEST_WAIT_S:
            ttl = _checked_ttl(ttl)
        limit_s = self.ttl_max_s
        if limit_s is not None and ttl > limit_s:
            raise InvalidCommand(
                f"ttl = {ttl:g} s: the robot's ttl_max_s is {limit_s:g} s; give at most that, or "
                "set that parameter"
            )
        life_us = round(ttl * 1e6)
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
            raise Expired(
                f"the command is {age_us / 1e6:.3g} s old and its ttl is {life_us / 1e6:g} s: "
                "send it sooner after its stamp, or give it a longer ttl"
            )
        # Not below 0: rounding must not give a command more life than its ttl.
        return now_us - max(0, round(age_us)) + life_us

    def __setattr__(self, name: str, value: object) -> None:
        # A function that is assigned to a wrong name would never be called.
        if name.startswith("on_") and not hasattr(type(self), name):
            known = [one for one in dir(type(self)) if one.startswith("on_")]
            near = meant(name, known)
            hint = f"did you mean {near}?" if near else f"there are {', '.join(known)}"
            raise InvalidArgument(f"a robot has no {name}: {hint}")
        super().__setattr__(name, value)

    def __reduce__(self) -> NoReturn:
        raise InvalidArgument(
            f"{self._name}: a robot can be neither copied nor given to another process: open it in "
            "the process that drives, and give the others what they need to know"
        )

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


def _finite(name: str, value: float) -> float:
    if type(value) is float and isfinite(value):  # what nearly every setpoint is made of
        return value
    if not is_number(value):
        raise InvalidCommand(f"{name} = {shown(value)}: give a finite number")
    return float(value)


def _checked_ttl(ttl: float) -> float:
    if not (is_number(ttl) and ttl > 0):
        raise InvalidCommand(f"ttl = {shown(ttl)}: give the setpoint a time to live above 0 s")
    # Shortened and not refused: where its limit is not known the device shortens it in any case.
    return min(float(ttl), LONGEST_WAIT_S)
