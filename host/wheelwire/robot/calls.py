"""Requests to a device, and how threads run a coroutine that sends them.

On a thread, what it awaits blocks and never suspends, so that `run` has its result at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Coroutine
from contextlib import AbstractContextManager
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar, cast

from wheelwire_protocol.codec import schema_hash
from wheelwire_protocol.codes import Contradiction, Group, RefusalCode, StopMode
from wheelwire_protocol.types import Contradictions, ContradictionsGet, GroupGet, GroupInfo

from ..errors import DeviceRefused, GroupUnavailable, WheelwireError
from ..link.device_link import DeviceLink
from ..link.requests import Answer, RequestMessage, subject
from ..link.sample_stream import LatestSample

if TYPE_CHECKING:
    from ..log.why.watch import StopWatch

ON_A_THREAD = "an operation for asyncio was run on a thread"

P = ParamSpec("P")
Result = TypeVar("Result")


class Explanations(AbstractContextManager["Explanations"]):
    """Explains each error of one robot that leaves a `with` block of it.

    Attributes:
        watch: Watch of the robot's stops, if there is one.
        link: To the robot, whose sensors may say what stopped it.
    """

    def __init__(self, link: DeviceLink) -> None:
        self.watch: StopWatch | None = None
        self.link = link

    def explain(self, error: WheelwireError) -> None:
        """Add to the error the sentence of its stop, the evidence and what to look at."""
        from ..log.why.explanation import explain  # here, for most programs meet no such error

        hold = self.link.hold
        held_by = None if hold is None else self.link.held_by(hold)
        explain(error, self.watch, lambda: self.link.sensors, self.link.name, held_by)

    def __exit__(self, *raised: object) -> None:
        if isinstance(raised[1], WheelwireError):
            self.explain(raised[1])


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
        """As `request`, for what cannot be awaited."""
        return run(Requests.request, self, message)

    async def request(self, message: RequestMessage) -> Answer:
        """As `Link.request`."""
        try:  # with `explanations` it would take two more calls
            return self.link.request(message)
        except WheelwireError as error:
            self.explanations.explain(error)
            raise

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

    async def stop(self, mode: StopMode | None) -> None:
        """As `Link.stop`, or with None `Link.estop`."""
        with self.explanations:
            if mode is None:
                self.link.estop()
            else:
                self.link.stop(mode)

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


def run(
    operation: Callable[P, Coroutine[Any, Any, Result]], *args: P.args, **kwargs: P.kwargs
) -> Result:
    """The result of an operation whose `Requests` block."""
    try:
        operation(*args, **kwargs).send(None)
    except StopIteration as end:
        result: Result = end.value
        return result
    raise RuntimeError(ON_A_THREAD)


def blocking(
    operation: Callable[Concatenate[Any, P], Coroutine[Any, Any, Result]],
) -> Callable[Concatenate[Any, P], Result]:
    """A method that runs this operation of the object's `_awaited`."""

    @wraps(operation)
    def method(self: Any, /, *args: P.args, **kwargs: P.kwargs) -> Result:
        try:  # as `run`, without the call
            operation(self._awaited, *args, **kwargs).send(None)
        except StopIteration as end:
            result: Result = end.value
            return result
        raise RuntimeError(ON_A_THREAD)

    return method
