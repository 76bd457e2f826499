"""On a computer's own pins: who takes the drive away when something fails, and when.

Nobody but the test is at the line, and it says nothing more once the wheels turn: an application
that is frozen. So nothing is started again, and the last setpoint would live for seconds. Limits
are for a busy machine; to the control period look `test_core_loop.py` and `test_guard.py`, in
virtual time.
"""

from __future__ import annotations

import os
import select
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from support.gpio_chip.factory import GATE
from support.gpio_chip_process import GpioChip
from support.mcu_process import McuProcess, now_us
from support.pigpio_process import PigpioProcess
from support.stand_in import StandIn
from support.waiting import wait_until
from wheelwire.pi.pins import Pins
from wheelwire.pi.settings import McuSettings

LIFE_US = 4_500_000
"""Life of the last setpoint: longer than all that is measured here."""
CORE_TIMEOUT_US = 500_000
"""Longer than the default: a core that waits for a busy test machine is not hung."""
BUSY_US = 1_500_000
"""A busy test machine may hold a process up for so long."""
BRAKE_S = 0.2
PARAMETERS = {"overrun_limit_us": 1e6, "ttl_max_s": 5, "brake_time_s": BRAKE_S}
ATTEMPTS = 6
UNGUARDED_S = 0.3
CORE, GUARD, SCRIPT = "core", "guard", "script"


@dataclass(frozen=True)
class Removal:
    """The end of a drive.

    Attributes:
        us: When, on the monotonic clock.
        by: Who wrote the pins.
    """

    us: int
    by: str


Change = tuple[int, bool, bool, int | str]
"""The time in microseconds, whether it drives, whether it brakes, and who wrote."""


def has_braked(changes: list[Change]) -> bool:
    return any(braked for _, _, braked, _ in changes)


@dataclass
class Scene:
    """A robot that drives."""

    stand_in: StandIn
    mcu: McuProcess
    core: int

    def removal(self) -> Removal:
        """Wait for the end of the drive, and of what follows it."""
        changes: list[Change] = []

        def is_over() -> bool:
            # One look: until it ends, the drive may pause and go on.
            changes[:] = self._since_the_drive()
            if len(changes) < 2:
                return False
            # A core brakes after each drive, and a guard never does: it needs no process for that.
            in_one_process = isinstance(self.stand_in, PigpioProcess)
            return in_one_process or has_braked(changes) or changes[-1][3] == self.mcu.guard

        wait_until(is_over, what="the end of the drive, and a brake or the pins' end")
        us, _, _, writer = changes[1]
        if isinstance(self.stand_in, PigpioProcess):
            return Removal(us, SCRIPT if writer == "script" else CORE)
        by = {self.core: CORE, self.mcu.guard: GUARD}[int(writer)]
        assert (by == CORE) == has_braked(changes)
        return Removal(us, by)

    def ended_after(self, us: int) -> bool:
        """Whether a drive has ended since then, and no other one begun."""
        truth = self.stand_in.truth()
        return bool(not truth["driven"] and truth["driven_changed_us"] > us)

    def _since_the_drive(self) -> list[Change]:
        """The last change with a drive, and those after it."""
        changes: list[Change] = self.stand_in.truth()["changes"]
        last = max(place for place, (_, driven, *_) in enumerate(changes) if driven)
        return changes[last:]


@pytest.fixture(scope="module")
def chip(tmp_path_factory: pytest.TempPathFactory) -> Iterator[GpioChip]:
    """Without the kernel's PWM, so that each pin tells who has written it."""
    with GpioChip(tmp_path_factory.mktemp("chip"), kernel_pwm=False) as chip:
        chip.set_realtime()
        yield chip


@contextmanager
def process_on(chip: GpioChip, monkeypatch: pytest.MonkeyPatch) -> Iterator[McuProcess]:
    for name, value in chip.environment.items():
        monkeypatch.setenv(name, value)
    settings = McuSettings(
        "l298n",
        Pins(),
        parameters=PARAMETERS,
        pwm_directory=str(chip.pwm_directory),
        core_timeout_ms=CORE_TIMEOUT_US // 1000,
    )
    with McuProcess(settings) as mcu:
        yield mcu


@pytest.fixture
def scene(chip: GpioChip, monkeypatch: pytest.MonkeyPatch) -> Iterator[Scene]:
    with process_on(chip, monkeypatch) as mcu:
        mcu.open().drive(LIFE_US)
        wait_until(lambda: chip.truth()["driven"], what="the drive")
        yield Scene(chip, mcu, mcu.core)


def core(number: signal.Signals) -> Callable[[Scene], None]:
    return lambda scene: os.kill(scene.core, number)


