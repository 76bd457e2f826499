"""The parameters of a driver by name: values, bounds, and a check before anything is sent."""

from __future__ import annotations

import builtins
import struct
import time
from abc import ABC, abstractmethod
from collections.abc import (
    AsyncIterator,
    Awaitable,
    Callable,
    Collection,
    Iterable,
    Iterator,
    Mapping,
)
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, cast

from wheelwire_protocol.codes import Unit
from wheelwire_protocol.parameters import (
    PARAMETER_BY_NAME,
    Changes,
    Kind,
    Parameter,
    decimal_of_float32,
)

from .arguments import is_number
from .errors import (
    ImportFailed,
    InvalidArgument,
    LinkLost,
    ParameterOutOfRange,
    RequestTimeout,
    UnknownParameter,
    WheelwireError,
    shown,
)

TRIAL_TIMEOUT_S = 2.0
RESTORE_TIMEOUT_S = 5.0
"""For how long previous values are set again, should the link be lost; it may come back."""
_RETRY_PERIOD_S = 0.1


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


@dataclass(frozen=True)
class Difference:
    """A parameter whose value on the robot is not the one that is wanted."""

    name: str
    robot: float
    wanted: float
    unit: str


class ParameterMapping(Mapping[str, float]):
    """The values of a robot's parameters by name, each in its parameter's unit.

    The names are the same for every robot of this release, so `in`, `len` and iteration over the
    names do not ask the robot.

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
        """The active value."""


class Parameters(ParameterMapping):
    """The parameters of one robot: a mapping of the values known since the session was opened.

    A value that is not known yet is asked for when it is first used, and stored. A new session,
    after a reconnection or a reset of the device, voids what is known. `set`, `refresh`, `list`,
    `save` and `reset` talk to the device each time.

    Raises, in every method that talks to the device: `LinkLost`, `RequestTimeout`, `DeviceRefused`;
    in every one that takes a name: `UnknownParameter`.
    """

    @abstractmethod
    def set(self, name: str, value: float) -> float:
        """Change a value until the next reset of the device; returns the active value.

        Raises:
            ParameterOutOfRange: Beyond the bounds, not finite, or not whole where it must be.
        """

    def set_all(self, values: Mapping[str, float], *, save: bool = False) -> tuple[Difference, ...]:
        """Set all of `values`, or none: after a failure the previous values are set again.

        Values that the robot already has are not set. Other parameters stay as they are. A robot
        that drives drives on, whether the values are accepted or refused. Only one that begins to
        drive after the first of several values was set is stopped if a later one is refused.

        Args:
            values: By name.
            save: Also save them all, those included that the robot already had, and no others.

        Returns:
            The differences that it found.

        Raises:
            UnknownParameter: Nothing was changed.
            ParameterOutOfRange: Beyond the bounds of this robot. Nothing was changed.
            ImportFailed: A value was refused, or the link failed. The message says whether the
                previous values are active again.
        """
        try:
            set_all_or_none(_OnThread(self), values, _sleep, save=save).send(None)
        except StopIteration as end:
            return cast("tuple[Difference, ...]", end.value)
        raise RuntimeError("an operation on a thread was suspended")

    @abstractmethod
    def refresh(self, name: str | None = None) -> None:
        """Ask the device again for one value, or for all."""

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

        What is set in the block is active at once, and reverted at its end unless `keep` was
        called. The link renews the trial while the block runs. If the device hears no renewal for
        `timeout`, because the program was killed, the cable pulled, or the computer hangs, or if
        another session begins, it stops the wheels and restores the previous values by itself. A
        reset of the device leaves its saved values active, as always.

        `save` and `reset` are refused in the block, and so is a change of `estop_input_enabled`.
        After the trial was lost, setpoints and changes are refused with `RefusalCode.NO_TRIAL`
        until the block is left: the program would go on with values that are not active.

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
        """Leave the values active until the next reset of the device; ends the trial.

        Raises:
            DeviceRefused: The trial was lost; the previous values are active.
            RequestTimeout: It is unknown whether the device kept the values.
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
        """Stop the wheels and revert, unless `keep` was called."""


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
        InvalidArgument: They are not a mapping.
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


