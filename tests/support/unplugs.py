"""A robot that is unplugged at a random moment of a call, again and again, with either API."""

from __future__ import annotations

import asyncio
import inspect
import select
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from operator import methodcaller
from random import Random
from typing import Any

from support.answering_port import Port
from support.core_device import CoreDevice
from wheelwire import aio
from wheelwire.errors import LinkLost, WheelwireError
from wheelwire.link.clock import host_clock_us
from wheelwire.link.connection import Link, LinkOptions
from wheelwire.robot.robot import Robot, opened_later
from wheelwire.robot.verbs import WATCHED

BOUND_S = 8.0
"""A call takes 5 s at most; the rest is for a computer that has other things to do."""
ROBOTS = 10
LONGEST_DELAY_S = 0.004
"""After the call begins: most calls are answered within a millisecond."""


def _try_value(robot: Any) -> Any:
    if isinstance(robot, aio.Driver):
        return _try_value_in_loop(robot)
    with robot.parameters.trial() as trial:
        robot.parameters.set("integral_gain", 7.5)
        return trial.keep()


async def _try_value_in_loop(robot: aio.Driver) -> None:
    async with robot.parameters.trial() as trial:
        await robot.parameters.set("integral_gain", 7.5)
        await trial.keep()


CALLS: dict[str, Callable[[Any], Any]] = {
    **{
        name: methodcaller(name)
        for name in (
            *("stop", "estop", "clear_estop", "clear_fault"),
            *("device_counters", "control_counters", "get_encoder_ticks", "contradictions"),
        )
    },
    "set": lambda robot: robot.parameters.set("integral_gain", 7.5),
    "refresh": lambda robot: robot.parameters.refresh("integral_gain"),
    "list": lambda robot: robot.parameters.list(),
    "save": lambda robot: robot.parameters.save("integral_gain"),
    "reset": lambda robot: robot.parameters.reset(),
    "read": lambda robot: robot.read(0.05),
    "trial": _try_value,
    "set_velocity": lambda robot: robot.set_velocity(0.1, 0.0),
}


@dataclass
class Outcome:
    """How the calls ended."""

    ends: Counter[str] = field(default_factory=Counter)
    """"returned", or the name of the error."""
    longest_s: float = 0.0
    unbounded: list[str] = field(default_factory=list)
    """What did not end in time, or with another error than a WheelwireError; nothing follows it."""
    unheard: list[str] = field(default_factory=list)
    """Losses and returns that the callbacks were not called for, or in another order."""

    def add(self, name: str, error: BaseException | None, begin_s: float) -> None:
        """A call that began at `begin_s` has ended."""
        duration_s = time.monotonic() - begin_s
        self.longest_s = max(self.longest_s, duration_s)
        self.ends["returned" if error is None else type(error).__name__] += 1
        if duration_s > BOUND_S or not (error is None or isinstance(error, WheelwireError)):
            self.unbounded.append(f"{name}: {error!r} after {duration_s:.1f} s")


class _Pluggable(Port):
    """A port whose far end can be pulled out, by any thread."""

    longest_pause_s = 0.002

    def write(self, data: bytes) -> int:
        try:
            return super().write(data)
        except OSError as error:  # its device cannot answer any more
            raise self.lost(error) from error

    def read(self) -> bytes:
        try:
            data = self.ours.recv(4096)
        except BlockingIOError:
            return b""
        if not data:
            raise self.lost()
        return data


