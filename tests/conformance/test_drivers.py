"""Every driver passes the conformance suite; what asyncio changes is judged in unit/test_aio.py."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

import pytest

from support.gpio_chip_process import GpioChip
from support.pigpio_process import PigpioProcess
from support.stand_in import StandIn
from support.waiting import wait_until
from wheelwire import aio, errors
from wheelwire.drivers.l298n import L298NDriver
from wheelwire.drivers.mock import MockDriver
from wheelwire.drivers.pigpio import PigpioDriver
from wheelwire.drivers.serial import SerialDriver
from wheelwire.robot.robot import Robot
from wheelwire.simulation.libfwsim import FwSim
from wheelwire.simulation.simulator import Simulator
from wheelwire.testing import Bench, DriverConformance
from wheelwire_protocol.codes import SupervisorState

PATIENCE_S = 30.0
MOCK = {"overrun_limit_us": 1e6, "brake_time_s": 0.2}
"""A busy test machine must not cause a fault."""
PINS: dict[str, Any] = {"parameters": {**MOCK, "stall_time_s": 2.0}, "core_timeout_ms": 5000}


class SimulatedBench(Bench):
    """A robot that the simulator has."""

    simulator: Simulator | FwSim

    def true_ticks(self) -> tuple[int, int]:
        left, right = (int(self.simulator.get(f"true.{side}_ticks")) for side in ("left", "right"))
        return left, right

    def is_driven(self) -> bool:
        return bool(self.simulator.get("drive_on"))

    def block_left_encoder(self) -> None:
        self.simulator.set("left.encoder_dead", 1)


class SerialBench(SimulatedBench):
    """A simulated ESP32 behind a pseudo-terminal."""

    simulator: Simulator

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator

    def open(self) -> Robot:
        return SerialDriver(self.simulator.port)

    def lose_link(self) -> None:
        self.simulator.unplug()

    def restore_link(self) -> None:
        self.simulator.plug()


class MockBench(SimulatedBench):
    """A robot of the driver's own, in virtual or in real time."""

    def __init__(self, realtime: bool) -> None:
        self.realtime = realtime

    def open(self) -> Robot:
        driver = MockDriver(realtime=self.realtime, parameters=MOCK)
        self.simulator = driver.simulator
        self._reference = weakref.ref(driver)
        return driver

    @property
    def driver(self) -> MockDriver:
        driver = self._reference()
        assert driver
        return driver

    def pass_time(self, seconds: float) -> None:
        if self.realtime:
            super().pass_time(seconds)
        else:
            self.driver.advance(seconds)

    def is_driven(self) -> bool:
        try:
            return super().is_driven()
        except errors.WheelwireError:  # with the simulator ends the robot
            return False

    def lose_link(self) -> None:
        self.driver.unplug()

    def restore_link(self) -> None:
        self.driver.plug()


class PinBench(Bench):
    """A stand-in for what moves the pins, with a model robot behind them."""

    loss: ClassVar[tuple[str, str]]
    """Its commands that cut the link, and that restore it."""

    def __init__(self, stand_in: StandIn) -> None:
        self.stand_in = stand_in
        self.is_whole = True

    def true_ticks(self) -> tuple[int, int]:
        left, right = self.stand_in.truth()["ticks"]
        return left, right

    def stands(self) -> bool:
        """Whether no wheel turns for a while."""
        before = self.true_ticks()
        time.sleep(0.1)
        return self.true_ticks() == before

    def is_driven(self) -> bool:
        return bool(self.stand_in.truth()["driven"])

    def lose_link(self) -> None:
        self.is_whole = False
        self.stand_in.command(self.loss[0])

    def restore_link(self) -> None:
        self.stand_in.command(self.loss[1])
        self.is_whole = True

    def block_left_encoder(self) -> None:
        self.is_whole = False
        self.stand_in.command("dead_left_encoder")


