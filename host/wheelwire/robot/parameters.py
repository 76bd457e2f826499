"""The parameters of a device. Each operation is written once, for asyncio and for threads."""

from __future__ import annotations

import builtins
from collections.abc import Mapping
from contextlib import AbstractAsyncContextManager, suppress
from typing import cast

from wheelwire_protocol import types as wire
from wheelwire_protocol.codes import TrialAction
from wheelwire_protocol.parameters import PARAMETER_BY_ID, PARAMETERS, Parameter, decimal_of_float32

from ..arguments import number
from ..errors import DeviceRefused, InvalidArgument, WheelwireError
from ..link.requests import LONGEST_TRIAL_S, SHORTEST_TRIAL_S
from ..parameters import (
    TRIAL_TIMEOUT_S,
    Difference,
    ParameterInfo,
    ParameterMapping,
    Parameters,
    Trial,
    check_value,
    definition_of,
    set_all_or_none,
)
from .calls import Requests, blocking, run

# The session fills in its own id and the request's.
_REVERT = wire.ParameterTrial(0, 0, TrialAction.REVERT, 0.0)


class AwaitableParameters(ParameterMapping):
    """The parameters of one robot: a mapping of the newest values that it reported.

    The link reads all of them whenever a session opens, so using the mapping never waits. After a
    change that was cancelled or not answered (`RequestTimeout`), `refresh` finds out whether the
    device made it.

    Raises, in every coroutine: `LinkLost`, `RequestTimeout`, `DeviceRefused`; in every one that
    takes a name: `UnknownParameter`.
    """

    def __init__(self, requests: Requests) -> None:
        self._requests = requests
        self._bounds: dict[int, tuple[float, float]] = {}
        self._unsure: builtins.set[int] = set()
        """Ids whose known value may be wrong, as a request to change it was never answered."""
        self._tried: builtins.set[int] = set()
        """Ids of the values that were set since the last trial began."""

    async def set(self, name: str, value: float) -> float:
        """Change a value until the next reset of the device; returns the active value.

        Raises:
            ParameterOutOfRange: Beyond the bounds, not finite, or not whole where it must be.
        """
        definition = definition_of(name)
        # The bounds are the device's; one listing has them for all later changes, too.
        if definition.id not in self._bounds:
            await self.list()
        number = check_value(definition, value, self._bounds[definition.id])
        # Both before the request: it may be carried out although its answer is lost.
        self._tried.add(definition.id)
        self._unsure.add(definition.id)  # until it is answered
        return await self._value_by(wire.ParameterSet(0, 0, definition.id, number))

    async def set_all(
        self, values: Mapping[str, float], *, save: bool = False
    ) -> tuple[Difference, ...]:
        """Set all of `values`, or none; as `wheelwire.Parameters.set_all`."""
        return await set_all_or_none(self, values, self._requests.pause, save=save)

    async def refresh(self, name: str | None = None) -> None:
        """Ask the device again for one value, or for all."""
        for definition in PARAMETERS if name is None else (definition_of(name),):
            await self._get(definition.id)

    async def list(self) -> tuple[ParameterInfo, ...]:
        """All parameters, with the bounds that the device holds them to."""
        entries: list[wire.ParameterEntry] = []
        while not entries or len(entries) < entries[0].parameter_count:
            message = wire.ParameterList(0, 0, len(entries))
            entry = cast("wire.ParameterEntry", await self._requests.ask(message))
            self._unsure.discard(entry.parameter)
            entries.append(entry)
        infos = tuple(_info(entry) for entry in entries)
        # Only with the whole list: if listing broke off, the next `set` lists them again.
        for entry, info in zip(entries, infos, strict=True):
            self._bounds[entry.parameter] = info.minimum, info.maximum
        return infos

    async def save(self, name: str | None = None) -> None:
        """Save one value, or all, across resets. Only while the robot is stopped."""
        await self._requests.ask(
            wire.ParameterSave(0, 0, 0 if name is None else definition_of(name).id)
        )

    async def reset(self) -> None:
        """Go back to the defaults, and delete what was saved. Only while the robot is stopped."""
        # Until they are asked for below: the reset may be done although its answer is lost.
        self._unsure.update(definition.id for definition in PARAMETERS)
        await self._requests.ask(wire.ParameterReset(0, 0))
        await self.refresh()

    def trial(self, timeout: float = TRIAL_TIMEOUT_S) -> AwaitableTrial:
        """Try values: `async with robot.parameters.trial() as trial: ...; await trial.keep()`.

        As `wheelwire.Parameters.trial`.
        """
        timeout_s = number("timeout", timeout, SHORTEST_TRIAL_S, LONGEST_TRIAL_S, InvalidArgument)
        return AwaitableTrial(self, self._requests, timeout_s)

    async def _active(self, parameter: int) -> float:
        """The active value; asks the device unless the value is known for certain."""
        value = self._newest(parameter)
        return await self._get(parameter) if value is None or parameter in self._unsure else value

    async def _revert_trial(self) -> None:
        """End the trial, and ask for the active values again."""
        # Until they are asked for below it is not known which values are active.
        self._unsure |= self._tried
        await self._requests.ask(_REVERT)
        for parameter in sorted(self._tried):
            await self._get(parameter)

    def _value(self, definition: Parameter) -> float:
        value = self._newest(definition.id)
        if value is None:
            answer = self._requests.answer_to(wire.ParameterGet(0, 0, definition.id))
            value = decimal_of_float32(cast("wire.ParameterValue", answer).value)
        return value

    def _newest(self, parameter: int) -> float | None:
        """The newest value reported in this session, if there is one."""
        value = self._requests.link.known(parameter)
        return None if value is None else decimal_of_float32(value)

    async def _get(self, parameter: int) -> float:
        return await self._value_by(wire.ParameterGet(0, 0, parameter))

    async def _value_by(self, message: wire.ParameterGet | wire.ParameterSet) -> float:
        answer = cast("wire.ParameterValue", await self._requests.ask(message))
        self._unsure.discard(message.parameter)
        return decimal_of_float32(answer.value)


