"""What the view has seen of a robot, as data: the last 20 s, its state, the reason, the events.

Independent of terminal and driver: `source` fills it, `panels` shows it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from wheelwire_protocol.codes import Fault, SupervisorState

from ...link.holds import HeldBy
from ...link.statistics import LinkStatistics
from ...log.why.causes import LATCHES
from ...log.why.diagnosis import Stop
from ...samples import Setpoint, WheelSample

WINDOW_S = 20.0
"""The time that the plots show."""
EVENTS = 100
REPEATED_S = 2.0
"""The same event within this time counts once: a key that is held asks again and again."""


class Look(NamedTuple):
    """What a look at the driver found."""

    now_s: float
    """On the clock of the samples' stamps."""
    sample: WheelSample | None
    """The newest; None before the first."""
    asked: Setpoint | None
    trouble: str
    """Why the robot is out of reach or silent; empty if it is neither."""


class Event(NamedTuple):
    """Something that happened."""

    unix_s: float
    text: str


@dataclass
class Status:
    """What is known of the robot besides its samples. `Source` replaces it as a whole.

    Attributes:
        statistics: Statistics of the link; None without a link.
        standing: Why it stands still, as far as its state shows.
        warnings: What keeps it from driving, or makes it less safe.
        held_by: What holds it, as it reports; None: unknown.
    """

    statistics: LinkStatistics | None = None
    standing: Sequence[Stop] = ()
    warnings: Sequence[str] = ()
    held_by: HeldBy | None = None


class Model:
    """What a view shows of one robot.

    Args:
        name: Name of the robot.
        unix_minus_stamp_s: What to add to the samples' clock for the time of day.

    Attributes:
        looks: Looks of the last `WINDOW_S`, in order; without a sample while out of reach.
        events: The newest last.
        sample: The newest; None before the first.
        trouble: Why the robot is out of reach or silent; empty if it is neither.
        ended: Why nothing more will come; empty while something may.
        status: The newest.
        stop: The newest stop, and why; None while it drives, and after a clear.
    """

    def __init__(self, name: str, unix_minus_stamp_s: float) -> None:
        self.name = name
        self.looks: deque[Look] = deque()
        self.events: deque[Event] = deque(maxlen=EVENTS)
        self.sample: WheelSample | None = None
        self.trouble = ""
        self.ended = ""
        self.status = Status()
        self.stop: Stop | None = None
        self.now_s = 0.0
        self._offset_s = unix_minus_stamp_s

    @property
    def state(self) -> SupervisorState | None:
        """The supervisor's; None before the first sample."""
        return None if self.sample is None else self.sample.state

    @property
    def is_latched(self) -> bool:
        """Whether the robot drives only after a clear."""
        return self.state is not None and self.state.is_latched

    def take(self, look: Look) -> None:
        """Take what a look has found."""
        self.now_s = max(self.now_s, look.now_s)
        if look.trouble:
            if not self.trouble:
                self.say(f"out of reach: {look.trouble}")
            self.trouble = look.trouble
            self.looks.append(Look(self.now_s, None, None, look.trouble))
        elif look.sample is not None:
            if self.trouble:
                self.trouble = ""
                self.say("the link is back")
            self.looks.append(look._replace(now_s=self.now_s))
            self._take_sample(look.sample)
        while self.looks and self.looks[0].now_s < self.now_s - WINDOW_S:
            self.looks.popleft()

    def take_stop(self, stop: Stop) -> None:
        """Take a stop that was just diagnosed."""
        self.stop = stop
        self.say(stop.sentence)

    def say(self, text: str) -> None:
        """Note an event."""
        unix_s = self.now_s + self._offset_s
        for event in reversed(self.events):
            if event.unix_s < unix_s - REPEATED_S:
                break
            if event.text == text:
                return
        self.events.append(Event(unix_s, text))

    @property
    def held(self) -> tuple[str, ...]:
        """What holds it apart from a latch, in sentences, also while it drives."""
        held_by = self.status.held_by
        if held_by is None:
            return ()
        return tuple(held_by.sentence(flag) for flag in held_by if flag not in LATCHES)

    @property
    def why(self) -> tuple[str, str]:
        """Why the robot stands, and what to look at first; empty while nothing holds it."""
        if self.state is SupervisorState.DRIVING:
            return "", ""
        stops = (self.stop,) if self.stop is not None else tuple(self.status.standing)
        return (
            " ".join(f"{stop.sentence.rstrip('.')}." for stop in stops),
            "; ".join(stop.look_at for stop in stops),
        )

    def _take_sample(self, sample: WheelSample) -> None:
        before, self.sample = self.sample, sample
        if before is None:
            self.say(sample.state.name)
            return
        restarted = sample.boot_id != before.boot_id
        if restarted:
            self.say("the robot was restarted")
        if sample.state is not before.state:
            # A reset ends a latch, too; why it came is still to be read.
            cleared = before.state.is_latched and not restarted
            if sample.state is SupervisorState.DRIVING or cleared:
                self.stop = None
            self.say(sample.state.name)
        for fault in Fault:
            if fault in sample.faults and fault not in before.faults:
                self.say(f"{fault.name}: {fault.doc}")
