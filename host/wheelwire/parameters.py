"""The parameters of a driver by name: values, bounds, and a check before anything is sent."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import TracebackType

from wheelwire_protocol.parameters import PARAMETER_BY_NAME, Kind, Parameter
from wheelwire_protocol.units import Unit

from .arguments import is_number
from .errors import InvalidArgument, ParameterOutOfRange, UnknownParameter, shown

TRIAL_TIMEOUT_S = 2.0


@dataclass(frozen=True)
class ParameterInfo:
    """One parameter as the device has it. Bounds are inclusive."""

    name: str
    value: float
    default: float
    minimum: float
    maximum: float
    unit: str
    kind: Kind
    doc: str


class ParameterMapping(Mapping[str, float]):
    """The values of a robot's parameters by name, each in its parameter's unit.

    The names are the same for every robot of this release, so `in`, `len` and iteration over the
    names ask nobody.

    Raises:
        UnknownParameter: No parameter has this name. It is also a KeyError.
        LinkLost: A value is asked for while the robot is out of reach.
    """

    def __getitem__(self, name: str) -> float:
        return self._value(definition_of(name))

    def __contains__(self, name: object) -> bool:
        # The inherited one would ask for the value, and that may mean to ask the device.
        return isinstance(name, str) and name in PARAMETER_BY_NAME

    def __iter__(self) -> Iterator[str]:
        return iter(PARAMETER_BY_NAME)

    def __len__(self) -> int:
        return len(PARAMETER_BY_NAME)

    @abstractmethod
    def _value(self, definition: Parameter) -> float:
        """The value in force."""


class Parameters(ParameterMapping):
    """The parameters of one robot: a mapping of the values known since the session was opened.

    A value that is not known yet is asked for when it is first used, and kept. A new session, after
    a reconnection or a reset of the device, voids what is known. `set`, `refresh`, `list`, `save`
    and `reset` talk to the device each time.

    Raises, in every method that talks to the device: `LinkLost`, `RequestTimeout`, `DeviceRefused`;
    in every one that takes a name: `UnknownParameter`.
    """

    @abstractmethod
    def set(self, name: str, value: float) -> float:
        """Change a value until the next reset of the device; returns the value in force.

        Raises:
            ParameterOutOfRange: Beyond the bounds, not finite, or not whole where it must be.
        """

    @abstractmethod
    def refresh(self, name: str | None = None) -> None:
        """Ask the device anew for one value, or for all."""

    @abstractmethod
    def list(self) -> tuple[ParameterInfo, ...]:
        """All parameters, with the bounds that the device holds them to."""

    @abstractmethod
    def save(self, name: str | None = None) -> None:
        """Keep values across resets. Only while stopped.

        Args:
            name: The only one to save; all others stay as they were saved. None saves all, also
                those that were only tried.
        """

    @abstractmethod
    def reset(self) -> None:
        """Go back to the defaults, and forget what was saved. Only while stopped."""

    @abstractmethod
    def trial(self, timeout: float = TRIAL_TIMEOUT_S) -> Trial:
        """Try values: `with robot.parameters.trial() as trial: ...; trial.keep()`.

        What is set in the block is in force at once, and reverted at its end unless `keep` was
        called. The link renews the trial while the block runs. If the device hears no renewal for
        `timeout`, because the program was killed, the cable pulled, or the computer hangs, or if
        another session begins, it stops the wheels and has the former values again by itself. A
        reset of the device leaves its saved values in force, as always.

        `save` and `reset` are refused in the block, and so is a change of `estop_input_enabled`.
        After the trial was lost, setpoints and changes are refused with `RefusalCode.NO_TRIAL`
        until the block is left: the program would go on with values that are not in force.

        Args:
            timeout: For how long the link may be silent, 0.2 to 60. [s]

        Raises:
            InvalidArgument: The time-out is beyond these bounds.
            DeviceRefused: At the beginning of the block: another trial runs.
        """


class Trial(ABC):
    """A trial of parameters, made by `Parameters.trial`; a context manager, to be used once.

    Raises, also at the end of the block if nothing else was raised in it: `LinkLost`,
    `RequestTimeout`, `DeviceRefused`. The device then reverts by itself.
    """

    @abstractmethod
    def keep(self) -> None:
        """Leave the values in force until the next reset of the device; ends the trial.

        Raises:
            DeviceRefused: The trial was lost; the former values are in force.
            RequestTimeout: Whether they were kept is not known.
        """

    @abstractmethod
    def __enter__(self) -> Trial:
        """Begin the trial."""

    @abstractmethod
    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop the wheels and revert, unless the values were kept."""


def decimal_of_float32(value: float) -> float:
    """The decimal number that was meant by a 32-bit float: 0.033, not 0.03299999982118607."""
    # Seven digits: a 32-bit float holds 7 or 8, and what was written seldom has more.
    return float(f"{value:.7g}")


def definition_of(name: str) -> Parameter:
    """The parameter of this name; raises `UnknownParameter`."""
    # Anything else might not even be hashable.
    definition = PARAMETER_BY_NAME.get(name) if isinstance(name, str) else None
    if definition is None:
        raise UnknownParameter(name, PARAMETER_BY_NAME)
    return definition


def checked_value(name: str, value: float) -> float:
    """`value` as a number that the parameter takes by its definition.

    Raises:
        UnknownParameter: No parameter has this name.
        ParameterOutOfRange: Beyond the bounds, not finite, or not whole where it must be.
    """
    definition = definition_of(name)
    return check_value(definition, value, (definition.minimum, definition.maximum))


def checked_values(values: Mapping[str, float] | None) -> dict[str, float]:
    """Each of them as `checked_value` has it; none for None.

    Raises:
        InvalidArgument: They are no mapping.
        UnknownParameter: As `checked_value`.
        ParameterOutOfRange: As `checked_value`.
    """
    if values is not None and not isinstance(values, Mapping):
        raise InvalidArgument(f"parameters = {shown(values)}: give values by name")
    return {name: checked_value(name, value) for name, value in (values or {}).items()}


def _millimetres(definition: Parameter, value: float) -> str:
    """A hint where somebody gave millimetres for metres."""
    metres = value / 1000
    if definition.unit is not Unit.METRE or not definition.minimum <= metres <= definition.maximum:
        return ""
    return f" ({metres:g} is {value:g} mm)"


def check_value(definition: Parameter, value: float, bounds: tuple[float, float]) -> float:
    """`value` as a number that the parameter takes within `bounds`.

    Raises:
        ParameterOutOfRange: Beyond the bounds, not finite, or not whole where it must be.
    """
    name, (low, high) = definition.name, bounds
    # is_number refuses a bool, but True and False are what programs write for a switch.
    if definition.kind is Kind.SWITCH and isinstance(value, bool):
        value = float(value)
    if definition.kind is Kind.SWITCH and not (is_number(value) and value in (0, 1)):
        raise ParameterOutOfRange(name, value, "0 (off) or 1 (on)")
    if not is_number(value):
        raise ParameterOutOfRange(name, value, "a finite number")
    unit = f" {definition.unit.value}".rstrip()
    if value < low:
        raise ParameterOutOfRange(name, value, f"at least {low:g}{unit}")
    if value > high:
        raise ParameterOutOfRange(
            name, value, f"at most {high:g}{unit}{_millimetres(definition, value)}"
        )
    if definition.kind is not Kind.REAL and value != int(value):
        raise ParameterOutOfRange(name, value, "a whole number")
    return float(value)
