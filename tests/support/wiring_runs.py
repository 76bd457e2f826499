"""Set-ups of simulated robots in virtual time, judged by the truth."""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product

from wheelwire.drivers.mock import MockDriver, VirtualMockDriver
from wheelwire.samples import WheelSample
from wheelwire.tools.files.plant import load_plant, shipped_plants
from wheelwire.tools.setup.questions import Question, SimulatedPerson
from wheelwire.tools.setup.setup import Findings, set_up
from wheelwire.tools.setup.wiring import Wiring
from wheelwire_protocol.codes import SupervisorState

MOST_TURNS = 1.5
"""Turns of a wheel, at most, before its direction is known."""
RESOLUTIONS = (360, 1440, 2496)
UNTUNED = {"imu": "no", "tune": "no"}
_ASKED = {
    *("board", "imu", "raised", "first", "second", "counts_per_revolution"),
    *("wheel_radius", "wheel_separation", "tune", "save"),
}
"""Questions about a robot without a defect whose counts are known."""
_DRIVEN_MPS = 0.2
_DRIVEN_S = 1.0
VARIABLES = (
    *("motors_swapped", "encoders_swapped", "left.motor_reversed", "right.motor_reversed"),
    *("left.encoder_reversed", "right.encoder_reversed"),
)
"""Variables of the simulator, in the order of the fields of `Wiring`."""


SUPPLIES_V = (4.8, 12.0)
FRICTIONS = (1.0, 2.0)
"""Relative to the plant's, of either wheel."""
PLAYS_RAD = (0.0, 0.1)


@dataclass(frozen=True)
class Condition:
    """How a robot is while its wiring is found."""

    supply_v: float
    left_friction: float
    right_friction: float
    play_rad: float
    measured: bool = True
    """The robot measures its battery."""

    @property
    def settings(self) -> dict[str, float]:
        frictions = {"left": self.left_friction, "right": self.right_friction}
        scales = {
            f"{side}.{kind}_scale": friction
            for side, friction in frictions.items()
            for kind in ("coulomb", "static", "viscous")
        }
        plays = {f"{side}.backlash_rad": self.play_rad for side in frictions}
        battery_v = self.supply_v if self.measured else 0.0
        return {"supply_v": self.supply_v, "battery_v": battery_v, **scales, **plays}


@dataclass(frozen=True)
class Case:
    """A robot."""

    wired: tuple[int, ...]
    """In the order of `VARIABLES`."""
    plant: str
    counts: int
    condition: Condition | None = None
    """None: as the plant's file has it."""

    @property
    def settings(self) -> dict[str, float]:
        wired = dict(zip(VARIABLES, map(float, self.wired), strict=True))
        plant = {**load_plant(self.plant).settings, "counts_per_revolution": self.counts}
        return {**plant, **wired, **(self.condition.settings if self.condition else {})}

    @property
    def wiring(self) -> Wiring:
        return Wiring(*map(bool, self.wired))


class Watched(SimulatedPerson):
    """Answers by the truth, and notes how far the wheels had turned by then."""

    def __init__(self, robot: MockDriver, answers: Mapping[str, str] | None = None) -> None:
        super().__init__(robot, answers)
        self.robot = robot
        self.most_turns = 0.0
        self.asked: list[str] = []
        self._known = (False, False)

    def answer(self, question: Question) -> str:
        self.asked.append(question.key)
        if question.key in ("first", "second"):
            sim = self.robot.simulator
            turns = (sim.get("true.left_turns"), sim.get("true.right_turns"))
            # The first question is about one wheel; that of the second one is not known till then.
            known = self._known if question.key == "second" else (False, False)
            unknown = [abs(t) for t, known_now in zip(turns, known, strict=True) if not known_now]
            self.most_turns = max([self.most_turns, *unknown])
            self._known = (abs(turns[0]) > 0, abs(turns[1]) > 0)
        return super().answer(question)


def cases() -> Iterator[Case]:
    """All of them: 64 wirings, three plants, three resolutions."""
    for wired, plant, counts in product(
        product((0, 1), repeat=len(VARIABLES)), shipped_plants(), RESOLUTIONS
    ):
        yield Case(wired, plant, counts)


def corners() -> Iterator[Case]:
    """All of them: 64 wirings, three plants, and each limit of each condition."""
    for wired, plant, supply_v, left, right, play_rad in product(
        product((0, 1), repeat=len(VARIABLES)),
        shipped_plants(),
        SUPPLIES_V,
        FRICTIONS,
        FRICTIONS,
        PLAYS_RAD,
    ):
        yield Case(wired, plant, _counts_of(plant), Condition(supply_v, left, right, play_rad))