def differences(
    robot: Iterable[ParameterInfo], wanted: Mapping[str, float]
) -> tuple[Difference, ...]:
    """The values of `wanted` that the robot does not have, in the robot's order.

    Raises:
        UnknownParameter: The robot does not have a parameter of `wanted`.
    """
    infos = {p.name: p for p in robot}
    for name in wanted:
        if name not in infos:  # its firmware would be of another release, which a hello refuses
            definition_of(name)
            raise WheelwireError(f"the robot has no parameter {name}: install one release on both")
    # Rounded as the device rounds it: a value with more digits would always differ.
    return tuple(
        Difference(name, info.value, value, info.unit)
        for name, info in infos.items()
        if name in wanted and (value := _as_held(wanted[name])) != info.value
    )


def number_text(value: float) -> str:
    """A value with all its digits, whole ones without a point."""
    return str(int(value) if value == int(value) else value)


def _as_held(value: float) -> float:
    """The value as a device holds it, a 32-bit float, and reports it."""
    try:
        held = struct.pack("<f", value)
    except OverflowError:
        return value  # outside the range of a device, so it differs from the device's value
    return decimal_of_float32(struct.unpack("<f", held)[0])


class SettableTrial(Protocol):
    """A trial of parameters, for `set_all_or_none`."""

    async def keep(self) -> None:
        """As `Trial.keep`."""


class Settable(Protocol):
    """The methods of `Parameters` that `set_all_or_none` needs."""

    async def list(self) -> tuple[ParameterInfo, ...]:
        """All parameters."""

    async def set(self, name: str, value: float) -> float:
        """Change a value."""

    async def save(self, name: str | None = None) -> None:
        """Keep values across resets."""

    def trial(self) -> AbstractAsyncContextManager[SettableTrial]:
        """Try values."""


Pause = Callable[[float], Awaitable[None]]
"""Waits for some seconds."""


async def set_all_or_none(
    parameters: Settable, wanted: Mapping[str, float], pause: Pause, *, save: bool
) -> tuple[Difference, ...]:
    """As `Parameters.set_all`, for threads and for asyncio."""
    before = await parameters.list()
    # Each difference also has the robot's own value, for `_restore`.
    changes = differences(before, wanted)
    bounds = {p.name: (p.minimum, p.maximum) for p in before}
    # All are checked before the first is set: a wrong value then changes nothing.
    for name, value in wanted.items():
        check_value(definition_of(name), value, bounds[name])
    together, last = _in_order(changes)
    touched: list[Difference] = []
    saved: list[str] = []
    doing = ""
    try:
        if len(together) > 1:
            # The trial judges them together at its end, so their order does not matter. If this
            # program dies first, the device restores its previous values by itself.
            async with parameters.trial() as trial:
                try:
                    for change in together:
                        doing = _not_set(change)
                        touched.append(change)  # first: it may be set although this fails
                        await parameters.set(change.name, change.wanted)
                    doing = "the values were not set"
                    await trial.keep()
                except BaseException:
                    # To revert the trial would stop a robot that drives.
                    if not await _restore(parameters, touched, 0.0, pause):
                        touched.clear()
                        with suppress(WheelwireError):
                            await trial.keep()
                    raise
        else:
            last = [*together, *last]
        for change in last:
            doing = _not_set(change)
            touched.append(change)
            await parameters.set(change.name, change.wanted)
        doing = "the values were not verified"
        await _verify(parameters, wanted)
        if save:
            doing = "the values were not saved"
            await _save(parameters, wanted, saved)
    except WheelwireError as error:
        failed = await _restore(parameters, touched, RESTORE_TIMEOUT_S, pause)
        reason = str(error) if str(error).endswith((".", "?", "!")) else f"{error}."
        raise ImportFailed(f"{doing}: {reason} {_outcome(failed, saved)}") from error
    except BaseException:
        # Ctrl-C, for one: half of the values must not stay active.
        await _restore(parameters, touched, RESTORE_TIMEOUT_S, pause)
        raise
    return changes


