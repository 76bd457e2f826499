"""The drivers on pins: each with a stand-in process that turns its encoders."""

from __future__ import annotations

import multiprocessing
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from support.gpio_chip_process import GpioChip
from support.pigpio_process import PigpioProcess
from support.pin_drivers import l298n_on, pigpio_on
from support.processes import children, cpu_s
from support.stand_in import StandIn
from wheelwire.drivers.pins import PinDriver
from wheelwire_protocol.codes import SupervisorState

SPIN_S = 1.0
SETTLE_S = 0.3
TTL_S = 0.1
STOPS = 20
PHASE_S = 0.00137


@dataclass(frozen=True)
class Counting:
    """One run of both encoders at one rate."""

    asked_tps: float
    """Ticks a second, each wheel."""
    true_ticks: int
    """Both wheels."""
    counted_ticks: int
    reported: int
    """Illegal transitions that the driver counted meanwhile."""
    seconds: float
    cpu: float
    """CPU of the processes that move the pins, as a fraction of one core."""

    @property
    def lost(self) -> float:
        """Fraction of the true ticks by which the count is off."""
        return abs(self.true_ticks - self.counted_ticks) / self.true_ticks

    @property
    def true_tps(self) -> float:
        """The true rate of each wheel."""
        return self.true_ticks / 2 / self.seconds


@dataclass(frozen=True)
class Timing:
    """Timing of the control loop."""

    stop_late_us: list[int]
    """Time from the setpoint's deadline to EN low, for each stop."""
    worst_step_us: int
    """Time between two control steps, and so between two changes of the PWM."""
    period_us: int


class Rig:
    """A driver with its stand-in."""

    def __init__(self, name: str, driver: PinDriver, stand_in: StandIn) -> None:
        self.name, self.driver, self.stand_in = name, driver, stand_in
        self._command("spin 0")

    def count(self, ticks_per_s: float) -> Counting:
        """Turn the encoders and compare the counts."""
        driver = self.driver
        before, reported = driver.get_encoder_ticks(), _illegal(driver)
        start, cpu = time.monotonic(), cpu_s(pin_processes())
        true_ticks, true_seconds = self._spin(ticks_per_s)
        seconds, cpu = time.monotonic() - start, cpu_s(pin_processes()) - cpu
        after = self._settled_ticks()
        return Counting(
            asked_tps=ticks_per_s,
            true_ticks=true_ticks,
            counted_ticks=sum(after) - sum(before),
            reported=_illegal(driver) - reported,
            seconds=true_seconds,
            cpu=cpu / seconds,
        )

    def time_stops(self) -> Timing:
        """Let setpoints expire and measure when EN goes low."""
        self.stand_in.set_realtime()
        late = []
        for index in range(STOPS):
            ttl_s = TTL_S + index * PHASE_S  # the deadline falls anywhere in a control period
            deadline_us = round((time.monotonic() + ttl_s) * 1e6)
            self.driver.set_duty(0.2, 0.2, ttl=ttl_s)
            for state in (SupervisorState.DRIVING, SupervisorState.TIMED_OUT):
                while self.driver.read().state is not state:
                    pass
            late.append(int(self.stand_in.truth()["driven_changed_us"]) - deadline_us)
        self.stand_in.set_realtime(False)
        period_us = round(1e6 / self.driver.parameters["control_rate_hz"])
        return Timing(late, self.driver.control_counters().latest_step_us, period_us)

    def _spin(self, ticks_per_s: float) -> tuple[int, float]:
        """Turn both encoders; returns the true ticks of both, and the seconds they took."""
        before, start = self._command(f"spin {ticks_per_s}"), time.monotonic()
        time.sleep(SPIN_S)
        self._command("spin 0")
        elapsed = time.monotonic() - start
        return self._rest() - before, elapsed

    def _rest(self) -> int:
        """The true ticks, after the source has stopped."""
        ticks = self._command("truth")
        while True:
            time.sleep(0.05)
            now = self._command("truth")
            if now == ticks:
                return ticks
            ticks = now

    def _command(self, line: str) -> int:
        return sum(self.stand_in.command(line)["ticks"])

    def _settled_ticks(self) -> tuple[int, int]:
        """Wait for edges still in transit: they arrive within SETTLE_S."""
        ticks = self.driver.get_encoder_ticks()
        quiet_since = time.monotonic()
        while time.monotonic() - quiet_since < SETTLE_S:
            self.driver.read()
            now = self.driver.get_encoder_ticks()
            if now != ticks:
                ticks, quiet_since = now, time.monotonic()
        return ticks


@contextmanager
def pigpio_rig() -> Iterator[Rig]:
    """The real client library, and a stand-in for the daemon."""
    with PigpioProcess() as daemon, pigpio_on(daemon) as driver:
        yield Rig("pigpio", driver, daemon)


@contextmanager
def gpio_rig() -> Iterator[Rig]:
    """gpiozero's mock pins on a stand-in for the GPIO chip, its edges through a socket."""
    with (
        tempfile.TemporaryDirectory() as folder,
        GpioChip(Path(folder)) as chip,
        l298n_on(chip) as driver,
    ):
        yield Rig("l298n", driver, chip)


def pin_processes() -> list[int]:
    """Guard and core of this process's driver."""
    found = []
    for pid in children(os.getpid()):
        with suppress(FileNotFoundError, ProcessLookupError):  # it may end meanwhile
            if b"wheelwire.pi" in Path(f"/proc/{pid}/cmdline").read_bytes():
                found += [pid, *children(pid)]
    return found


def _illegal(driver: PinDriver) -> int:
    counters = driver.control_counters()
    return counters.left_illegal + counters.right_illegal


@contextmanager
def busy(processes: int) -> Iterator[None]:
    """Processes that each keep a core busy."""
    context = multiprocessing.get_context("spawn")
    workers = [context.Process(target=_spin_for_ever, daemon=True) for _ in range(processes)]
    for worker in workers:
        worker.start()
    try:
        yield
    finally:
        for worker in workers:
            worker.kill()
            worker.join()


def _spin_for_ever() -> None:
    while True:
        pass