def between_corners(seed: int, count: int) -> Iterator[Case]:
    """Cases at random, of all wirings, plants and conditions."""
    drawn = random.Random(seed)
    for _ in range(count):
        wired = tuple(drawn.randrange(2) for _ in VARIABLES)
        plant = drawn.choice(shipped_plants())
        condition = Condition(
            drawn.uniform(*SUPPLIES_V),
            drawn.uniform(*FRICTIONS),
            drawn.uniform(*FRICTIONS),
            drawn.uniform(*PLAYS_RAD),
            measured=drawn.random() < 0.5,
        )
        yield Case(wired, plant, drawn.choice((*RESOLUTIONS, _counts_of(plant))), condition)


@cache
def _counts_of(plant: str) -> int:
    return round(load_plant(plant).settings["counts_per_revolution"])


HELD_UP_S = 1.5


class InterruptedRobot(VirtualMockDriver):
    """A simulated robot in virtual time that is reset, unplugged or held up when it is read."""

    def __init__(self, kind: str, reads: int) -> None:
        super().__init__(realtime=False)
        self._kind = kind
        self._reads = reads

    @property
    def was_interrupted(self) -> bool:
        return self._reads <= 0

    def read(self, timeout: float = 1.0) -> WheelSample:
        self._reads -= 1
        if self._reads == 0:
            if self._kind == "reset":
                self.simulator.reset()
            elif self._kind == "unplug":
                self.unplug()
            else:
                self._hold_up()
        return super().read(timeout)

    def _hold_up(self) -> None:
        """For a while nothing comes, and then all of it."""
        read, end_us = self.simulator.read, self._link.now_us + round(HELD_UP_S * 1e6)
        held = bytearray()

        def read_late() -> bytes:
            held.extend(read())
            late = bytes(held) if self._link.now_us >= end_us else b""
            del held[: len(late)]
            return late

        self.simulator.read = read_late  # type: ignore[method-assign]


def raised_robot(settings: Mapping[str, float], robot: MockDriver | None = None) -> MockDriver:
    """A simulated robot in virtual time whose wheels hang free."""
    robot = robot or MockDriver(realtime=False)
    for name, value in {"wheels_free": 1.0, **settings}.items():
        robot.simulator.set(name, value)
    return robot


def set_up_raised(
    settings: Mapping[str, float], answers: Mapping[str, str] | None = None
) -> Findings:
    """The findings of one robot."""
    with raised_robot(settings) as robot:
        person = SimulatedPerson(robot, {**UNTUNED, **(answers or {})})
        return set_up(robot, person, lambda _: None)


def check(case: Case) -> list[str]:
    """What was wrong with one set-up: nothing."""
    with raised_robot(case.settings) as robot:
        findings, asked, wrong = _set_up(case, robot)
        if findings.problems:
            wrong.append(f"problems {findings.problems}")
        if asked.count("first") != 1 or asked.count("second") != 1:
            wrong.append(f"asked {asked}")
        return wrong + _not_mended(robot)


def check_wiring(case: Case) -> list[str]:
    """The same of the wiring alone: what setup says about its motors is not judged.

    Where no gentle pulse turns a wheel, its question may come twice.
    """
    with raised_robot(case.settings) as robot:
        _, asked, wrong = _set_up(case, robot)
        return wrong if set(asked) <= _ASKED else [*wrong, f"asked {asked}"]


def _set_up(case: Case, robot: MockDriver) -> tuple[Findings, list[str], list[str]]:
    """What was found, what was asked, and what was wrong about the wiring."""
    person = Watched(robot, {**UNTUNED, "counts_per_revolution": str(case.counts)})
    findings = set_up(robot, person, lambda _: None)
    wrong = []
    if findings.wiring != case.wiring:
        wrong.append(f"named {findings.wiring}")
    if not findings.saved:
        wrong.append(f"refused: {findings.problems}")
    if person.most_turns > MOST_TURNS:
        wrong.append(f"a wheel turned {person.most_turns:.2f} times")
    return findings, person.asked, wrong


def _not_mended(robot: MockDriver) -> list[str]:
    """Drive forward with the velocity loop: each wheel turns forward as fast as it says."""
    sim = robot.simulator
    before = [sim.get(f"true.{side}_turns") for side in ("left", "right")]
    first = robot.read()
    while (sample := robot.read()).since(first).dt_s < _DRIVEN_S:
        robot.set_velocity(_DRIVEN_MPS, 0.0, ttl=0.1)
        if sample.state is SupervisorState.FAULT:
            return [f"not mended: {sample.faults!r}"]
    travel = sample.since(first)
    counts = robot.parameters["counts_per_revolution"]
    wrong = []
    for index, side in enumerate(("left", "right")):
        turned = sim.get(f"true.{side}_turns") - before[index]
        if turned < 0.2 or abs(travel[index] / counts - turned) > 0.1 * turned:
            wrong.append(f"not mended: {side} turned {turned:.2f}, counted {travel[index]}")
    return wrong
