"""The parameters that live on a device: which requests each operation takes.

Sans-IO: an operation is a generator that yields requests and is sent their answers, so that a
thread that waits and a coroutine run the same one.
"""

from __future__ import annotations

import builtins
from collections.abc import Callable, Generator
from typing import Protocol, TypeAlias, TypeVar, cast

from wheelwire_protocol.parameters import PARAMETER_BY_ID, PARAMETERS, Parameter
from wheelwire_protocol.types import (
    ParameterEntry,
    ParameterGet,
    ParameterList,
    ParameterReset,
    ParameterSave,
    ParameterSet,
    ParameterValue,
)

from ..link.requests import Answer, RequestMessage
from ..parameters import (
    ParameterInfo,
    Parameters,
    check_value,
    decimal_of_float32,
    definition_of,
)

Result = TypeVar("Result")
Steps: TypeAlias = Generator[RequestMessage, Answer, Result]


class KnownValues(Protocol):
    """What a link knows."""

    def known(self, parameter: int) -> float | None:
        """The newest value reported in this session, if any; `LinkLost` without a session."""


class RequestingLink(KnownValues, Protocol):
    """A link that waits for the answer to a request."""

    def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer."""


class ParameterOperations:
    """What is known of a device's parameters, and the requests that find out or change it."""

    def __init__(self, link: KnownValues) -> None:
        self._link = link
        self._bounds: dict[int, tuple[float, float]] = {}
        self._unsure: builtins.set[int] = set()
        """Perhaps changed by a request that was never answered: what is known may be wrong."""

    def newest(self, parameter: int) -> float | None:
        """The newest value reported in this session, if there is one."""
        value = self._link.known(parameter)
        return None if value is None else decimal_of_float32(value)

    def known(self, parameter: int) -> float | None:
        """The value in force, as far as it is known for certain."""
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
        if definition.id not in self._bounds:
            yield from self.list()
        number = check_value(definition, value, self._bounds[definition.id])
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
        for entry, info in zip(entries, infos, strict=True):
            self._bounds[entry.parameter] = info.minimum, info.maximum
        return infos

    def save(self, name: str | None) -> Steps[None]:
        """Keep values across resets; see `Parameters`."""
        yield ParameterSave(0, 0, 0 if name is None else definition_of(name).id)

    def reset(self) -> Steps[None]:
        """Restore the defaults, empty the device's store, and ask for all values."""
        self._unsure.update(definition.id for definition in PARAMETERS)
        yield ParameterReset(0, 0)
        yield from self.refresh(None)


class DeviceParameters(Parameters):
    """The parameters that live on a device."""

    def __init__(self, link: RequestingLink) -> None:
        self._operations = ParameterOperations(link)
        self._request = link.request

    def set(self, name: str, value: float) -> float:
        """Change a value until the next reset of the device; returns the value in force."""
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

    def _value(self, definition: Parameter) -> float:
        known = self._operations.known(definition.id)
        return self._run(self._operations.get(definition.id)) if known is None else known

    def _run(self, steps: Steps[Result]) -> Result:
        return run(steps, self._request)


def run(steps: Steps[Result], request: Callable[[RequestMessage], Answer]) -> Result:
    """Do an operation by requests that are waited for, one after the other."""
    try:
        message = next(steps)
        while True:
            message = steps.send(request(message))
    except StopIteration as end:
        return cast("Result", end.value)


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
