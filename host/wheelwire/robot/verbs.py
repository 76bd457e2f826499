"""The verbs of a robot, each described once, for threads and for asyncio.

Verbs that never wait are plain methods and properties. Verbs that wait are coroutines, which
asyncio awaits and threads run (`calls.blocking`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from math import isfinite
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, NoReturn, TypeVar, cast

from wheelwire_protocol import types as wire
from wheelwire_protocol.codec import schema_hash
from wheelwire_protocol.codes import (
    ConfigurationState,
    Contradiction,
    Fault,
    Group,
    RefusalCode,
    StopMode,
    SupervisorState,
)
from wheelwire_protocol.parameters import PARAMETER_BY_NAME, PARAMETERS, decimal_of_float32

from ..arguments import LONGEST_WAIT_S, finite, for_json, text, ttl_s
from ..errors import (
    NO_FAULT,
    DriverUnavailable,
    Expired,
    InvalidArgument,
    InvalidCommand,
    LinkClosed,
    LinkLost,
    WheelwireError,
    meant,
)
from ..link.holds import UNARMED, HeldBy, Holding, LastStop
from ..link.info import DeviceInfo, LinkInfo
from ..link.requests import Answer
from ..link.sample_stream import Latest, LatestSample
from ..link.traffic import Happening, Notice
from ..motion.kinematics import GEOMETRY, DifferentialDrive, WheelVelocities
from ..samples import Setpoint
from .callbacks import Callbacks
from .calls import Requests, blocking

if TYPE_CHECKING:
    from ..link.statistics import Health, LinkStatistics

DEFAULT_TTL_S = 0.5

TTL_MAX = PARAMETER_BY_NAME["ttl_max_s"].id

_ESTOP_INPUT = PARAMETER_BY_NAME["estop_input_enabled"].id
WATCHED = (
    *GEOMETRY,
    TTL_MAX,
    _ESTOP_INPUT,
    PARAMETER_BY_NAME["rearm_gap_s"].id,
    PARAMETER_BY_NAME["nominal_supply_v"].id,
)
"""The parameters that are read in each session. A program that drives needs the pause after a
clear, and `wheelwire why` needs the supply below which it is low."""

CONTACT_IGNORED = (
    "The e-stop input is switched off although the board has a contact, which stops nothing: set "
    "estop_input_enabled to 1."
)

_LATCHED = (SupervisorState.ESTOPPED, SupervisorState.FAULT)
_DOES_NOT_DRIVE = {
    ConfigurationState.BUILT_IN: RefusalCode.BOARD_UNCONFIRMED.doc,
    ConfigurationState.TRIAL: RefusalCode.BOARD_ON_TRIAL.doc,
}


AnswerT = TypeVar("AnswerT")


class Limits(NamedTuple):
    """What a setpoint is held to, as the device has it."""

    values: Mapping[int, float] | None
    """The parameters that say so; None while out of reach."""
    geometry: DifferentialDrive | None
    ttl_max_s: float | None


def wheels_of(drive: DifferentialDrive, linear: float, angular: float) -> tuple[float, float]:
    """The wheels' velocities [m/s] for a body velocity, within the limit of `drive`.

    `drive.saturate(drive.wheel_velocities(...))`, which is three calls more for each setpoint.
    Numbers that are too large for a float give wheels that are not finite.
    """
    limit = drive.max_velocity_mps
    difference = angular * drive.wheel_separation / 2
    left = (linear - difference) / drive.left_radius_multiplier
    right = (linear + difference) / drive.right_radius_multiplier
    if -limit <= left <= limit and -limit <= right <= limit:
        return left, right
    factor = limit / max(abs(left), abs(right))
    return left * factor, right * factor


class _Newest(Generic[AnswerT]):
    """The newest answer of one kind. The link's thread notes it."""

    def __init__(self, kind: type[AnswerT]) -> None:
        self._kind = kind
        self.answer: AnswerT | None = None

    def note(self, answer: Answer | WheelwireError) -> None:
        """Keep it, unless it is another one, such as a refusal."""
        if isinstance(answer, self._kind):
            self.answer = answer