class GpioBench(PinBench):
    """gpiozero's mock pins and a PWM directory."""

    loss = ("pwm_away", "pwm_back")
    stand_in: GpioChip

    def open(self) -> Robot:
        return L298NDriver(pwm_directory=self.stand_in.pwm_directory, **PINS)


class PigpioBench(PinBench):
    """The real client library, and a daemon."""

    loss = ("refuse", "accept")
    stand_in: PigpioProcess

    def open(self) -> Robot:
        return PigpioDriver("127.0.0.1", self.stand_in.port, **PINS)


StandInT = TypeVar("StandInT", bound=StandIn)


class Shared(Generic[StandInT]):
    """A stand-in for all tests: a driver that is shut down leaves its robot at rest, pins free."""

    def __init__(self, start: Callable[[], StandInT]) -> None:
        self._start = start
        self._running: StandInT | None = None

    def stand_in(self) -> StandInT:
        self._running = self._running or self._start()
        return self._running

    def bench(self, kind: Callable[[StandInT], PinBench]) -> Iterator[PinBench]:
        """For one test. The next one does not get what it has broken, nor wheels that roll."""
        bench = kind(self.stand_in())
        wait_until(bench.stands)
        yield bench
        assert not bench.is_driven()
        if not bench.is_whole:
            self.close()

    def close(self) -> None:
        if self._running:
            self._running.close()
            self._running = None


@pytest.fixture(scope="module")
def chips(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shared[GpioChip]]:
    chips = Shared(lambda: GpioChip(tmp_path_factory.mktemp("chip")))
    yield chips
    chips.close()


@pytest.fixture(scope="module")
def daemons() -> Iterator[Shared[PigpioProcess]]:
    daemons = Shared(PigpioProcess)
    yield daemons
    daemons.close()


@pytest.fixture
def chip(chips: Shared[GpioChip], monkeypatch: pytest.MonkeyPatch) -> GpioChip:
    chip = chips.stand_in()
    for name, value in chip.environment.items():
        monkeypatch.setenv(name, value)
    return chip


class TestSerial(DriverConformance):
    @pytest.fixture
    def bench(self, tmp_path: Path) -> Iterator[Bench]:
        with Simulator(link=tmp_path / "robot", seed=1) as simulator:
            yield SerialBench(simulator)


class TestVirtualMock(DriverConformance):
    @pytest.fixture
    def bench(self) -> Bench:
        return MockBench(realtime=False)


class TestRealtimeMock(DriverConformance):
    @pytest.fixture
    def bench(self) -> Bench:
        return MockBench(realtime=True)


@pytest.mark.usefixtures("chip")
class TestL298n(DriverConformance):
    @pytest.fixture
    def bench(self, chips: Shared[GpioChip]) -> Iterator[Bench]:
        yield from chips.bench(GpioBench)


class TestPigpio(DriverConformance):
    @pytest.fixture
    def bench(self, daemons: Shared[PigpioProcess]) -> Iterator[Bench]:
        yield from daemons.bench(PigpioBench)


async def drive(robot: aio.Driver) -> None:
    """Until both wheels turn; then stop, until they stand."""
    sample = await robot.read(PATIENCE_S)
    while min(sample.left_mps, sample.right_mps) < 0.1:
        robot.set_velocity(0.2, 0.0, ttl=0.5)
        sample = await robot.read(PATIENCE_S)
    await robot.stop()
    while sample.state is not SupervisorState.IDLE or sample.left_mps or sample.right_mps:
        sample = await robot.read(PATIENCE_S)


async def test_pins_on_asyncio(chip: GpioChip) -> None:
    for _ in range(2):  # the first one leaves the pins free
        async with aio.open_driver("l298n", pwm_directory=chip.pwm_directory, **PINS) as robot:
            assert isinstance(robot.limits, tuple)
            await drive(robot)
            robot.set_velocity(0.2, 0.0, ttl=0.5)
        assert not chip.truth()["driven"]
