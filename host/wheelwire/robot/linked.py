"""A robot behind a link: what its driver knows and sends without waiting."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from wheelwire_protocol.board import ConfigurationState
from wheelwire_protocol.codes import RefusalCode
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import ControlCounters, ControlCountersGet

from ..arguments import for_json, text
from ..errors import LinkClosed, LinkLost, WheelwireError
from ..holds import HeldBy, LastStop
from ..link.device_link import DeviceLink
from ..link.info import LinkInfo, LinkStatistics
from ..link.notices import Happening, Notice
from ..link.requests import Answer
from ..motion.kinematics import GEOMETRY, DifferentialDrive, WheelVelocities
from ..parameters import decimal_of_float32
from ..samples import Setpoint
from .calls import Requests
from .driving import Driving

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

_DOES_NOT_DRIVE = {
    ConfigurationState.BUILT_IN: RefusalCode.BOARD_UNCONFIRMED.doc,
    ConfigurationState.TRIAL: RefusalCode.BOARD_ON_TRIAL.doc,
}


class LinkedRobot(Driving):
    """All of a robot behind a link that waits for nothing, for threads and for asyncio.

    Args:
        requests: To its device. The link watches at least the parameters of `WATCHED`.
    """

    _link: DeviceLink

    def __init__(self, requests: Requests) -> None:
        self._requests = requests
        self._link = requests.link
        self._explanations = requests.explanations
        self._geometry: tuple[Mapping[int, float], DifferentialDrive | None] = {}, None
        self._ttl_max_s: tuple[Mapping[int, float], float | None] = {}, None
        # The link's thread appends to it: a deque needs no lock.
        self._newest_counters: deque[ControlCounters] = deque(maxlen=1)

    @property
    def info(self) -> LinkInfo:
        """Port, baud rate and device."""
        return self._link.info

    @property
    def geometry(self) -> DifferentialDrive:
        """The robot's current dimensions and limits, as the device has them."""
        with self._explanations:
            values = self._link.watched_values
        known, geometry = self._geometry  # set_velocity asks each time
        # By identity, which is enough: the link replaces the values as a whole.
        if geometry is None or values is not known:
            geometry = DifferentialDrive.of_device(values)
            # Both in one assignment: no thread finds new values beside the old geometry.
            self._geometry = values, geometry
        return geometry

    @property
    def ttl_max_s(self) -> float | None:
        """The longest time to live that the robot takes, in seconds; None while out of reach.

        This is its parameter of the same name, which the link reads whenever a session opens. Never
        waits.
        """
        values = self._link.watched_if_open
        known, limit_s = self._ttl_max_s  # every setpoint asks
        if values is not known:
            limit_s = None if values is None else decimal_of_float32(values[TTL_MAX])
            self._ttl_max_s = values or {}, limit_s
        return limit_s

    @property
    def statistics(self) -> LinkStatistics:
        """Counters and timing of the link."""
        return self._link.statistics

    @property
    def sessions(self) -> int:
        """Number of sessions opened; cheaper than `statistics`."""
        return self._link.sessions

    @property
    def asked(self) -> Setpoint | None:
        """The active setpoint, of this program or the one that holds the robot.

        `left` and `right` are in m/s, or duties, -1..1, if `duty` is set. None once the setpoint
        has expired, or the robot was stopped. Never waits.
        """
        return self._link.asked(self._latest_sample.now_us())

    @property
    def rolling_mps(self) -> float | None:
        """How fast the robot rolled [m/s] when it reported that it rolls though nothing drives it.

        None before such a report, and after the robot slowed down or drove. Never waits.
        """
        return self._link.rolling_mps

    @property
    def held_by(self) -> HeldBy | None:
        """As `Driving.held_by`."""
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

        After a clear, a start of the chip and a bumper that held the robot. Known once a setpoint
        was refused; False again once the robot obeys one.
        """
        return self._link.is_unarmed

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences: what of its board keeps the device from driving, or makes it less safe.

        That is a board that nobody confirmed, or one on trial, or an e-stop contact whose input is
        switched off. Never waits. `contradictions` finds parameters that contradict each other.

        Raises:
            LinkLost: The robot is out of reach.
        """
        values, info = self._link.watched_values, self.info
        board = info.board
        if board is not None and board.state in _DOES_NOT_DRIVE:
            return (_DOES_NOT_DRIVE[board.state],)
        # The contact of a board that nobody confirmed counts for nothing either way.
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

    def latest_control_counters(self) -> ControlCounters | None:
        """As `control_counters`, without waiting: the newest answer to an earlier call."""
        newest = self._newest_counters
        known = newest[0] if newest else None  # first: this call's answer may come while it asks

        def keep(answer: Answer | WheelwireError) -> None:
            if isinstance(answer, ControlCounters):
                newest.append(answer)

        with suppress(LinkLost, LinkClosed):
            self._link.post(ControlCountersGet(0, 0), keep)
        return known

    def _listen(self, happening: Happening) -> None:
        self._requests.check_thread()
        listener, explanations = self._callbacks.listener, self._explanations

        def tell(news: Notice) -> None:
            if isinstance(news[1], WheelwireError):
                explanations.explain(news[1])
            listener(news)

        self._link.listen(tell, happening)

    def _drive_velocity(self, wheels: WheelVelocities, expiry_us: int) -> None:
        self._requests.check_thread()
        with self._explanations:
            self._link.drive_velocity(wheels.left_mps, wheels.right_mps, expiry_us)

    def _drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        self._requests.check_thread()
        with self._explanations:
            self._link.drive_duty(left, right, expiry_us)

    def _check_link(self) -> None:
        with self._explanations:
            self._link.check()

    @property
    def _name(self) -> str:
        return self._link.name
