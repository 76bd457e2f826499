"""A robot's IMU: how it is mounted and its gyroscope's bias, found by hand with the motors off."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, TypeVar, cast

from wheelwire_protocol.codes import Capability, ConfigurationState, SensorState
from wheelwire_protocol.peripherals import Axis

from ... import errors
from ...board import Configuration, ImuSensor, axis_name, packed_entry, unpacked_entry
from ...robot.robot import Robot
from ...robot.sensors import DEFAULT_RATE_HZ
from ...samples import ImuSample, Vector, WheelSample, sentence_of_state
from . import imu_mounting as mounting
from .driving import RESTING_TICKS, fresh, next_sample, not_watching
from .imu_mounting import Mean, Reading, Unclear, angle_deg
from .questions import NO, READY, SKIP, YES, Person, Question, Say, yes_or_no

Found = TypeVar("Found")


def _step(key: str, text: str) -> Question:
    return Question(key, text, (READY, SKIP), READY)


REST = _step(
    "imu_rest",
    "Stand the robot on a level floor, and press Enter. Then leave it alone for three seconds.",
)
FRONT = _step(
    "imu_front",
    "Press Enter; then lift its front by about 30 degrees, and hold it until setup goes on.",
)
LEFT = _step(
    "imu_left", "Put the robot down, and press Enter; then lift its left side in the same way."
)
TURN = _step(
    "imu_turn",
    "Put the robot down, and press Enter; then turn it to the left on the floor, by about a "
    "quarter.",
)
SAVE = yes_or_no("save", "Save this on the robot? It restarts for that.")

_ATTEMPTS = 3
_PATIENCE_S = 60.0
"""How long setup waits for what somebody does by hand."""
_SETTLING_S = 20.0
"""How long setup waits until a robot that somebody has let go of stands still."""
_REST_S = 3.0
_HOLD_S = 0.5
_LEVEL_DEG = 10.0
"""Below this tilt, the robot stands on the floor again."""
_HELD_RADPS = 0.2
"""Most rotation, in the mean of `_HOLD_S`, of a robot that somebody holds."""
_LOOK_US = 50_000
"""How often a window of samples is judged."""
_QUIET_S = 1.0
"""After this time without a sample, setup asks the sensor's state."""
_LEAST_READINGS = 5
"""Readings that a window needs; after a gap it has fewer."""
_IDLE_HZ = 1
_UP: Vector = (0.0, 0.0, 1.0)
_RESET = "the board was reset meanwhile: look at its supply and its cable, then begin again"

_LOOK_AT = {
    SensorState.ABSENT: "its wires, and at `address` and `chip` in the board's file",
    SensorState.HUNG: "the pull-ups and the length of its wires",
    SensorState.RESET: "its supply",
    SensorState.MISSED: "its wires, and at the load of the line",
    SensorState.FROZEN: "its supply; if it stays so, replace it",
}


@dataclass(frozen=True)
class ImuFindings:
    """What a set-up has found of the IMU.

    Attributes:
        forward: The printed axis that points forward, as in a board's file.
        up: The printed axis that points up.
        bias: What the gyroscope measures at rest, about the printed axes. [rad/s]
        saved: Whether the robot has these values.
    """

    forward: str
    up: str
    bias: Vector
    saved: bool = False


class _Skipped(errors.CommissioningFailed):
    """The person leaves the IMU as it is."""


class _GivenUp(errors.CommissioningFailed):
    """The mounting cannot be found; the message says why."""


class Rest(NamedTuple):
    """What was measured while the robot stood."""

    mean: Mean
    up: Axis


def set_up_imu(
    robot: Robot, person: Person, say: Say, note: Callable[[str], None], *, keeps: bool
) -> ImuFindings | None:
    """Find how the robot's IMU is mounted, and save it after a yes. The motors are off.

    Args:
        robot: The robot; without an IMU, or a confirmed board, it stays as it is.
        person: Answers the questions, and lifts and turns the robot.
        say: Called with a line on what setup does and finds.
        note: Called with a problem; setup goes on.
        keeps: Whether the robot may save the values.

    Returns:
        The values; None if the mounting was not found.

    Raises:
        CommissioningFailed: The board was reset.
        LinkLost, RequestTimeout: The robot was not reached.
    """
    if not robot.has_device:
        return None
    board = _board_of(robot)
    entries = () if board is None else board.peripherals
    imu = next((entry for entry in entries if isinstance(entry, ImuSensor)), None)
    if board is None or imu is None:
        return None
    found = _find(robot, person, say, note, imu)
    # The next steps measure the wheels, whose samples need the whole line.
    robot.sensors.start(_IDLE_HZ)
    if found is None:
        return None
    packed = packed_entry(found)
    # A bias is stored in whole counts of the chip.
    found = cast("ImuSensor", unpacked_entry(packed))
    findings = ImuFindings(axis_name(found.forward), axis_name(found.up), found.bias)
    if packed == packed_entry(imu):
        say("IMU: the robot has these values already")
        return replace(findings, saved=True)
    _show(say, imu, found)
    if not keeps:
        say("not saved: write these values into the board's file")
        return findings
    peripherals = tuple(found if entry is imu else entry for entry in entries)
    saved = _save(robot, person, say, note, replace(board, peripherals=peripherals))
    return replace(findings, saved=saved)