def _in_order(
    changes: Collection[Difference],
) -> tuple[builtins.list[Difference], builtins.list[Difference]]:
    """The parameters that a trial accepts, then the others.

    The switch of the e-stop contact comes last: an open contact latches an e-stop, in which the
    switch itself can no longer be changed back. It also cannot be on trial. What is refused while
    the robot moves comes first: then nothing was changed before.
    """
    sorts: dict[Changes, list[Difference]] = {sort: [] for sort in Changes}
    for change in changes:
        sorts[PARAMETER_BY_NAME[change.name].changes].append(change)
    return sorts[Changes.STOPPED] + sorts[Changes.ALWAYS], sorts[Changes.RELEASED]


async def _verify(parameters: Settable, wanted: Mapping[str, float]) -> None:
    """Raise an error if the robot was reset, because it then has some of its saved values again."""
    if lost := differences(await parameters.list(), wanted):
        again = f"{lost[0].name} = {number_text(lost[0].robot)}"
        raise WheelwireError(f"the robot has {again} again; was it reset? Try once more.")


async def _save(parameters: Settable, names: Collection[str], saved: list[str]) -> None:
    """Save these one by one; append each saved one to `saved`."""
    if set(names) == PARAMETER_BY_NAME.keys():
        await parameters.save()  # at once: all or nothing
        return
    for name in names:
        await parameters.save(name)
        # After each one: if the next fails, the message has to say what is in the store.
        saved.append(name)


async def _restore(
    parameters: Settable, touched: Collection[Difference], timeout_s: float, pause: Pause
) -> list[str]:
    """Set the previous values again, the newest first; returns those that failed."""
    # One limit for all values: without a link each one would take the whole of its own.
    end = time.monotonic() + timeout_s
    left = list(reversed(list(touched)))
    while left:
        failed = [change for change in left if not await _set_again(parameters, change, end, pause)]
        # Some are accepted only after others: together with these they would contradict each other.
        if len(failed) == len(left):
            break
        left = failed
    return [change.name for change in left]


async def _set_again(parameters: Settable, change: Difference, end: float, pause: Pause) -> bool:
    """Whether a previous value is active again; tries until `end` while the link is lost."""
    while True:
        try:
            await parameters.set(change.name, change.robot)
        except (LinkLost, RequestTimeout):
            # The link may come back, or the next attempt be answered. A refusal is final.
            if time.monotonic() >= end:
                return False
        except WheelwireError:
            return False
        else:
            return True
        await pause(_RETRY_PERIOD_S)


class _OnThread:
    """The parameters of a thread as `Settable`: what is awaited blocks, and never suspends."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters

    async def list(self) -> tuple[ParameterInfo, ...]:
        return self._parameters.list()

    async def set(self, name: str, value: float) -> float:
        return self._parameters.set(name, value)

    async def save(self, name: str | None = None) -> None:
        self._parameters.save(name)

    @asynccontextmanager
    async def trial(self) -> AsyncIterator[SettableTrial]:
        with self._parameters.trial() as trial:
            yield _TrialOnThread(trial)


async def _sleep(seconds: float) -> None:
    time.sleep(seconds)


class _TrialOnThread:
    def __init__(self, trial: Trial) -> None:
        self._trial = trial

    async def keep(self) -> None:
        self._trial.keep()


def _not_set(change: Difference) -> str:
    wish = f"{number_text(change.wanted)} {change.unit}".rstrip()
    return f"{change.name} = {wish} was not set"


def _outcome(failed: Collection[str], saved: Collection[str]) -> str:
    text = "The previous values are active again."
    if failed:
        text = (
            f"The previous values could not be restored: {', '.join(failed)}. "
            "Reset the robot: it then has its saved values."
        )
    if saved:
        text += f" Saved before that: {', '.join(saved)}."
    return text