def guard(number: signal.Signals) -> Callable[[Scene], None]:
    return lambda scene: os.kill(scene.mcu.guard, number)


@pytest.mark.parametrize(
    ("fail", "by", "least_us"),
    [
        (core(signal.SIGKILL), GUARD, 0),
        # From its last beat on, which was before it hung.
        (core(signal.SIGSTOP), GUARD, CORE_TIMEOUT_US / 2),
        (core(signal.SIGTERM), CORE, 0),
        (guard(signal.SIGTERM), CORE, 0),
        (guard(signal.SIGHUP), CORE, 0),
        (lambda scene: scene.mcu.hang_up(), CORE, 0),
    ],
)
def test_the_core_stops_at_a_signal_or_a_closed_line_and_the_guard_when_the_core_cannot(
    scene: Scene, fail: Callable[[Scene], None], by: str, least_us: float
) -> None:
    failed_us = now_us()
    fail(scene)
    removal = scene.removal()
    assert removal.by == by
    assert least_us < removal.us - failed_us < 2 * least_us + BUSY_US
    assert (scene.mcu.wait() == 0) == (by == CORE)


def test_a_core_whose_guard_dies_stops_and_ends(scene: Scene) -> None:
    core = os.pidfd_open(scene.core)
    failed_us = now_us()
    os.kill(scene.mcu.guard, signal.SIGKILL)
    removal = scene.removal()
    assert removal.by == CORE
    assert 0 < removal.us - failed_us < BUSY_US
    wait_until(lambda: ended(core), what="the core's end")
    os.close(core)


def ended(process: int) -> bool:
    return bool(select.select([process], [], [], 0)[0])


def test_the_setpoint_of_a_frozen_application_ends_at_its_deadline(scene: Scene) -> None:
    late_us = []
    for number in range(ATTEMPTS):
        # The deadline falls anywhere in a control period.
        sent_us, deadline_us = now_us(), scene.mcu.drive(200_000 + 1_700 * number)
        wait_until(lambda: scene.ended_after(sent_us), what="the end of the drive")  # noqa: B023
        removal = scene.removal()
        assert removal.by == CORE
        late_us.append(removal.us - deadline_us)
    # To the microsecond, without a busy machine: `test_core_loop.py`.
    assert min(late_us) > -scene.mcu.error_us
    assert max(late_us) < BUSY_US


def test_nobody_hears_of_a_start_before_the_guard_is_ready(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gate = tmp_path / "gate"
    monkeypatch.setenv(GATE, str(gate))
    with (
        GpioChip(tmp_path, kernel_pwm=False) as chip,
        process_on(chip, monkeypatch) as mcu,
    ):
        pulls = chip.truth()["pulls"]
        wait_until(lambda: chip.truth()["pulls"] != pulls, what="the core's pins")
        assert not mcu.answers(UNGUARDED_S)
        gate.touch()
        mcu.open()


@pytest.fixture
def behind_pigpiod() -> Iterator[Scene]:
    with PigpioProcess() as daemon:
        daemon.set_realtime()
        settings = McuSettings(
            "pigpio",
            Pins(),
            parameters=PARAMETERS,
            host="127.0.0.1",
            port=daemon.port,
            core_timeout_ms=2 * LIFE_US // 1000,
        )
        with McuProcess(settings) as mcu:
            mcu.open().drive(LIFE_US)
            wait_until(lambda: daemon.truth()["driven"], what="the drive")
            yield Scene(daemon, mcu, mcu.core)


@pytest.mark.parametrize("failure", [signal.SIGKILL, signal.SIGSTOP])
def test_behind_a_pigpiod_the_script_in_it_stops_the_wheels(
    behind_pigpiod: Scene, failure: signal.Signals
) -> None:
    failed_us = now_us()
    os.kill(behind_pigpiod.core, failure)
    removal = behind_pigpiod.removal()
    assert removal.by == SCRIPT
    # By hand: 11 counts of 10 ms from the last refresh, which was at most 20 ms ago.
    assert 0 < removal.us - failed_us < 120_000 + BUSY_US


def test_behind_a_pigpiod_a_setpoint_ends_at_its_deadline(behind_pigpiod: Scene) -> None:
    sent_us, deadline_us = now_us(), behind_pigpiod.mcu.drive(200_000)
    wait_until(lambda: behind_pigpiod.ended_after(sent_us), what="the end of the drive")
    removal = behind_pigpiod.removal()
    assert removal.by == CORE
    assert -behind_pigpiod.mcu.error_us < removal.us - deadline_us < BUSY_US
