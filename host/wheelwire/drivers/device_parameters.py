"""The parameters that live on a device: which requests each operation takes.

Sans-IO: an operation is a generator that yields requests and is sent their answers, so that a
thread that waits and a coroutine run the same one.
"""

from __future__ import annotations

import builtins
from collections.abc import Callable, Generator
from contextlib import suppress
from types import TracebackType
from typing import Protocol, TypeAlias, TypeVar, cast

from wheelwire_protocol.codes import Contradiction, RefusalCode, TrialAction
from wheelwire_protocol.parameters import PARAMETER_BY_ID, PARAMETERS, Parameter
from wheelwire_protocol.types import (
    Contradictions,
    ContradictionsGet,
    ParameterEntry,
    ParameterGet,
    ParameterList,
    ParameterReset,
    ParameterSave,
    ParameterSet,
    ParameterTrial,
    ParameterValue,
)

from ..arguments import number
from ..errors import DeviceRefused, InvalidArgument, WheelwireError
from ..link.requests import Answer, RequestMessage, subject
from ..link.trial import LONGEST_TRIAL_S, SHORTEST_TRIAL_S
from ..parameters import (
    TRIAL_TIMEOUT_S,
    ParameterInfo,
    Parameters,
    Trial,
    check_value,
    decimal_of_float32,
    definition_of,
)

Result = TypeVar("Result")
Steps: TypeAlias = Generator[RequestMessage, Answer, Result]

# The session fills in its own id and the request's.
REVERT = ParameterTrial(0, 0, TrialAction.REVERT, 0.0)


class KnownValues(Protocol):
    """What a link knows."""

    def known(self, parameter: int) -> float | None:
        """The newest value reported in this session, if any; `LinkLost` without a session."""


class RequestingLink(KnownValues, Protocol):
    """A link that waits for the answer to a request."""

    def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer."""

    def post(
        self, message: RequestMessage, done: Callable[[Answer | WheelwireError], None]
    ) -> None:
        """Send a request without waiting for the answer."""

    def release_trial(self) -> None:
        """The application has left its trial of parameters."""


class ParameterOperations:
    """What is known of a device's parameters, and the requests that find out or change it."""

    def __init__(self, link: KnownValues) -> None:
        self._link = link
        self._bounds: dict[int, tuple[float, float]] = {}
        self._unsure: builtins.set[int] = set()
        """Perhaps changed by a request that was never answered: what is known may be wrong."""
        self._tried: builtins.set[int] = set()
        """Set since the last trial began."""

    def newest(self, parameter: int) -> float | None:
        """The newest value reported in this session, if there is one."""
        value = self._link.known(parameter)
        return None if value is None else decimal_of_float32(value)

    def known(self, parameter: int) -> float | None:
        """The active value, as far as it is known for certain."""
        value = self.newest(parameter)
        return None if parameter in self._unsure else value

    def get(self, parameter: int) -> Steps[float]:
        """Ask for one value."""
        answer = cast("ParameterValue", (yield ParameterGet(0, 0, parameter)))
        self._unsure.discard(parameter)
        return decimal_of_float32(answer.value)

    def set(self, name: str, value: float) -> Steps[float]:
        """Change one value; see `Parameters`."""
        definition = definition_of(name)
        # The bounds are the device's; one listing has them for all later changes, too.
        if definition.id not in self._bounds:
            yield from self.list()
        number = check_value(definition, value, self._bounds[definition.id])
        # Both before the request: it may be carried out although its answer is lost.
        self._tried.add(definition.id)
        self._unsure.add(definition.id)  # until it is answered
        answer = cast("ParameterValue", (yield ParameterSet(0, 0, definition.id, number)))
        self._unsure.discard(definition.id)
        return decimal_of_float32(answer.value)

    def refresh(self, name: str | None) -> Steps[None]:
        """Ask for one value, or for all; see `Parameters`."""
        for definition in PARAMETERS if name is None else (definition_of(name),):
            yield from self.get(definition.id)

    def list(self) -> Steps[tuple[ParameterInfo, ...]]:
        """All parameters of the device, in its order."""
        entries: list[ParameterEntry] = []
        while not entries or len(entries) < entries[0].parameter_count:
            entry = cast("ParameterEntry", (yield ParameterList(0, 0, len(entries))))
            self._unsure.discard(entry.parameter)
            entries.append(entry)
        infos = tuple(_info(entry) for entry in entries)
        # Only with the whole list: after one that broke off the next `set` lists anew.
        for entry, info in zip(entries, infos, strict=True):
            self._bounds[entry.parameter] = info.minimum, info.maximum
        return infos

    def save(self, name: str | None) -> Steps[None]:
        """Keep values across resets; see `Parameters`."""
        yield ParameterSave(0, 0, 0 if name is None else definition_of(name).id)

    def reset(self) -> Steps[None]:
        """Restore the defaults, empty the device's store, and ask for all values."""
        # Until they are asked for below: the reset may be done although its answer is lost.
        self._unsure.update(definition.id for definition in PARAMETERS)
        yield ParameterReset(0, 0)
        yield from self.refresh(None)

    def begin_trial(self, timeout_s: float) -> Steps[None]:
        """What is set from now on is on trial."""
        yield ParameterTrial(0, 0, TrialAction.BEGIN, timeout_s)
        # Only once it has begun: where it is refused, another one goes on with what it tried.
        self._tried.clear()

    def keep_trial(self) -> Steps[None]:
        """End the trial; the values stay."""
        yield ParameterTrial(0, 0, TrialAction.KEEP, 0.0)

    def revert_trial(self) -> Steps[None]:
        """End the trial, and ask for the active values again."""
        # Until they are asked for below it is not known which values are active.
        self._unsure |= self._tried
        yield REVERT
        for parameter in sorted(self._tried):
            yield from self.get(parameter)