class AwaitableTrial(AbstractAsyncContextManager["AwaitableTrial"]):
    """A trial of parameters, made by `Parameters.trial`; as `wheelwire.parameters.Trial`."""

    def __init__(
        self, parameters: AwaitableParameters, requests: Requests, timeout_s: float
    ) -> None:
        self._parameters = parameters
        self._requests = requests
        self._timeout_s = timeout_s
        self._kept = False

    async def keep(self) -> None:
        """Leave the values active until the next reset of the device; ends the trial.

        Raises:
            DeviceRefused: The trial was lost; the previous values are active.
            RequestTimeout: It is unknown whether the device kept the values.
        """
        await self._requests.ask(wire.ParameterTrial(0, 0, TrialAction.KEEP, 0.0))
        # Only once it is acknowledged: until then the end of the block has to revert.
        self._kept = True

    async def __aenter__(self) -> AwaitableTrial:
        try:
            await self._requests.ask(wire.ParameterTrial(0, 0, TrialAction.BEGIN, self._timeout_s))
        except DeviceRefused:
            raise  # this one was not begun; the other goes on, with its values
        except BaseException:  # it may have begun, and nothing else would end it
            self._abandon()
            raise
        self._parameters._tried.clear()
        return self

    async def __aexit__(self, *raised: object) -> None:
        # After a KEEP the session has released the trial already.
        if self._kept:
            return
        try:
            await self._parameters._revert_trial()
        except WheelwireError:
            if raised[1] is None:  # otherwise that error says more
                raise
        except BaseException:  # cancelled: what was asked for is not repeated any more
            self._abandon()
            raise
        finally:
            self._requests.link.release_trial()

    def _abandon(self) -> None:
        # Not waited for: the task may be ending. If it cannot be sent, the device reverts by
        # itself at its time-out.
        with suppress(WheelwireError):
            self._requests.link.post(_REVERT, lambda _: None)
        self._requests.link.release_trial()


class DeviceParameters(Parameters):
    """The parameters of a device, for threads."""

    def __init__(self, requests: Requests) -> None:
        self._awaited = AwaitableParameters(requests)

    set = blocking(AwaitableParameters.set)
    refresh = blocking(AwaitableParameters.refresh)
    list = blocking(AwaitableParameters.list)
    save = blocking(AwaitableParameters.save)
    reset = blocking(AwaitableParameters.reset)

    def trial(self, timeout: float = TRIAL_TIMEOUT_S) -> Trial:
        """Try values; see `Parameters`."""
        return _DeviceTrial(self._awaited.trial(timeout))

    def _value(self, definition: Parameter) -> float:
        return run(self._awaited._active, definition.id)


class _DeviceTrial(Trial):
    def __init__(self, awaited: AwaitableTrial) -> None:
        self._awaited = awaited

    keep = blocking(AwaitableTrial.keep)

    def __enter__(self) -> Trial:
        run(self._awaited.__aenter__)
        return self

    __exit__ = blocking(AwaitableTrial.__aexit__)


def _info(entry: wire.ParameterEntry) -> ParameterInfo:
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
