"""A driver for asyncio behind the interface of the others, so that the same tests judge it."""

from __future__ import annotations

import asyncio
import threading
import weakref
from collections.abc import Callable, Coroutine
from types import TracebackType
from typing import Any, TypeVar

from wheelwire import aio
from wheelwire.link.statistics import LinkStatistics
from wheelwire.link.traffic import Happening
from wheelwire.motion.kinematics import DifferentialDrive, WheelVelocities
from wheelwire.parameters import ParameterInfo, Parameters, Trial
from wheelwire.robot.robot import Robot
from wheelwire.samples import WheelSample
from wheelwire_protocol.parameters import Parameter

Result = TypeVar("Result")


class AioDriver(Robot):
    """Runs a loop in a thread, and every call in it.

    Args:
        opening: What `aio.open_driver` returns.
    """

    def __init__(self, opening: aio.Opening[Any]) -> None:
        super().__init__()
        self._loop = loop = asyncio.new_event_loop()
        thread = threading.Thread(target=loop.run_forever)
        thread.start()
        try:
            self.robot: aio.Driver = self._run(_awaited(opening))
        except BaseException:
            _end_loop(loop, thread)
            raise
        self._parameters = _Parameters(self.robot.parameters, self._run)
        self._finalizer = weakref.finalize(self, _end, loop, thread, self.robot)

    def set_velocity(self, *arguments: Any, **options: Any) -> None:
        self._plain(self.robot.set_velocity, *arguments, **options)

    def set_wheel_velocity(self, *arguments: Any, **options: Any) -> None:
        self._plain(self.robot.set_wheel_velocity, *arguments, **options)

    def set_duty(self, *arguments: Any, **options: Any) -> None:
        self._plain(self.robot.set_duty, *arguments, **options)

    def stop(self) -> None:
        self._run(self.robot.stop())

    def estop(self) -> None:
        self._run(self.robot.estop())

    def clear_estop(self) -> None:
        self._run(self.robot.clear_estop())

    def clear_fault(self) -> None:
        self._run(self.robot.clear_fault())

    def read(self, timeout: float = 1.0) -> WheelSample:
        return self._run(self.robot.read(timeout))

    def get_encoder_ticks(self) -> tuple[int, int]:
        return self._run(self.robot.get_encoder_ticks())

    def shutdown(self) -> None:
        self._finalizer()

    @property
    def geometry(self) -> DifferentialDrive:
        return self.robot.geometry

    @property
    def parameters(self) -> Parameters:
        return self._parameters

    @property
    def statistics(self) -> LinkStatistics:
        return self.robot.statistics

    def _drive_velocity(self, wheels: WheelVelocities, expiry_us: int) -> None:
        raise NotImplementedError

    def _drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        raise NotImplementedError

    def _listen(self, happening: Happening) -> None:
        def tell(told: object) -> None:
            self._callbacks.listener((happening, told))

        self._plain(setattr, self.robot, happening.value, tell)

    def _check_link(self) -> None:
        self.robot._check_link()

    def _plain(self, call: Callable[..., None], *arguments: Any, **options: Any) -> None:
        async def called() -> None:
            call(*arguments, **options)

        self._run(called())

    def _run(self, coroutine: Coroutine[Any, Any, Result]) -> Result:
        if self._loop.is_closed():
            return asyncio.run(coroutine)
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop).result()


class _Parameters(Parameters):
    def __init__(self, parameters: aio.Parameters, run: Callable[..., Any]) -> None:
        self._parameters = parameters
        self._run = run

    def set(self, name: str, value: float) -> float:
        in_force: float = self._run(self._parameters.set(name, value))
        return in_force

    def refresh(self, name: str | None = None) -> None:
        self._run(self._parameters.refresh(name))

    def list(self) -> tuple[ParameterInfo, ...]:
        infos: tuple[ParameterInfo, ...] = self._run(self._parameters.list())
        return infos

    def save(self, name: str | None = None) -> None:
        self._run(self._parameters.save(name))

    def reset(self) -> None:
        self._run(self._parameters.reset())

    def trial(self, timeout: float = 2.0) -> Trial:
        return _Trial(self._parameters.trial(timeout), self._run)

    def _value(self, definition: Parameter) -> float:
        return self._parameters[definition.name]


class _Trial(Trial):
    def __init__(self, trial: aio.Trial, run: Callable[..., Any]) -> None:
        self._trial = trial
        self._run = run

    def keep(self) -> None:
        self._run(self._trial.keep())

    def __enter__(self) -> Trial:
        self._run(self._trial.__aenter__())
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._run(self._trial.__aexit__(kind, error, traceback))


async def _awaited(opening: aio.Opening[Any]) -> aio.Driver:
    robot: aio.Driver = await opening
    return robot


def _end(loop: asyncio.AbstractEventLoop, thread: threading.Thread, robot: aio.Driver) -> None:
    try:
        asyncio.run_coroutine_threadsafe(robot.close(), loop).result()
    finally:
        _end_loop(loop, thread)


def _end_loop(loop: asyncio.AbstractEventLoop, thread: threading.Thread) -> None:
    asyncio.run_coroutine_threadsafe(loop.shutdown_default_executor(), loop).result()
    loop.call_soon_threadsafe(loop.stop)
    thread.join()
    loop.close()