class Socket:
    """What the robot is plugged into. It answers some calls at once, and some only later."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._device = CoreDevice()
        self._port: _Pluggable | None = None
        self._plugged = True

    def open(self, _baud_rate: int) -> Port:
        """Opens the port, as long as the robot is there."""
        if not self._plugged:
            raise LinkLost("unplugged")
        self._port = _Pluggable(self._device, self._accepts)
        return self._port

    def unplug(self) -> None:
        self._plugged = False
        if self._port is not None:
            self._port.theirs.close()

    def plug(self) -> None:
        # Anew: a latched e-stop or a fault would have every later call refused.
        self._device = CoreDevice()
        self._plugged = True

    def _accepts(self) -> bool:
        # A full buffer now and then: the frame then waits for a later turn.
        return self._plugged and self._random.random() > 0.1


def in_parallel(run: Callable[[int, int], Outcome], count: int, seed: int) -> Outcome:
    """`count` in all, by several robots at once: most of an unplug is waiting for its end."""
    total = Outcome()
    with ThreadPoolExecutor(ROBOTS) as executor:
        for outcome in executor.map(run, [count // ROBOTS] * ROBOTS, range(seed, seed + ROBOTS)):
            total.ends += outcome.ends
            total.longest_s = max(total.longest_s, outcome.longest_s)
            total.unbounded += outcome.unbounded
            total.unheard += outcome.unheard
    return total


def options(socket: Socket) -> LinkOptions:
    """A link to whatever is in the socket."""
    return LinkOptions("socket", watched=WATCHED, open_port=socket.open)


def with_threads(count: int, seed: int) -> Outcome:
    """`count` unplugs during calls of `wheelwire.BaseDriver`."""
    socket = Socket(Random(seed))
    robot = Robot(partial(Link, options(socket)))

    async def call(function: Callable[[Any], Any]) -> None:
        await asyncio.to_thread(function, robot)

    with robot:
        return asyncio.run(_unplugs(socket, robot, call, count, Random(seed)))


def with_asyncio(count: int, seed: int) -> Outcome:
    """`count` unplugs during calls of `wheelwire.aio.Driver`."""
    return asyncio.run(_with_asyncio(count, seed))


async def _with_asyncio(count: int, seed: int) -> Outcome:
    socket = Socket(Random(seed))

    def make() -> aio.Driver:
        with opened_later():
            return aio.Driver(Robot(partial(Link, options(socket))))

    async def call(function: Callable[[Any], Any]) -> None:
        result = function(robot)
        if inspect.isawaitable(result):
            await result

    async with aio.Opening(make) as robot:
        return await _unplugs(socket, robot, call, count, Random(seed))


async def _unplugs(
    socket: Socket, robot: Any, call: Callable[..., Any], count: int, random: Random
) -> Outcome:
    """Unplug it during calls, and at last while it is closed."""
    outcome, heard = Outcome(), list[str]()
    robot.on_lost = lambda _: heard.append("lost")
    robot.on_opened = lambda _: heard.append("opened")
    for number in range(1, count + 1):
        name = random.choice(list(CALLS))
        if isinstance(robot, aio.Driver) and random.random() < 0.5:
            socket.unplug()  # the loss is found by the call itself
        await _unplug_during(name, call(CALLS[name]), socket, random, outcome)
        if outcome.unbounded:
            break
        socket.plug()
        begin_s = time.monotonic()
        while len(heard) < 2 * number and time.monotonic() < begin_s + BOUND_S:
            await asyncio.sleep(0.001)
    if heard != ["lost", "opened"] * number:
        outcome.unheard.append(f"{number} unplugs: {Counter(heard)}")
    await _unplug_during("close", call(lambda robot: robot.close()), socket, random, outcome)
    return outcome


async def _unplug_during(
    name: str, awaited: Awaitable[None], socket: Socket, random: Random, outcome: Outcome
) -> None:
    delay_s = random.uniform(0, LONGEST_DELAY_S)
    unplugging = asyncio.ensure_future(asyncio.to_thread(_unplug_after, socket, delay_s))
    await asyncio.sleep(0)  # its thread has begun
    begin_s, error = time.monotonic(), None
    try:
        await asyncio.wait_for(awaited, BOUND_S)
    except BaseException as caught:
        error = caught
    outcome.add(name, error, begin_s)
    await unplugging


def _unplug_after(socket: Socket, delay_s: float) -> None:
    # Not `sleep`, whose shortest time is longer than many calls.
    end_us = host_clock_us() + round(delay_s * 1e6)
    while host_clock_us() < end_us:
        select.select([], [], [], 0)
    socket.unplug()