def _save(
    robot: Robot, person: Person, say: Say, note: Callable[[str], None], board: Configuration
) -> bool:
    if person.answer(SAVE) != YES:
        say("not saved")
        return False
    try:
        robot.board.take_up(board)
    except (errors.BoardNotKept, errors.ConfigurationError, errors.DeviceRefused) as error:
        note(f"IMU not saved: {error}")
        return False
    say("saved; `wheelwire board read` shows the board's file with it")
    return True


def _board_of(robot: Robot) -> Configuration | None:
    if Capability.RESTART not in robot.info.device.capabilities:
        return None  # it cannot store another list
    try:
        state, board = robot.board.read()
    except errors.GroupUnavailable:
        return None
    return board if state is ConfigurationState.STORED else None


def _find(
    robot: Robot, person: Person, say: Say, note: Callable[[str], None], imu: ImuSensor
) -> ImuSensor | None:
    try:
        robot.sensors.start(DEFAULT_RATE_HZ)
        sample = robot.imu.read()
        # By default do not measure it again, unless the mounting seems to have changed.
        is_known = any(imu.bias) and angle_deg(sample.acceleration, _UP) < mounting.MOST_ASKEW_DEG
        question = yes_or_no(
            "imu",
            f"Find how the IMU ({imu.chip.name}) is mounted{', again' if is_known else ''}? You "
            "lift and turn the robot by hand; its motors stay off.",
            NO if is_known else YES,
        )
        if person.answer(question) != YES:
            return None
        # Somebody turns the robot by hand: it must not report that it rolls away.
        with robot.parameters.trial(), not_watching(robot, "rolling_velocity_mps"):
            return _Search(robot, person, say, imu).run()
    except errors.SensorMissing:
        return None  # the firmware does not read an unconfirmed list
    except errors.SensorStale as error:
        look_at = _LOOK_AT.get(error.state, "its wires")
        note(f"IMU {sentence_of_state(error.state)}. Look at {look_at}; its values stay the same")
    except (_GivenUp, errors.DeviceRefused) as error:
        note(f"the IMU's values stay as they were: {error}")
    except _Skipped:
        say("the IMU's values stay as they were")
    return None


def _show(say: Say, former: ImuSensor, found: ImuSensor) -> None:
    say("To be saved, before -> after:")
    for key in ("forward", "up"):
        before, after = (axis_name(getattr(imu, key)) for imu in (former, found))
        say(f"  imu.{key}: {before} -> {after}{' (as before)' if before == after else ''}")
    before, after = (_text_of(imu.bias) for imu in (former, found))
    say(f"  imu.bias: {before} -> {after} rad/s")


def _text_of(bias: Vector) -> str:
    # Not -0.0000.
    return f"[{', '.join(f'{round(rate, 4) + 0.0:.4f}' for rate in bias)}]"


class _Window:
    """The readings of the last seconds."""

    def __init__(self, seconds: float) -> None:
        self._length_us = round(seconds * 1e6)
        self._readings: deque[Reading] = deque()
        self._look_us = 0

    def add(self, reading: Reading) -> Mean | None:
        """The mean of the readings, whenever the search has to judge it."""
        readings = self._readings
        readings.append(reading)
        # The window needs one reading that is older than its length.
        while len(readings) > 1 and reading.t_us - readings[1].t_us >= self._length_us:
            readings.popleft()
        is_full = reading.t_us - readings[0].t_us >= self._length_us
        if not is_full or len(readings) < _LEAST_READINGS or reading.t_us < self._look_us:
            return None
        self._look_us = reading.t_us + _LOOK_US
        return mounting.mean_of(readings)


