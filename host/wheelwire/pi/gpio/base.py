"""The interface to the pins, implemented by each backend."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from wheelwire_protocol.board import ContactKind
from wheelwire_protocol.core import Outputs, StageInputs
from wheelwire_protocol.power_stages import OUTPUTS, STAGES, Action, Level

from ...board import Configuration, DigitalInput, WheelPins
from ...errors import ConfigurationError, DriverUnavailable
from ..encoder import QuadratureDecoder

PWM_CHANNEL = {12: 0, 18: 0, 13: 1, 19: 1}
"""Channel of a Raspberry Pi's PWM hardware by GPIO; the GPIOs of one channel carry one signal."""
HIGH_Q15 = 32767
"""The core's number for an input that is always high."""


class PinsBusy(DriverUnavailable):
    """Another process holds a pin. A process that is ending releases it when it has braked."""


class WheelPair(NamedTuple):
    """One count for each wheel."""

    left: int
    right: int


class StagePins(ABC):
    """The inputs of one wheel's power stage. Raises `LinkLost` if they can no longer be reached.

    Args:
        names: The inputs that the stage has.
    """

    def __init__(self, names: Iterable[str]) -> None:
        # In the order of OUTPUTS, which `apply` uses, whatever the backend's order.
        self._duties = dict.fromkeys(sorted(names, key=OUTPUTS.index), 0)

    def apply(self, wanted: StageInputs) -> None:
        """Set the inputs as the core says: first what falls, then the others, enables last.

        All are set each time, changed or not: an input that can no longer be reached is noticed.
        """
        duties = {name: getattr(wanted, f"{name}_q15") for name in self._duties}
        # One direction has to end before the other begins, also while the enable stays on.
        falling = [name for name in duties if duties[name] < self._duties[name]]
        # From the last to the first: directions before the enable that has them act.
        others = [name for name in reversed(duties) if name not in falling]
        for name in (*falling, *others):
            self.set_input(name, duties[name] / HIGH_Q15)
            # Only once it is set: after a failure the old level still counts.
            self._duties[name] = duties[name]

    @abstractmethod
    def set_input(self, name: str, duty: float) -> None:
        """Set the PWM on an input, 0..1: 0 is low, 1 is high."""


def inputs_of(board: Configuration) -> tuple[str, ...]:
    """The inputs of each wheel's power stage, in the order of `OUTPUTS`."""
    return tuple(name for name in OUTPUTS if name in STAGES[board.stage].inputs)


def pwm_inputs(board: Configuration) -> tuple[str, ...]:
    """The inputs that ever take a duty, in the order of `OUTPUTS`."""
    return STAGES[board.stage].pwm_inputs


def pwm_pins(board: Configuration) -> tuple[int, ...]:
    """The GPIOs of `pwm_inputs`, the left wheel's first."""
    names = pwm_inputs(board)
    return tuple(getattr(w, name) for w in (board.left, board.right) for name in names)


def encoder_pins(wheel: WheelPins) -> tuple[int, int]:
    """The GPIOs of A and B. Raises `ConfigurationError` if one is missing."""
    if wheel.encoder_a is None or wheel.encoder_b is None:
        raise ConfigurationError("the board has an encoder without A or B: give both pins")
    return wheel.encoder_a, wheel.encoder_b


def release_inputs(board: Configuration) -> tuple[str, ...]:
    """The inputs that hold the motor off when low, whatever the levels of the others."""
    coast = STAGES[board.stage].rows[Action.COAST]
    return tuple(name for name in inputs_of(board) if coast.get(name) is Level.LOW)


def release_pins(board: Configuration) -> tuple[int, ...]:
    """The GPIOs of `release_inputs` of both wheels, and standby."""
    pins = [getattr(w, name) for w in (board.left, board.right) for name in release_inputs(board)]
    return tuple(pins if board.standby is None else [*pins, board.standby])


def digital_inputs(board: Configuration) -> dict[int, DigitalInput]:
    """The board's bumpers, cliff sensors and the like, by channel; each has a pin."""
    entries = enumerate(board.peripherals)
    return {channel: one for channel, one in entries if isinstance(one, DigitalInput)}


class Gpio(ABC):
    """The opened pins of one robot. Methods raise `LinkLost` if they can no longer be reached.

    Attributes:
        left: The left wheel's power stage.
        right: The right wheel's.
        board: What they are connected to.
        limits: What this wiring cannot do, in sentences.
    """

    left: StagePins
    right: StagePins
    board: Configuration
    limits: tuple[str, ...] = ()

    decoders: Sequence[QuadratureDecoder]
    """The left encoder's and the right one's; callbacks feed them."""

    def ticks(self) -> WheelPair:
        """Cumulative x4 ticks, forward (A before B) positive."""
        return WheelPair(*(decoder.ticks for decoder in self.decoders))

    def illegal_transitions(self) -> WheelPair:
        """How many impossible changes the decoders have seen, each a lost edge."""
        return WheelPair(*(decoder.illegal for decoder in self.decoders))

    def contact_is_open(self) -> bool:
        """Whether the e-stop contact says stop, in two samples; true if none is fitted."""
        board = self.board
        # High means open, by the pull-up; of a contact that closes to stop, low.
        pressed = board.estop_contact is ContactKind.NORMALLY_CLOSED
        # One would latch: a spike on the contact's wire is over before the second.
        return board.estop is None or all(self.contact_level() == pressed for _ in range(2))

    @abstractmethod
    def contact_level(self) -> bool:
        """The level of the e-stop contact's pin, which is fitted."""

    def input_levels(self) -> int:
        """The levels of `digital_inputs`: bit n is channel n."""
        return 0

    def is_released(self, outputs: Outputs) -> bool:
        """Whether neither motor is driven or braked by an input that is high."""
        return not any(
            getattr(stage, f"{name}_q15")
            for stage in (outputs.left, outputs.right)
            for name in release_inputs(self.board)
        )

    def keep_alive(self, now_us: int) -> None:  # noqa: B027 - only pigpio has a watchdog
        """Called in each control step: refresh the backend's watchdog, if it has one."""

    @abstractmethod
    def close(self) -> None:
        """Let both wheels coast and release the pins. Raises nothing."""
