"""The driver of a simulated robot, which runs the firmware's core.

In real time it is a process of its own, and replaces a robot under any program. Virtual time passes
only in `advance` and while a call waits; the same calls give the same run, except for boot ids.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any, TypeVar, cast

from wheelwire_protocol.parameters import PARAMETER_BY_NAME

from ..arguments import flag, path, timeout_s
from ..errors import InvalidArgument, LinkLost
from ..link.connection import Link, LinkOptions
from ..link.transports import SocketTransport, Transport
from ..parameters import checked_values
from ..robot.robot import Robot
from ..robot.verbs import WATCHED
from ..simulation.libfwsim import FwSim
from ..simulation.simulator import Simulator
from ..simulation.virtual_link import VirtualLink
from .options import takes

COUNTS = "counts_per_revolution"
"""A parameter; the simulated encoders have a variable of the same name."""

_Driver = TypeVar("_Driver", bound="MockDriver")


@dataclass(frozen=True, kw_only=True)
class MockOptions:
    """The options of `MockDriver`."""

    realtime: bool = True
    parameters: Mapping[str, float] | None = None
    store: Path | None = None


class MockDriver(Robot):
    """A simulated robot: two gear motors, an L298N, two encoders.

    Args:
        realtime: False for virtual time, which only one thread may use.
        parameters: Values that differ from the defaults, by name; the encoders count
            `counts_per_revolution`.
        store: File for parameters saved at run time. The board, and the robot's records of its
            stops, are in files next to it.

    Raises:
        SimulatorNotFound: The simulator is not installed.
        UnknownParameter: In `parameters`.
        ParameterOutOfRange: In `parameters`.
    """

    __signature__ = signature(MockOptions)
    _device: MockProcess | VirtualLink

    def __new__(cls: type[_Driver], *_args: Any, realtime: bool = True, **_options: Any) -> _Driver:
        """Make a `VirtualMockDriver` for virtual time."""
        is_virtual = cls is MockDriver and not flag("realtime", realtime)
        return cast("_Driver", object.__new__(VirtualMockDriver if is_virtual else cls))

    @takes(MockOptions)
    def __init__(self, options: MockOptions) -> None:
        if not flag("realtime", options.realtime):
            raise InvalidArgument(
                "this class runs in real time: derive one for virtual time from VirtualMockDriver"
            )
        self._device = process = MockProcess(options)
        link = LinkOptions("mock", watched=WATCHED, open_port=process.open)
        super().__init__(partial(Link, link))

    @property
    def simulator(self) -> Simulator | FwSim:
        """What a driver cannot know: the truth, and faults to inject, by `get` and `set`."""
        return self._device.simulator

    def advance(self, seconds: float) -> None:
        """Let virtual time pass.

        Raises:
            InvalidCommand: Time is real.
        """
        self._link.advance(timeout_s("seconds", seconds))

    def unplug(self) -> None:
        """The robot is out of reach from now on."""
        self._device.unplug()

    def plug(self) -> None:
        """The robot is back in reach, in real time a moment later."""
        self._device.plug()


class VirtualMockDriver(MockDriver):
    """A simulated robot in virtual time, which passes in `advance` and while a call waits."""

    _link: VirtualLink
    simulator: FwSim

    @takes(MockOptions)
    def __init__(self, options: MockOptions) -> None:
        sim = _powered_on(checked_values(options.parameters), _converted(options.store))
        Robot.__init__(self, partial(VirtualLink, sim=sim, watched=WATCHED))
        self._device = self._link


class _Transport(SocketTransport):
    """A line to a simulator, which ends with it."""

    gone = "the process of the simulated robot has ended; it is started again"
    # Longer than for a port: each attempt starts a process.
    longest_pause_s = 1.0

    def __init__(self, connection: socket.socket, simulator: Simulator) -> None:
        super().__init__(connection)
        self.port = "mock"
        self._simulator = simulator

    def close(self) -> None:
        super().close()
        self._simulator.close()


class MockProcess:
    """The simulator's process, restarted whenever it was lost."""

    simulator: Simulator
    """The newest one that has started."""
    _line: socket.socket
    """This end of the newest line."""

    def __init__(self, options: MockOptions) -> None:
        self._values = checked_values(options.parameters)
        self._store = _converted(options.store)
        self._plugged = True

    def unplug(self) -> None:
        """The robot is out of reach from now on."""
        # First: the link loses its port by what follows, and must not open it again.
        self._plugged = False
        with suppress(OSError):  # it is lost already
            self._line.shutdown(socket.SHUT_RDWR)

    def plug(self) -> None:
        """The robot may be started again."""
        self._plugged = True

    def open(self, _baud_rate: int) -> Transport:
        """Start the simulator; returns the line to it."""
        self._check_plugged()
        ours, theirs = socket.socketpair()
        presets = [f"--preset={_id(name)}={value!r}" for name, value in self._values.items()]
        simulator = Simulator(
            store=self._store, settings=_settings(self._values), arguments=presets, socket=theirs
        )
        transport = _Transport(ours, simulator)
        self._line = ours
        try:
            simulator.start()
            # `unplug` may have come before there was a line.
            self._check_plugged()
        except BaseException:
            # `start` may have failed before it closed this end; closing it twice does no harm.
            theirs.close()
            transport.close()
            raise
        self.simulator = simulator
        return transport

    def _check_plugged(self) -> None:
        if not self._plugged:
            raise LinkLost("the simulated robot is unplugged; call plug()")


def _converted(store: Path | None) -> Path | None:
    return None if store is None else path("store", store).absolute()


def _powered_on(values: dict[str, float], store: Path | None) -> FwSim:
    # A random seed: the boot ids come from it, and two runs are two boots.
    sim = FwSim(int.from_bytes(os.urandom(4), "little"), store)
    for name, value in values.items():
        sim.preset(_id(name), value)
    for name, value in _settings(values).items():
        sim.set(name, value)
    return sim


def _settings(values: dict[str, float]) -> dict[str, float]:
    # The simulated encoders have to count what the parameter says.
    return {COUNTS: values[COUNTS]} if COUNTS in values else {}


def _id(name: str) -> int:
    return PARAMETER_BY_NAME[name].id
