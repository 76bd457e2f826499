"""The guard beside a process that stands in for the core's."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from wheelwire.errors import ConfigurationError, DriverUnavailable
from wheelwire.linux_mcu import __main__ as program
from wheelwire.linux_mcu import guard
from wheelwire.linux_mcu.guard import Heartbeat, Phase

CORE_TIMEOUT_S = 0.1
PERIOD_S = 0.01
"""A Linux computer's control period."""
ATTEMPTS = 5
"""A busy test machine may hold the guard up, but hardly in each of them."""


@dataclass(frozen=True)
class Watch:
    """What a guard did: the core's exit status, and when it pulled EN low, if it did."""

    status: int
    low_s: tuple[float, ...]


def watch(
    act: Callable[[Heartbeat], None], opening: bool = False, core_timeout_s: float = CORE_TIMEOUT_S
) -> Watch:
    """A guard beside a core that does `act` once it runs, or while it still opens its pins."""
    heartbeat, low = Heartbeat(), list[float]()
    core_pid = os.fork()
    if core_pid == 0:
        heartbeat.phase = Phase.OPENING if opening else Phase.RUNNING
        act(heartbeat)
        heartbeat.phase = Phase.CLOSED
        os._exit(0)
    status = guard.watch(
        core_pid, heartbeat, core_timeout_s, lambda: lambda: low.append(time.monotonic())
    )
    return Watch(status, tuple(low))


def saves_to_a_slow_card(heartbeat: Heartbeat) -> None:
    with heartbeat.saving():
        time.sleep(5 * CORE_TIMEOUT_S)


def hangs(_heartbeat: Heartbeat) -> None:
    signal.pause()


def hangs_after_it_has_saved(heartbeat: Heartbeat) -> None:
    with heartbeat.saving():
        pass
    signal.pause()


def dies(_heartbeat: Heartbeat) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def dies_while_it_saves(heartbeat: Heartbeat) -> None:
    with heartbeat.saving():
        dies(heartbeat)


def fails(_heartbeat: Heartbeat) -> None:
    os._exit(1)


def closes_and_dies(heartbeat: Heartbeat) -> None:
    heartbeat.phase = Phase.CLOSED
    dies(heartbeat)


def test_a_slow_save_is_no_hang() -> None:
    assert watch(saves_to_a_slow_card) == Watch(0, ())


@pytest.mark.parametrize("act", [hangs, hangs_after_it_has_saved, dies, dies_while_it_saves])
def test_a_core_that_is_gone_drives_no_more(act: Callable[[Heartbeat], None]) -> None:
    found = watch(act)
    assert (found.status, len(found.low_s)) == (-signal.SIGKILL, 1)


def test_a_core_that_ends_without_closing_its_pins_drives_no_more() -> None:
    found = watch(fails)
    assert (found.status, len(found.low_s)) == (1, 1)


def test_pins_that_the_core_has_given_back_are_not_touched() -> None:
    """Another program may have them by then."""
    assert watch(closes_and_dies) == Watch(-signal.SIGKILL, ())


@pytest.mark.parametrize("act", [dies, fails])
def test_pins_that_the_core_never_had_are_not_touched(act: Callable[[Heartbeat], None]) -> None:
    assert watch(act, opening=True).low_s == ()


def test_a_start_that_takes_long_is_no_hang() -> None:
    assert watch(lambda _: time.sleep(3 * CORE_TIMEOUT_S), opening=True) == Watch(0, ())


def test_after_a_core_s_death_en_is_low_within_a_control_period() -> None:
    took_s = []
    for _ in range(ATTEMPTS):
        died_s = Heartbeat()  # shared with the core

        def dies_and_says_when(_: Heartbeat, died_s: Heartbeat = died_s) -> None:
            died_s.beat()
            dies(_)

        (low_s,) = watch(dies_and_says_when).low_s
        took_s.append(low_s - (time.monotonic() - died_s.age_s))
    assert min(took_s) < PERIOD_S


def test_a_hang_ends_within_a_control_period_of_its_time() -> None:
    """Two checks: one that finds the core silent, and one in which it might beat again."""
    took_s = []
    for _ in range(ATTEMPTS):
        last_beat = Heartbeat()

        def beats_and_hangs(heartbeat: Heartbeat, last_beat: Heartbeat = last_beat) -> None:
            heartbeat.beat()
            last_beat.beat()
            signal.pause()

        (low_s,) = watch(beats_and_hangs).low_s
        took_s.append(low_s - (time.monotonic() - last_beat.age_s))
    assert min(took_s) > CORE_TIMEOUT_S - PERIOD_S
    assert min(took_s) < CORE_TIMEOUT_S + 2 * guard.CHECK_S + PERIOD_S
    assert guard.CHECK_S <= PERIOD_S


def test_a_core_that_beats_is_left_alone() -> None:
    def beats(heartbeat: Heartbeat) -> None:
        for _ in range(35):
            heartbeat.beat()
            time.sleep(0.02)

    assert watch(beats, core_timeout_s=0.5) == Watch(0, ())


def test_a_guard_that_cannot_reach_the_pins_is_never_ready() -> None:
    heartbeat = Heartbeat()

    def refuse() -> Callable[[], None]:
        raise DriverUnavailable("no pins")

    core_pid = os.fork()
    if core_pid == 0:
        os._exit(3)
    assert guard.watch(core_pid, heartbeat, CORE_TIMEOUT_S, refuse) == 3
    assert not heartbeat.guarded


def test_a_core_without_a_guard_that_is_ready_does_not_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(program, "GUARD_START_S", 0.05)
    with pytest.raises(ConfigurationError, match="guards the pins did not start"):
        program._await_guard(Heartbeat())
    heartbeat = Heartbeat()
    heartbeat.guard_is_ready()
    program._await_guard(heartbeat)
