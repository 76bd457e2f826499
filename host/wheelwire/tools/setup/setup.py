"""The set-up of a robot, from its board and wiring to its gains."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from wheelwire_protocol.codes import (
    Capability,
    ConfigurationState,
    Contradiction,
    Fault,
    ResetReason,
)

from ... import errors
from ...board import Configuration, chip_of_pins
from ...parameters import Trial, definition_of, number_text
from ...robot.robot import Robot
from ...whole_file import write_whole
from ..files.board import load_board, pictures_directory, shipped_boards
from ..files.parameters import ParameterFile
from ..files.state import state_folder
from ..tune.before_after import Proof, prove
from . import problems, wiring
from .counts import COUNTS, ask_counts
from .driving import BoardReset, ShowTimeLeft, not_watching, set_at_rest, show_nothing
from .expectation import expected_rms_mps, judge
from .gains import tuned
from .identification import identify
from .imu import ImuFindings, set_up_imu
from .problems import Problem, Unfit
from .questions import KEEP, YES, Person, Question, Say, yes_or_no
from .wiring import Wiring

SIZES = ("wheel_radius", "wheel_separation")
TUNED = (
    "velocity_feedforward",
    "static_feedforward",
    "nominal_supply_v",
    "acceleration_feedforward",
    "proportional_gain",
    "integral_gain",
)
CHANGED = (*Wiring().corrections, COUNTS, *SIZES, *TUNED)
"""The parameters that a set-up may change."""

_CHECK_S = 3.5
"""Time for the check of both wheels, forward."""
_DRIVES_S = 23.0
"""Time for both test drives, if nothing limits them."""

UNEQUAL_WHEELS = (
    "Setup assumes that both wheels are equal in size: each counts its own turns, so setup cannot "
    "find unequal ones. A robot that drives a curve when it should drive straight has them."
)

TUNE = yes_or_no(
    "tune",
    "Measure the motors and tune the velocity loop? The wheels turn for about two minutes.",
    YES,
)


class Progress:
    """The values found so far, of one robot.

    The robot itself has its previous values again after an interruption.

    Args:
        board_id: The robot's board id.
        folder: Folder of the files; by default where programs of this user store their state.
    """

    def __init__(self, board_id: str, folder: Path | None = None) -> None:
        self._file = (folder or state_folder()) / f"setup-{board_id}.json"

    def load(self) -> dict[str, dict[str, float]]:
        """Values of parameters by step; empty without an unfinished set-up."""
        try:
            content = json.loads(self._file.read_text("utf-8"))
        except (OSError, ValueError):
            # A damaged file is not worth an error: the set-up only starts again.
            return {}
        return content if _is_valid(content) else {}

    def save(self, found: Mapping[str, Mapping[str, float]]) -> None:
        """Keep what was found.

        Raises:
            OutputFailed: It cannot be written.
        """
        with errors.OutputFailed.of(self._file):
            self._file.parent.mkdir(parents=True, exist_ok=True)
            write_whole(self._file, json.dumps(found).encode())

    def forget(self) -> None:
        """Delete the file: setup has finished."""
        self._file.unlink(missing_ok=True)


@dataclass(frozen=True)
class Findings:
    """The results of a set-up; None for steps that it did not reach.

    Attributes:
        imu: How the IMU is mounted, and its gyroscope's bias.
        wiring: Wiring of motors and encoders.
        counts_per_revolution: Counts per revolution of both wheels.
        velocity_feedforward: In duty per m/s.
        static_feedforward: In duty.
        rms_before_mps: Tracking error of a fixed test drive with the previous values. [m/s]
        rms_after_mps: The same with the new ones. [m/s]
        rms_sound_mps: What a sound robot with as many ticks per turn reaches. [m/s]
        problems: In words, each with what to do.
        is_complete: The set-up came to its end.
        saved: The robot has saved the new values.
    """

    imu: ImuFindings | None = None
    wiring: Wiring | None = None
    counts_per_revolution: int | None = None
    velocity_feedforward: float | None = None
    static_feedforward: float | None = None
    rms_before_mps: float | None = None
    rms_after_mps: float | None = None
    rms_sound_mps: float | None = None
    problems: tuple[str, ...] = ()
    is_complete: bool = False
    saved: bool = False


@dataclass(frozen=True)
class Options:
    """How to set up.

    Attributes:
        keep: File for the new values, in place of the robot's own memory.
        resume: Go on where the last set-up was interrupted; None asks.
        progress: Where the results of an unfinished one are stored; None stores none.
        on_the_floor: Only tune, on the floor: wiring, counts and sizes are right already.
        plot: File for the picture of the test drives.
        left: Called with about how long the wheels still turn [s], time and again while they do;
            with 0 once they stand.
    """

    keep: Path | None = None
    resume: bool | None = None
    progress: Progress | None = None
    on_the_floor: bool = False
    plot: Path | None = None
    left: ShowTimeLeft = show_nothing


def set_up(robot: Robot, person: Person, say: Say, options: Options | None = None) -> Findings:
    """Find the IMU's mounting, wiring, counts, sizes and gains, and save them after a yes.

    Unless they are saved, the robot has its previous parameters again afterwards. What ends it
    early is among the problems of the findings, unless the robot is out of reach.

    Args:
        robot: The robot.
        person: Answers the questions.
        say: Called with a line on what is done and found.
        options: What differs from the ordinary.

    Raises:
        OutputFailed: A file cannot be written.
        WheelwireError: As the driver.
    """
    return _SetUp(robot, person, say, options or Options()).run()


@dataclass
class _SetUp:
    robot: Robot
    person: Person
    say: Say
    options: Options
    findings: Findings = field(default_factory=Findings)
    former: dict[str, float] = field(default_factory=dict)
    """Previous values of the parameters that were changed."""
    found: dict[str, dict[str, float]] = field(default_factory=dict)
    """Values by step."""
    resumed: Mapping[str, dict[str, float]] = field(default_factory=dict)
    """The values of an earlier run, by step."""
    pulsed: Sequence[float] = ()
    """The duty that set each wheel in motion, of a wiring found in this run."""

    def run(self) -> Findings:
        # Before the trial of parameters: a new board takes a restart, which a trial refuses.
        if not self.options.on_the_floor:
            choose_board(self.robot, self.person, self.say)
        try:
            tell_contradictions(self.robot, self.say)  # with the board that was chosen
            if not self.options.on_the_floor:
                # Before the trial of parameters, as the board; and before the robot is raised.
                keeps = self.options.keep is None
                imu = set_up_imu(self.robot, self.person, self.say, self._note, keeps=keeps)
                self.findings = replace(self.findings, imu=imu)
            with self.robot.parameters.trial() as trial:
                if self.options.on_the_floor:
                    wiring.check_floor(self.robot, self.person)
                    self.say(UNEQUAL_WHEELS)
                else:
                    # Turned by hand, a wheel is not to be reported as a robot that rolls away.
                    with not_watching(self.robot, "rolling_velocity_mps"):
                        self._find()
                self._tune()
                self._finish(trial)
        except Unfit as error:
            self._note(*error.problems)
            # What was found is void only if an answer may have been wrong.
            if any(problem.defect in problems.VOIDING for problem in error.problems):
                self._forget()
        except BoardReset as error:
            # Only the device knows whether it was the supply.
            sags = Problem(problems.SAGS, detail=" so far that the board is reset")
            self._note(sags if _was_brownout(self.robot) else str(error))
        except errors.CommissioningFailed as error:
            self._note(str(error))
        finally:
            self.options.left(0.0)
        return self.findings

    # --- steps ---------------------------------------------------------------------------------

    def _find(self) -> None:
        self.say("1/4 Robot, supply and contact. Left and right are as seen from behind.")
        wiring.check_ready(self.robot, self.person)
        self._note(*wiring.find_low_battery(self.robot))
        resumed = self.resumed = self._ask_resume()
        self.say("2/4 Wiring")
        if "wiring" in resumed:
            self._set("wiring", resumed["wiring"])
        else:
            self._find_wiring()
        # Also a resumed set-up: somebody may have changed the wires since.
        self._check_wiring()
        self.say("3/4 Counts and sizes")
        if COUNTS in resumed:
            self._set(COUNTS, resumed[COUNTS])
        else:
            counted = ask_counts(self.robot, self.person, self.say)
            if counted.doubt:
                self._note(f"{COUNTS} is doubtful: {counted.doubt}")
            self._set(COUNTS, {COUNTS: counted.value})
        self.findings = replace(
            self.findings, counts_per_revolution=round(self.robot.parameters[COUNTS])
        )
        self._set("sizes", resumed.get("sizes") or self._ask_sizes())

    def _find_wiring(self) -> None:
        # A correction that is active would be mistaken for the wires.
        self._try(Wiring().corrections)
        found, pulsed = wiring.find_wiring(self.robot, self.person, self.say)
        # Pulses are counted by bridge, `self.pulsed` is by wheel.
        duties = [one.duty for one in pulsed]
        self.pulsed = duties[::-1] if found.motors_swapped else duties
        self._set("wiring", found.corrections)
        wrong = [name for name, value in found.corrections.items() if value]
        self.say(f"found: {', '.join(wrong) or 'wired as expected'}")

    def _check_wiring(self) -> None:
        values = self.found["wiring"]
        self.findings = replace(self.findings, wiring=Wiring.of_corrections(values))
        self.say("Both wheels turn forward now, for some seconds.")
        self.options.left(_CHECK_S)
        # A resumed wiring comes without pulses.
        turning = wiring.confirm(self.robot, self.pulsed)
        self._note(*wiring.check_supply(self.robot))
        self._note(*wiring.check_wheels(self.robot, self.pulsed, turning))
        self.options.left(0.0)

    def _ask_sizes(self) -> dict[str, float]:
        texts = (
            "Radius of the driven wheels, in metres?",
            "From the middle of one tyre to the middle of the other, in metres?",
        )
        self.say(UNEQUAL_WHEELS)
        sizes = {}
        for name, text in zip(SIZES, texts, strict=True):
            now = number_text(self.robot.parameters[name])
            sizes[name] = float(self.person.answer(Question(name, text, (), now, name)))
        return sizes

    def _tune(self) -> None:
        if "gains" in self.resumed:
            self._set("gains", self.resumed["gains"])
            return
        self.say("4/4 Motors")
        if wiring.find_low_battery(self.robot):
            self.say("not measured: the battery is low")
            return
        if self.person.answer(TUNE) != YES:
            return
        try:
            after, proof = self._measure()
        except BoardReset:
            raise
        except errors.CommissioningFailed as error:
            if self.options.on_the_floor or isinstance(error, Unfit):
                # On the floor the gains are all that was asked for.
                raise
            # What was found before is still good.
            self._note(str(error))
            return
        rms_before_mps, rms_after_mps = proof.rms_mps(0, 1)
        rms_sound_mps = expected_rms_mps(self.robot, proof)
        self.findings = replace(
            self.findings,
            velocity_feedforward=after["velocity_feedforward"],
            static_feedforward=after["static_feedforward"],
            rms_before_mps=rms_before_mps,
            rms_after_mps=rms_after_mps,
            rms_sound_mps=rms_sound_mps,
        )
        self.say(proof.table())
        counts = round(self.robot.parameters[COUNTS])
        sound = f"{rms_sound_mps * 1e3:.0f} mm/s or less"
        self.say(f"A sound robot of {counts} ticks per turn reaches {sound}.")
        if self.options.plot is not None:
            self._plot(proof, self.options.plot)
        # Only now: the table and the picture show what the fault has ended.
        self._judge_faults(*proof.faults)
        if not self._judge_tracking(judge(proof, rms_sound_mps, counts)):
            return
        if proof.better:
            self._set("gains", after)
        else:
            self.say(proof.verdict())

    def _measure(self) -> tuple[dict[str, float], Proof]:
        """The values for the motors, and a test drive with the previous ones and with these."""
        try:
            found = identify(
                self.robot,
                self.say,
                on_the_floor=self.options.on_the_floor,
                left=lambda left_s: self.options.left(left_s + _DRIVES_S),
            )
            self._note(*found.problems)
            after = tuned(found, self.robot)
            return after, prove(self.robot, self._remember(after), after, self.options.left)
        except errors.DeviceRefused as error:
            if not error.faults:
                raise
            raise Unfit(
                [Problem(problems.FAULTED, detail=errors.fault_names(error.faults))]
            ) from error
        finally:
            self.options.left(0.0)

    def _judge_faults(self, before: Fault, after: Fault) -> None:
        if after:
            which = "with the previous values, too" if before else "with the new values"
            raise Unfit(
                [Problem(problems.FAULTED, detail=f"{which}. {errors.fault_names(after | before)}")]
            )
        if before:
            self.say(
                f"with the previous values a fault ended the drive: {errors.fault_names(before)}"
            )

    def _judge_tracking(self, found: Sequence[Problem]) -> bool:
        """Whether the test drives tell which values are better."""
        is_late = any(problem.defect is problems.LATE_SETPOINTS for problem in found)
        if is_late and self.options.on_the_floor:
            raise Unfit(found)
        for problem in found:
            # Its cause has a name already.
            if str(Problem(problems.MAGNET_MISSING, problem.side)) not in self.findings.problems:
                self._note(problem)
        return not is_late

    def _plot(self, proof: Proof, file: Path) -> None:
        try:
            proof.plot(file)
        except (OSError, ValueError, RuntimeError, ImportError) as error:
            # No reason to lose what was measured.
            self.say(f"cannot draw {file}: {error}")
        else:
            self.say(f"the test drives are drawn in {file}")

    def _finish(self, trial: Trial) -> None:
        self.findings = replace(self.findings, is_complete=True)
        values = {name: value for step in self.found.values() for name, value in step.items()}
        if not values:
            self.say("nothing to save")
            return
        # All of them: an active value that stays the same may not be in the store.
        self.say("To be saved, before -> after:")
        same = []
        for name, value in values.items():
            unit = definition_of(name).unit.value
            shown = f"{number_text(value)} {unit}".rstrip()
            if value == self.former[name]:
                same.append(f"{name} {shown}")
            else:
                self.say(f"  {name}: {number_text(self.former[name])} -> {shown}")
        if same:
            self.say(f"  as before: {', '.join(same)}")
        if self.options.keep is not None:
            device = self.robot.info.device if self.robot.has_device else None
            _write(self.options.keep, ParameterFile.of_values(values, device))
            self.say(f"written to {self.options.keep}; the robot has its previous values again")
        elif self.person.answer(yes_or_no("save", "Save them on the robot?")) == YES:
            # The device saves nothing while values are on trial.
            trial.keep()
            # Each by its name: saving all would also save what somebody only tried before.
            for name in values:
                self.robot.parameters.save(name)
            self.findings = replace(self.findings, saved=True)
            self.say("saved")
        else:
            again = "; run it again to go on here" if self.options.progress is not None else ""
            self.say(f"not saved; the robot has its previous values again{again}")
            return
        self._forget()

    def _forget(self) -> None:
        if self.options.progress is not None:
            self.options.progress.forget()

    # --- values --------------------------------------------------------------------------------

    def _ask_resume(self) -> Mapping[str, dict[str, float]]:
        if self.options.progress is None or self.options.resume is False:
            return {}
        found = self.options.progress.load()
        if not found or self.options.resume:
            return found
        done = ", ".join(found)
        text = f"The last set-up of this robot was not saved. Go on after {done}?"
        return found if self.person.answer(yes_or_no("resume", text, YES)) == YES else {}

    def _set(self, step: str, values: Mapping[str, float]) -> None:
        self._try(values)
        self.found[step] = dict(values)
        if self.options.progress is None:
            return
        try:
            self.options.progress.save(self.found)
        except errors.OutputFailed as error:
            self.say(f"this run cannot be resumed: {error}")

    def _try(self, values: Mapping[str, float]) -> None:
        self._remember(values)
        for name, value in values.items():
            if self.robot.parameters[name] != value:
                set_at_rest(self.robot, name, value)

    def _remember(self, names: Iterable[str]) -> dict[str, float]:
        now = {name: self.robot.parameters[name] for name in names}
        # Only the first value is the previous one: a parameter may be tried several times.
        for name, value in now.items():
            self.former.setdefault(name, value)
        return now

    def _note(self, *found: Problem | str) -> None:
        # A gap in an encoder's counts may be found twice.
        new = dict.fromkeys(map(str, found))
        texts = tuple(text for text in new if text not in self.findings.problems)
        for text in texts:
            self.say(f"problem: {text}")
        self.findings = replace(self.findings, problems=(*self.findings.problems, *texts))


def _was_brownout(robot: Robot) -> bool:
    # Waits until the device is back: what `info` says is then of its newest start.
    robot.read(timeout=3.0)
    return robot.has_device and robot.info.device.reset_reason is ResetReason.BROWNOUT


def _is_valid(content: object) -> bool:
    return isinstance(content, dict) and all(
        isinstance(values, dict)
        and all(isinstance(value, (int, float)) for value in values.values())
        for values in content.values()
    )


def choose_board(robot: Robot, person: Person, say: Say) -> None:
    """Ask which board the robot has, and store it there, unless the robot has one confirmed.

    Args:
        robot: A robot without a device that stores boards is left as it is.
        person: Answers `board` with a built-in board's name, or with `keep`, which confirms the
            board that the device believes to be on.
        say: Called with a line on what is done.

    Raises:
        BoardNotKept, DeviceRefused, LinkLost, RequestTimeout: As `DeviceBoard.take_up`.
    """
    if not robot.has_device:
        return
    if Capability.RESTART not in robot.info.device.capabilities:
        return  # its pins are in the robot's file
    try:
        state, present = robot.board.read()
    except errors.GroupUnavailable:
        return  # the device has its pins otherwise
    if state is ConfigurationState.STORED and present is not None:
        say(f"board: {present.name}")
        return
    chip = chip_of_pins(robot.info.device.board)
    boards = {name: load_board(name) for name in shipped_boards()}
    offered = {name: board for name, board in boards.items() if board.chip is chip}
    picture = next((name for name, board in offered.items() if _is_same(board, present)), None)
    pictures = pictures_directory()
    as_it_is = f"{KEEP}: none, nothing drives"
    if present is not None:
        shown = f", {pictures / picture}.svg" if picture else ""
        as_it_is = f"{KEEP}: it is {present.name}{shown}, as the firmware believes"
    answer = person.answer(
        Question(
            "board",
            f"Which board is it? {pictures}/NAME.svg shows each; {as_it_is}.",
            (*offered, KEEP),
            KEEP,
        )
    )
    chosen = present if answer == KEEP else offered[answer]
    if chosen is None:
        return
    if present is not None and _is_same(chosen, present):
        robot.board.accept(present)
        say(f"{present.name}: confirmed")
    else:
        robot.board.take_up(chosen)
        say(f"{chosen.name}: written, tried and confirmed")


def _is_same(board: Configuration, present: Configuration | None) -> bool:
    """Any peripherals are accepted."""
    return present is not None and board == replace(present, peripherals=board.peripherals)


def tell_contradictions(robot: Robot, say: Say) -> None:
    """Name the parameters that contradict each other, or the board.

    Raises:
        CommissioningFailed: There are some: nothing would drive.
    """
    if not robot.has_device:
        return
    active = robot.contradictions()
    for flag in Contradiction:
        if flag in active:
            say(f"contradiction: {flag.doc}")
    if active:
        raise errors.CommissioningFailed(
            "parameters contradict each other, and nothing drives: correct them with "
            "`wheelwire params set`, then begin again"
        )


def _write(path: Path, file: ParameterFile) -> None:
    with errors.OutputFailed.of(path):
        write_whole(path, file.text().encode())