class DeviceParameters(Parameters):
    """The parameters that live on a device."""

    def __init__(self, link: RequestingLink) -> None:
        self._operations = ParameterOperations(link)
        self._link = link

    def set(self, name: str, value: float) -> float:
        """Change a value until the next reset of the device; returns the active value."""
        return self._run(self._operations.set(name, value))

    def refresh(self, name: str | None = None) -> None:
        """Ask the device anew for one value, or for all."""
        self._run(self._operations.refresh(name))

    def list(self) -> tuple[ParameterInfo, ...]:
        """All parameters of the device, in its order."""
        return self._run(self._operations.list())

    def save(self, name: str | None = None) -> None:
        """Keep values across resets."""
        self._run(self._operations.save(name))

    def reset(self) -> None:
        """Restore the defaults and empty the device's store."""
        self._run(self._operations.reset())

    def trial(self, timeout: float = TRIAL_TIMEOUT_S) -> Trial:
        """Try values; see `Parameters`."""
        return _DeviceTrial(self._operations, self._link, checked_timeout(timeout))

    def _value(self, definition: Parameter) -> float:
        known = self._operations.known(definition.id)
        return self._run(self._operations.get(definition.id)) if known is None else known

    def _run(self, steps: Steps[Result]) -> Result:
        return run(steps, self._link.request)


class _DeviceTrial(Trial):
    def __init__(
        self, operations: ParameterOperations, link: RequestingLink, timeout_s: float
    ) -> None:
        self._operations = operations
        self._link = link
        self._timeout_s = timeout_s
        self._kept = False

    def keep(self) -> None:
        run(self._operations.keep_trial(), self._link.request)
        # Only once it is acknowledged: until then the end of the block has to revert.
        self._kept = True

    def __enter__(self) -> Trial:
        try:
            run(self._operations.begin_trial(self._timeout_s), self._link.request)
        except DeviceRefused:
            raise  # none was begun; the other one goes on
        except BaseException:  # it may have been begun, and nobody will be there to end it
            # Not waited for. If it does not arrive, the device reverts by itself at its time-out.
            with suppress(WheelwireError):
                self._link.post(REVERT, lambda _: None)
            self._link.release_trial()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._kept:
            return
        try:
            run(self._operations.revert_trial(), self._link.request)
        except WheelwireError:
            if error is None:  # else that one says more
                raise
        finally:
            self._link.release_trial()


def checked_timeout(timeout: float) -> float:
    """The time-out of a trial, if a device takes it."""
    return number("timeout", timeout, SHORTEST_TRIAL_S, LONGEST_TRIAL_S, InvalidArgument)


def run(steps: Steps[Result], request: Callable[[RequestMessage], Answer]) -> Result:
    """Do an operation by requests that are waited for, one after the other."""
    try:
        # A request's error ends the operation where it is: its generator has nothing to clean up.
        message = next(steps)
        while True:
            message = steps.send(_answer(message, request))
    except StopIteration as end:
        # The operation is over, and this is what its generator returned.
        return cast("Result", end.value)


def _answer(message: RequestMessage, request: Callable[[RequestMessage], Answer]) -> Answer:
    try:
        return request(message)
    except DeviceRefused as error:
        if error.code != RefusalCode.CONTRADICTION:
            raise
        found = cast("Contradictions", request(ContradictionsGet(0, 0)))
        raise contradiction_error(message, found) from None


def contradiction_error(message: RequestMessage, found: Contradictions) -> DeviceRefused:
    """The refusal of a value, or of a trial's values, that names what contradicts what."""
    flags = Contradiction(found.refused)
    sentences = [flag.doc for flag in Contradiction if flag in flags]
    return DeviceRefused(RefusalCode.CONTRADICTION, subject(message), hint=" ".join(sentences))


def _info(entry: ParameterEntry) -> ParameterInfo:
    definition = PARAMETER_BY_ID[entry.parameter]
    return ParameterInfo(
        name=definition.name,
        value=decimal_of_float32(entry.value),
        default=decimal_of_float32(entry.default_value),
        minimum=decimal_of_float32(entry.minimum),
        maximum=decimal_of_float32(entry.maximum),
        unit=definition.unit.value,
        kind=definition.kind,
        doc=definition.doc,
    )
