"""One description of each operation for threads and for asyncio: a coroutine that sends requests.

On a thread, what it awaits blocks and never suspends, so that `run` has its result at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Coroutine
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

from wheelwire_protocol.codec import schema_hash
from wheelwire_protocol.codes import Contradiction, Group, RefusalCode
from wheelwire_protocol.parameters import PARAMETERS
from wheelwire_protocol.types import (
    ClearEstop,
    ClearFault,
    Contradictions,
    ContradictionsGet,
    ControlCounters,
    ControlCountersGet,
    GroupGet,
    GroupInfo,
    Hold,
    HoldGet,
    LinkCounters,
    LinkCountersGet,
    UnsavedGet,
    UnsavedValue,
)

from ..errors import DeviceRefused, GroupUnavailable
from ..holds import Holding
from ..link.device_link import DeviceLink
from ..link.requests import Answer, RequestMessage, subject
from ..link.sample_stream import LatestSample
from .explanations import Explanations

P = ParamSpec("P")
Result = TypeVar("Result")


class Requests:
    """Requests over a link; each of them blocks the thread until it is answered.

    Args:
        link: To the device.

    Attributes:
        explanations: What the errors say of the stop that is behind them.
    """

    def __init__(self, link: DeviceLink) -> None:
        self.link = link
        # An object of its own: a method of the driver would keep the driver alive.
        self.explanations = Explanations(link)

    def check_thread(self) -> None:
        """Raise `InvalidCommand` in a thread that may not use the link; here each one may."""

    def answer_to(self, message: RequestMessage) -> Answer:
        """As `Link.request`, for what cannot be awaited."""
        with self.explanations:
            return self.link.request(message)

    async def request(self, message: RequestMessage) -> Answer:
        """As `Link.request`."""
        return self.answer_to(message)

    async def ask(self, message: RequestMessage) -> Answer:
        """As `request`; an error about contradictory values names them."""
        try:
            return await self.request(message)
        except DeviceRefused as error:
            if error.code != RefusalCode.CONTRADICTION:
                raise
            found = cast("Contradictions", await self.request(ContradictionsGet(0, 0)))
            flags = Contradiction(found.refused)
            sentences = " ".join(flag.doc for flag in Contradiction if flag in flags)
            raise error.hinted(subject(message), sentences) from None

    async def check_group(self, group: Group, needed_by: str = "") -> None:
        """Raise `GroupUnavailable` unless both sides have the same messages of this group.

        Args:
            group: The group.
            needed_by: What needs it, for the error.
        """
        info = cast("GroupInfo", await self.ask(GroupGet(0, 0, group)))
        if info.hash != schema_hash(group):
            name, own = group.name.lower(), schema_hash(group)
            raise GroupUnavailable(name, own, info.hash, needed_by=needed_by)

    async def pause(self, seconds: float) -> None:
        """Wait."""
        if self.link.in_virtual_time:
            self.link.advance(seconds)
        else:
            time.sleep(seconds)

    async def wait_for_sample(
        self, latest: LatestSample, ready: Callable[[], bool], timeout_s: float
    ) -> None:
        """Wait until `ready()`, which is asked whenever a sample has come, or for `timeout_s`."""
        latest.wait_for(ready, timeout_s)


class AwaitableDevice:
    """The requests to a device, except for those about parameters, the board and the recorder."""

    def __init__(self, requests: Requests) -> None:
        self._requests = requests

    async def clear_estop(self) -> None:
        """End the emergency stop; `DeviceRefused` while its cause lasts."""
        await self._requests.request(ClearEstop(0, 0))

    async def clear_fault(self) -> None:
        """Clear the latched faults; `DeviceRefused` while their cause lasts."""
        await self._requests.request(ClearFault(0, 0))

    async def device_counters(self) -> LinkCounters:
        """What the device has counted at its end of the link since its reset."""
        return cast("LinkCounters", await self._requests.request(LinkCountersGet(0, 0)))

    async def contradictions(self) -> Contradiction:
        """Which active parameters contradict each other, or the board: nothing drives meanwhile."""
        answer = cast("Contradictions", await self._requests.request(ContradictionsGet(0, 0)))
        return Contradiction(answer.active)

    async def holding(self) -> Holding:
        """Ask what holds the robot, and what ended its last motion: `held_by` and `last_stop`."""
        hold = cast("Hold", await self._requests.request(HoldGet(0, 0)))
        link = self._requests.link
        return Holding(link.held_by(hold), link.last_stop(hold))

    async def unsaved_parameters(self) -> tuple[str, ...]:
        """The parameters whose active value a reset would change; not while driving.

        Raises:
            GroupUnavailable: The firmware is of a release that cannot tell.
        """
        await self._requests.check_group(Group.STORE)
        answer = cast("UnsavedValue", await self._requests.ask(UnsavedGet(0, 0)))
        return tuple(p.name for p in PARAMETERS if answer.parameters >> (p.id - 1) & 1)

    async def control_counters(self) -> ControlCounters:
        """What the device's control loop and encoders have counted since its reset."""
        return cast("ControlCounters", await self._requests.request(ControlCountersGet(0, 0)))


def run(
    operation: Callable[P, Coroutine[Any, Any, Result]], *args: P.args, **kwargs: P.kwargs
) -> Result:
    """The result of an operation whose `Requests` block."""
    try:
        operation(*args, **kwargs).send(None)
    except StopIteration as end:
        return cast("Result", end.value)
    raise RuntimeError("an operation for asyncio was run on a thread")


def blocking(
    operation: Callable[Concatenate[Any, P], Coroutine[Any, Any, Result]],
) -> Callable[Concatenate[Any, P], Result]:
    """A method that runs this operation of the object's `_awaited`."""

    @wraps(operation)
    def method(self: Any, /, *args: P.args, **kwargs: P.kwargs) -> Result:
        return run(operation, self._awaited, *args, **kwargs)

    return method