class _Search:
    """Measures while a person does what it asks for."""

    def __init__(self, robot: Robot, person: Person, say: Say, imu: ImuSensor) -> None:
        self._robot = robot
        self._person = person
        self._say = say
        self._imu = imu
        self._boot_id = fresh(robot).boot_id

    def run(self) -> ImuSensor:
        """The entry of the board's list as it should be."""
        rest = self._again(self._rest)
        forward = self._again(partial(self._forward, rest))
        self._again(partial(self._turn, rest))
        return replace(self._imu, forward=forward, up=rest.up, bias=rest.mean.gyro)

    def _again(self, step: Callable[[], Found], attempts: int = _ATTEMPTS) -> Found:
        try:
            return step()
        except Unclear as error:
            if attempts == 1:
                raise _GivenUp(str(error)) from error
            self._say(str(error))
        return self._again(step, attempts - 1)

    def _ask(self, question: Question) -> None:
        if self._person.answer(question) != READY:
            raise _Skipped

    # --- steps ---------------------------------------------------------------------------------

    def _rest(self) -> Rest:
        self._ask(REST)
        info = self._robot.imu.info
        if info is None:
            raise errors.CommissioningFailed(_RESET)
        for _, mean in self._watch(_REST_S, _SETTLING_S, on_the_floor=True):
            if mean is not None and mounting.is_steady(
                mean, info.gyro_noise, info.acceleration_noise
            ):
                mounting.check_rest(mean)
                return Rest(mean, mounting.upward_axis(mean.acceleration))
        raise Unclear(
            "the robot moves or shakes: stand it on the floor, and let go of it until setup goes on"
        )

    def _forward(self, rest: Rest) -> Axis:
        front = self._again(partial(self._lift, FRONT, rest))
        left = self._again(partial(self._lift, LEFT, rest))
        return mounting.forward_axis(rest.up, front, left)

    def _lift(self, question: Question, rest: Rest) -> Axis:
        self._ask(question)
        # The lift that was asked for before does not count.
        was_level = False
        for reading, mean in self._watch(_HOLD_S, _PATIENCE_S):
            was_level = was_level or self._is_level(reading, rest)
            if mean is None or not was_level or not _is_held(mean, rest):
                continue
            if angle_deg(rest.mean.acceleration, mean.acceleration) >= mounting.LEAST_LIFT_DEG:
                axis = mounting.raised_axis(rest.mean.acceleration, mean.acceleration)
                self._say("lifted")
                return axis
        if not was_level:
            raise Unclear(
                f"after {_PATIENCE_S:.0f} s the robot still was not level: put it down first"
            )
        raise Unclear(
            f"the robot was not lifted by {mounting.LEAST_LIFT_DEG:.0f} degrees or more, and held "
            f"there, within {_PATIENCE_S:.0f} s"
        )

    def _turn(self, rest: Rest) -> None:
        self._ask(TURN)
        former: Reading | None = None
        turned: Vector = (0.0, 0.0, 0.0)
        for reading, _ in self._watch(_HOLD_S, _PATIENCE_S):
            if former is not None:
                turned = mounting.turned_by(turned, former, reading, rest.mean.gyro)
                if mounting.is_left_turn(rest.up, turned):
                    self._say("turned to the left")
                    return
            if former is not None or self._is_level(reading, rest):
                former = reading
        raise Unclear(
            f"the robot was not turned by {mounting.TURNED_DEG:.0f} degrees within "
            f"{_PATIENCE_S:.0f} s"
        )

    @staticmethod
    def _is_level(reading: Reading, rest: Rest) -> bool:
        return angle_deg(rest.mean.acceleration, reading.acceleration) < _LEVEL_DEG

    # --- samples -------------------------------------------------------------------------------

    def _watch(
        self, window_s: float, limit_s: float, *, on_the_floor: bool = False
    ) -> Iterator[tuple[Reading, Mean | None]]:
        """Each sample for this long, some with the mean of those in a window before it.

        On the floor, the wheels must have stood during the window: they detect a smooth turn,
        during which the samples vary no more than at rest.

        Raises:
            CommissioningFailed: The board was reset.
            SensorStale: Samples stopped coming.
        """
        samples = self._robot.imu.samples()
        window = _Window(window_s)
        start = stood = fresh(self._robot)
        quiet_since: WheelSample | None = start
        while True:
            while (sample := samples.poll()) is not None:
                quiet_since = None
                reading = self._reading(sample)
                yield reading, window.add(reading)
            now = next_sample(self._robot)
            if now.boot_id != self._boot_id:
                raise errors.CommissioningFailed(_RESET)  # what was set for this is lost
            if now.since(start).dt_s > limit_s:
                return
            if on_the_floor and max(map(abs, now.since(stood)[:2])) > RESTING_TICKS:
                stood = now
                window = _Window(window_s)
            quiet_since = quiet_since or now
            if now.since(quiet_since).dt_s > _QUIET_S:
                self._robot.imu.read()
                quiet_since = now

    def _reading(self, sample: ImuSample) -> Reading:
        imu = self._imu
        gyro = mounting.in_chip(sample.gyro, imu.forward, imu.up)
        x, y, z = (rate + taken for rate, taken in zip(gyro, imu.bias, strict=True))
        return Reading(
            sample.t_us, (x, y, z), mounting.in_chip(sample.acceleration, imu.forward, imu.up)
        )


def _is_held(mean: Mean, rest: Rest) -> bool:
    return all(
        abs(rate - still) < _HELD_RADPS
        for rate, still in zip(mean.gyro, rest.mean.gyro, strict=True)
    )
