"""What parameters cannot fix: each defect in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...errors import CommissioningFailed


@dataclass(frozen=True)
class Defect:
    """A kind of defect.

    Attributes:
        name: In a few words; `{side}` is the wheel's.
        remedy: What was seen, and what to do.
        variables: Variables of the simulator that cause it, separated by commas; empty: none does.
    """

    name: str
    remedy: str
    variables: str = ""


NO_ENCODER = Defect(
    "{side} motor without encoder",
    "the {side} wheel turned, but no counter changed: check the supply and ground of its encoder, "
    "then A and B",
    "left.encoder_dead",
)
NO_MOTOR = Defect(
    "{side} encoder without motor",
    "the {side} wheel counts when it is turned by hand, but no duty turned it: check the motor's "
    "two wires, and the bridge's inputs and enable pin of that side",
    "left.motor_open",
)
CHANNEL_DEAD = Defect(
    "{side} encoder has one dead channel",
    "its count oscillates while the wheel turns: one of A and B does not reach the board; "
    "check both wires, and that the encoder has two channels",
    "left.stuck_channel",
)
SAME_ENCODER = Defect(
    "both encoders on one wheel",
    "both counters follow the {side} wheel: connect the other wheel's A and B to their own pins",
    "encoders_same",
)
CHANNELS_MIXED = Defect(
    "A of one encoder with B of the other",
    "both counts oscillate while one wheel turns: exchange one wire of each encoder, so that "
    "A and B of a wheel are a pair",
    "channels_mixed",
)
NO_SUPPLY = Defect(
    "no motor supply",
    "no duty turned either wheel: switch the battery on, check fuse, switch and ground, and "
    "the bridge's supply and enable pins; an L298N module needs its 5V-EN jumper, or 5 V: with all "
    "three jumpers removed, nothing moves",
    "supply_v",
)
LOW_BATTERY = Defect(
    "battery low",
    "it measures {detail}: charge it, then begin again; the motors are not measured with it. If "
    "the robot is meant for so little, set nominal_supply_v first",
    "battery_v",
)
SAGS = Defect(
    "supply sags",
    "the motors pull the supply down{detail}: charge the battery, use thicker and shorter leads, "
    "and feed the board by USB alone",
    "supply_ohm, brownout_v",
)
CONTACT_OPEN = Defect(
    "e-stop contact open",
    "the e-stop cannot be cleared: release the button and check its two wires; if no contact is "
    "fitted, connect its pin to ground and set estop_input_enabled to 0",
    "estop_open",
)
ON_THE_FLOOR = Defect(
    "wheels on the floor",
    "raise the robot so that both wheels hang free, then begin again",
    "wheels_free",
)
WEAK = Defect(
    "{side} motor much weaker",
    "the {side} wheel{detail}: look for a wheel that rubs, a worn or other kind "
    "of motor, and poor contact in its wires",
    "left.torque_scale, left.winding_scale, left.motor_scale, left.coulomb_scale",
)
BLOCKED = Defect(
    "{side} wheel blocked",
    "neither duty nor hand turned it: free the wheel and its gearbox",
    "left.blocked",
)
MAGNET_MISSING = Defect(
    "{side} encoder misses a magnet",
    "its counts stop for a part of each turn and then come together: look at the magnet ring or "
    "code disc, and at its distance from the sensor",
    "left.magnet_missing",
)
BOTH_TURNED = Defect(
    "one bridge turns both wheels", "each bridge must have one motor: separate their outputs"
)
SHARED_COUNTER = Defect(
    "both wheels on one counter",
    "one counter follows both wheels and the other none: connect A and B of each wheel to their "
    "own pins",
)
UNSEEN = Defect(
    "a counter counts, but no wheel was seen turning",
    "look again: which wheel turns when the robot pulses a motor? If none does, a wheel slips on "
    "its shaft",
)
NOT_CONFIRMED = Defect(
    "wiring not confirmed",
    "driven forward with the corrections, {detail}: one of the two answers was wrong, or a "
    "contact is loose; begin again",
)
FAULTED = Defect(
    "a drive ended in a fault",
    "{detail} Repair it, then begin again; to save what was found before without tuning, answer no "
    "to the question for it",
)
TRACKS_BADLY = Defect(
    "{side} wheel tracks badly",
    "its tracking error is {detail}: its encoder may miss a magnet or be uneven: look at the "
    "magnet ring or code disc, and at its distance from the sensor; then at play in gearbox and "
    "hub, and at what rubs",
)
LATE_SETPOINTS = Defect(
    "setpoints came late",
    "up to {detail} ms apart, because this computer or the line was too busy, and so the test "
    "drives say nothing about gains and encoders: end other programs, then repeat the set-up",
)
WRONG_WHEEL = Defect(
    "answers and hand disagree",
    "{detail} when the {side} wheel was turned forward by hand: one of the two answers was wrong, "
    "or another wheel was turned, or backward; begin again",
)
DEFECTS = (
    NO_ENCODER,
    NO_MOTOR,
    CHANNEL_DEAD,
    SAME_ENCODER,
    CHANNELS_MIXED,
    NO_SUPPLY,
    LOW_BATTERY,
    SAGS,
    CONTACT_OPEN,
    ON_THE_FLOOR,
    WEAK,
    BLOCKED,
    MAGNET_MISSING,
)
"""The defects that the simulated robot can have."""
VOIDING = (NOT_CONFIRMED, WRONG_WHEEL)
"""Problems after which an earlier answer may be wrong: earlier findings are void."""


@dataclass(frozen=True)
class Problem:
    """A defect that was found.

    Attributes:
        defect: Its kind.
        side: Side of the wheel, 0 for left; None if the defect is of no wheel.
        detail: What was measured.
    """

    defect: Defect
    side: int | None = None
    detail: str = ""

    def __str__(self) -> str:
        side = "" if self.side is None else ("left", "right")[self.side]
        text = f"{self.defect.name}: {self.defect.remedy}"
        return text.format(side=side, detail=self.detail)


class Unfit(CommissioningFailed):
    """The robot has defects that no parameter can fix.

    Args:
        problems: What was found.
    """

    def __init__(self, problems: Sequence[Problem]) -> None:
        super().__init__("; ".join(map(str, problems)))
        self.problems = tuple(problems)