class Verbs:
    """A robot with two driven wheels: what waits for nothing.

    Args:
        requests: To its device. The link watches at least the parameters of `WATCHED`.
        latest_sample: Where the link puts samples.
        callbacks: Call the application's functions.
    """

    def __init__(
        self, requests: Requests, latest_sample: LatestSample, callbacks: Callbacks
    ) -> None:
        self._requests = requests
        self._link = requests.link
        self._explanations = requests.explanations
        self._latest_sample = latest_sample
        self._callbacks = callbacks
        self._now_us = latest_sample.now_us
        """The clock of stamps and expiries."""
        self._known_limits = Limits(None, None, None)
        self._newest_counters = _Newest(wire.ControlCounters)
        self._newest_memory = _Newest(wire.MemoryValue)

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
        now_us = self._now_us()  # first: the call's own time counts, too
        # Asked for once: a parameter may change between two uses.
        limits = self._known_limits
        if limits.values is not self._link.reported.watched_values:
            limits = self._limits()
        expiry_us = self._expiry_us(now_us, ttl, stamp, limits)
        # Nearly all are plain floats: a function for each would be two more calls.
        if not (type(linear) is type(angular) is float and isfinite(linear) and isfinite(angular)):
            linear, angular = finite("linear", linear), finite("angular", angular)
        left, right = wheels_of(limits.geometry or self.geometry, linear, angular)
        # Finite numbers can overflow in the conversion.
        if not (isfinite(left) and isfinite(right)):
            raise InvalidCommand(
                f"linear = {linear:g}, angular = {angular:g}: no wheel can turn that fast; "
                "give smaller numbers"
            )
        # As `WheelVelocities`, without its call.
        self._drive_velocity(tuple.__new__(WheelVelocities, (left, right)), expiry_us)

    def set_wheel_velocity(
        self,
        left: float,
        right: float,
        ttl: float = DEFAULT_TTL_S,
        *,
        stamp: float | None = None,
    ) -> None:
        """Drive each wheel at its own velocity, in m/s at the rim; otherwise as `set_velocity`."""
        expiry_us = self._expiry_us(self._now_us(), ttl, stamp, self._limits())
        left, right = finite("left", left), finite("right", right)
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
        expiry_us = self._expiry_us(self._now_us(), ttl, stamp, self._limits())
        left, right = finite("left", left), finite("right", right)
        if max(abs(left), abs(right)) > 1:
            raise InvalidCommand(f"duty ({left:g}, {right:g}): give numbers from -1 to 1")
        self._drive_duty(left, right, expiry_us)

    # --- what is known without waiting ---------------------------------------------------------

    @property
    def info(self) -> LinkInfo:
        """Port, baud rate and device."""
        return self._link.info

    @property
    def has_device(self) -> bool:
        """Whether a Wheelwire device is behind it. The driver of another one has no `info`."""
        return True

    @property
    def geometry(self) -> DifferentialDrive:
        """The robot's current dimensions and limits, as the device has them."""
        geometry = self._limits().geometry
        if geometry is None:
            with self._explanations:
                geometry = DifferentialDrive.of_device(self._link.watched_values)
        return geometry

    @property
    def ttl_max_s(self) -> float | None:
        """The longest time to live that the robot takes, in seconds; None while out of reach.

        This is its parameter of the same name, which the link reads whenever a session opens. Never
        waits.
        """
        return self._limits().ttl_max_s

    @property
    def statistics(self) -> LinkStatistics:
        """Counters and timing of the link to the robot."""
        return self._link.statistics

    @property
    def sessions(self) -> int:
        """Number of sessions opened. The device loses its session state when one ends.

        Cheaper than `statistics`.
        """
        return self._link.sessions if self.has_device else self.statistics.sessions

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
    def health(self) -> Health:
        """Whether the robot is in reach and fit to drive, in one look. Never waits."""
        from ..link.statistics import Health

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
    def asked(self) -> Setpoint | None:
        """The active setpoint, of this program or the one that holds the robot.

        `left` and `right` are in m/s, or duties, -1..1, if `duty` is set. None once the setpoint
        has expired, or the robot was stopped. Never waits.
        """
        return self._link.asked(self._latest_sample.now_us())

    @property
    def rolling_mps(self) -> float | None:
        """The speed [m/s] at which the robot last reported rolling although nothing drives it.

        None before such a report, and after the robot slowed down or drove. Never waits.
        """
        return self._link.rolling_mps

    @property
    def held_by(self) -> HeldBy | None:
        """What keeps the robot from driving now, or from driving one way. Never waits.

        False if nothing does; None while that is not known, as out of reach. `str` says it in
        words, `names` has the stable codes.
        """
        hold = self._link.hold
        return None if hold is None else self._link.held_by(hold)

    @property
    def last_stop(self) -> LastStop | None:
        """What ended the robot's last motion, whichever program drove; None while not known.

        `program` names the program that drove, if it was one of this user's on this computer, also
        one that has died since.
        """
        hold = self._link.hold
        return None if hold is None else self._link.last_stop(hold)

    @property
    def is_unarmed(self) -> bool:
        """Whether setpoints are refused until a zero one or a pause. Never waits.

        After a clear, a start of the chip and a bumper that held the robot, from the first setpoint
        that was refused or held off: `held_by` says so. False while the robot is out of reach.
        """
        held_by = self.held_by
        return held_by is not None and bool(held_by.flags & UNARMED)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences: what about its board keeps the device from driving, or makes it less safe.

        Such as an unconfirmed board, a board on trial, or an e-stop contact whose input is switched
        off. Never waits. `contradictions` finds parameters that contradict each other.

        Raises:
            LinkLost: The robot is out of reach.
        """
        values, info = self._link.watched_values, self.info
        board = info.board
        if board is not None and board.state in _DOES_NOT_DRIVE:
            return (_DOES_NOT_DRIVE[board.state],)
        # The contact of an unconfirmed board is ignored in any case.
        if board is not None and board.has_contact and not values[_ESTOP_INPUT]:
            return (CONTACT_IGNORED,)
        return ()

    def note(self, name: str, value: Any) -> None:
        """Add a note of the program that uses the robot to its recording.

        Args:
            name: A name; a replay has the newest value of each name.
            value: What JSON can hold, NumPy's values, a path or a time.

        Raises:
            InvalidArgument: It is anything else.
        """
        name = text("name", name, "floor")
        self._link.note({name: for_json(f"note {name}", value)})

    def latest_control_counters(self) -> wire.ControlCounters | None:
        """As `control_counters`, without waiting: the newest answer to an earlier call."""
        newest = self._newest_counters
        known = newest.answer  # first: this call's answer may come while it asks
        with suppress(LinkLost, LinkClosed, DriverUnavailable):
            self._link.post(wire.ControlCountersGet(0, 0), newest.note)
        return known

    def latest_memory(self) -> wire.MemoryValue | None:
        """As `memory`, without waiting; also None where the robot cannot tell."""
        newest, link = self._newest_memory, self._link
        known = newest.answer

        def ask(answer: Answer | WheelwireError) -> None:
            # Only a device of the same messages is asked by them.
            if isinstance(answer, wire.GroupInfo) and answer.hash == schema_hash(Group.PLATFORM):
                with suppress(LinkLost, LinkClosed):
                    link.post(wire.MemoryGet(0, 0), newest.note)

        with suppress(LinkLost, LinkClosed, DriverUnavailable):
            if known is not None and known.session_id == link.session_id:  # it has said so before
                link.post(wire.MemoryGet(0, 0), newest.note)
            else:
                link.post(wire.GroupGet(0, 0, Group.PLATFORM), ask)
        return known

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

        With a false `held_by`, nothing holds it any more. Assigned while something does, it is
        called for that. It needs no sensor stream.
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

    def _listen(self, happening: Happening) -> None:
        self._requests.check_thread()
        listener, explanations = self._callbacks.listener, self._explanations

        def tell(notice: Notice) -> None:
            if isinstance(notice[1], WheelwireError):
                explanations.explain(notice[1])
            listener(notice)

        self._link.listen(tell, happening)

    def _drive_velocity(self, wheels: WheelVelocities, expiry_us: int) -> None:
        """Send a finite setpoint within the limits, without waiting.

        It expires at `expiry_us`, on the clock of `_now_us`.
        """
        try:  # with `_explanations` it would take two more calls for each setpoint
            self._link.drive_velocity(wheels[0], wheels[1], expiry_us)
        except WheelwireError as error:
            self._fail_setpoint(error)

    def _drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        """Send a setpoint, each -1..1, without waiting; otherwise as `_drive_velocity`."""
        try:
            self._link.drive_duty(left, right, expiry_us)
        except WheelwireError as error:
            self._fail_setpoint(error)

    def _fail_setpoint(self, error: WheelwireError) -> NoReturn:
        """Raise why a setpoint was not sent."""
        with self._explanations:
            if isinstance(error, LinkLost):
                # The port's thread may know a better reason; and a caller that reads next must get
                # no sample of a link that was reported lost.
                self._link.settle()
            raise error

    def _check_link(self) -> None:
        """Raise `LinkLost` if the robot is out of reach."""
        with self._explanations:
            self._link.check()

    def _learn_limits(self) -> None:
        """Once the link is open, so that the first setpoint is sent as soon as the others."""
        with suppress(WheelwireError):  # a link that only stops knows none
            self._limits()

    def _limits(self) -> Limits:
        """The device's limits, read again once the parameters have changed."""
        values, known = self._link.reported.watched_values, self._known_limits
        # Comparing identity is enough: the link replaces the values as a whole.
        if values is not known.values:
            known = Limits(None, None, None)
            if values is not None:
                ttl_max_s = decimal_of_float32(values[TTL_MAX])
                known = Limits(values, DifferentialDrive.of_device(values), ttl_max_s)
            # In one assignment, so that no thread finds new values with the old geometry.
            self._known_limits = known
        return known

    def _expiry_us(self, now_us: int, ttl: float, stamp: float | None, limits: Limits) -> int:
        """When a command of `stamp` that is given `now_us` expires."""
        # Nearly every ttl is a plain float within the bounds, and needs no further check.
        if type(ttl) is not float or not 0.0 < ttl <= LONGEST_WAIT_S:
            ttl = ttl_s(ttl)
        # Without the device's geometry the driver has limits of its own, if any.
        limit_s = self.ttl_max_s if limits.geometry is None else limits.ttl_max_s
        if limit_s is not None and ttl > limit_s:
            raise InvalidCommand(
                f"ttl = {ttl:g} s: the robot's ttl_max_s is {limit_s:g} s; give at most that, or "
                "set that parameter"
            )
        life_us = round(ttl * 1e6)
        if stamp is None:
            return now_us + life_us
        age_us = now_us - finite("stamp", stamp) * 1e6
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
            f"{self._name}: a robot cannot be copied or passed to another process: open it in "
            "the process that drives, and pass the others its values"
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
        return self._link.name


class WaitingVerbs:
    """The verbs that wait for the device, as coroutines."""

    _requests: Requests

    def __init__(self, requests: Requests) -> None:
        self._requests = requests

    async def stop(self) -> None:
        """Stop both wheels and wait for the acknowledgement.

        Raises:
            LinkLost: There is no session; the stop was sent if the port is open.
            RequestTimeout: It was not acknowledged; the setpoint's deadline acts.
        """
        await self._requests.stop(StopMode.CONFIGURED)

    async def estop(self) -> None:
        """Stop both wheels, and refuse to drive until `clear_estop`; otherwise as `stop`."""
        await self._requests.stop(None)

    async def clear_estop(self) -> None:
        """End the emergency stop; `DeviceRefused` while its cause lasts."""
        await self._requests.request(wire.ClearEstop(0, 0))

    async def clear_fault(self) -> None:
        """Clear the latched faults; `DeviceRefused` while their cause lasts."""
        await self._requests.request(wire.ClearFault(0, 0))

    async def device_counters(self) -> wire.LinkCounters:
        """What the device has counted at its end of the link since its reset."""
        return cast("wire.LinkCounters", await self._requests.request(wire.LinkCountersGet(0, 0)))

    async def contradictions(self) -> Contradiction:
        """Which active parameters contradict each other or the board, so that nothing drives."""
        answer = cast(
            "wire.Contradictions", await self._requests.request(wire.ContradictionsGet(0, 0))
        )
        return Contradiction(answer.active)

    async def holding(self) -> Holding:
        """Ask what holds the robot, and what ended its last motion: `held_by` and `last_stop`."""
        hold = cast("wire.Hold", await self._requests.request(wire.HoldGet(0, 0)))
        link = self._requests.link
        return Holding(link.held_by(hold), link.last_stop(hold))

    async def unsaved_parameters(self) -> tuple[str, ...]:
        """The parameters whose active value a reset would change; not while driving.

        Raises:
            GroupUnavailable: The firmware is of a release that cannot tell.
        """
        await self._requests.check_group(Group.STORE)
        answer = cast("wire.UnsavedValue", await self._requests.ask(wire.UnsavedGet(0, 0)))
        return tuple(p.name for p in PARAMETERS if answer.parameters >> (p.id - 1) & 1)

    async def memory(self) -> wire.MemoryValue:
        """How much of the chip's memory is left, in bytes.

        Raises:
            GroupUnavailable: The robot has no chip, or firmware of a release that cannot tell.
        """
        await self._requests.check_group(Group.PLATFORM)
        return cast("wire.MemoryValue", await self._requests.ask(wire.MemoryGet(0, 0)))

    async def control_counters(self) -> wire.ControlCounters:
        """What the device's control loop and encoders have counted since its reset."""
        return cast(
            "wire.ControlCounters", await self._requests.request(wire.ControlCountersGet(0, 0))
        )


class Questions:
    """What threads ask the device, each described above."""

    _awaited: WaitingVerbs

    device_counters = blocking(WaitingVerbs.device_counters)
    holding = blocking(WaitingVerbs.holding)
    contradictions = blocking(WaitingVerbs.contradictions)
    unsaved_parameters = blocking(WaitingVerbs.unsaved_parameters)
    control_counters = blocking(WaitingVerbs.control_counters)
    memory = blocking(WaitingVerbs.memory)
