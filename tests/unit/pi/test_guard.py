"""The guard beside a process that stands in for the core's."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from types import SimpleNamespace

import pytest

from wheelwire.errors import ConfigurationError, DriverUnavailable
from wheelwire.pi import __main__ as program
from wheelwire.pi import guard
from wheelwire.pi.guard import Heartbeat, Phase

CORE_TIMEOUT_S = 0.1
PERIOD_S = 0.01
"""A Linux computer's control period."""


def watch(act: Callable[[Heartbeat], None], opening: bool = False) -> tuple[int, int]:
    """A guard beside a core that does `act` once it runs, or while it still opens its pins.

    Returns the core's exit status, and how often the guard pulled EN low.
    """
    heartbeat, low = Heartbeat(), list[str]()
    core_pid = os.fork()
    if core_pid == 0:
        heartbeat.phase = Phase.OPENING if opening else Phase.RUNNING
        act(heartbeat)
        heartbeat.phase = Phase.CLOSED
        os._exit(0)
    status = guard.watch(core_pid, heartbeat, CORE_TIMEOUT_S, lambda: lambda: low.append("EN"))
    return status, len(low)


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


def starts_slowly(_heartbeat: Heartbeat) -> None:
    time.sleep(3 * CORE_TIMEOUT_S)


KILLED = -signal.SIGKILL


@pytest.mark.parametrize(
    ("act", "opening", "expected"),
    [
        (saves_to_a_slow_card, False, (0, 0)),
        (starts_slowly, True, (0, 0)),
        # A core that is gone drives no more.
        *((act, False, (KILLED, 1)) for act in (hangs, hangs_after_it_has_saved)),
        *((act, False, (KILLED, 1)) for act in (dies, dies_while_it_saves)),
        (fails, False, (1, 1)),
        # Pins that it has given back, or never had, may be another program's by then.
        (closes_and_dies, False, (KILLED, 0)),
        (dies, True, (KILLED, 0)),
        (fails, True, (1, 0)),
    ],
)
def test_the_guard_pulls_en_low_for_a_core_that_is_gone_with_its_pins(
    act: Callable[[Heartbeat], None], opening: bool, expected: tuple[int, int]
) -> None:
    assert watch(act, opening) == expected


class VirtualCore:
    """A core of which the guard sees the beats and the end, in virtual time.

    Args:
        last_beat_s: It beats each millisecond, and then no more.
        end_s: When it ends by itself.
    """

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, last_beat_s: float, end_s: float = 10.0
    ) -> None:
        self.now_s = 0.0
        self.killed_s: float | None = None
        self.low_s: float | None = None
        self._last_beat_s, self._end_s = last_beat_s, end_s
        clock = SimpleNamespace(monotonic_ns=lambda: round(self.now_s * 1e9))
        monkeypatch.setattr(guard, "time", clock)
        monkeypatch.setattr(guard, "select", SimpleNamespace(select=self._select))
        system = SimpleNamespace(
            pidfd_open=lambda _: 1,
            kill=self._kill,
            waitpid=lambda *_: (1, 0),
            close=lambda _: None,
            waitstatus_to_exitcode=os.waitstatus_to_exitcode,
        )
        monkeypatch.setattr(guard, "os", system)
        self.heartbeat = Heartbeat()
        self.heartbeat.phase = Phase.RUNNING

    def run(self) -> None:
        guard.watch(1, self.heartbeat, CORE_TIMEOUT_S, lambda: self._low)

    def _select(self, _: list[int], __: object, ___: object, wait_s: float) -> tuple[list[int]]:
        until_s = self.now_s + wait_s
        has_ended = self._end_s <= until_s
        beat_s = min(until_s, self._last_beat_s)
        if beat_s > self.now_s:
            self.now_s = beat_s
            self.heartbeat.beat()
        self.now_s = min(until_s, self._end_s)
        return ([1] if has_ended else [],)

    def _kill(self, _: int, number: int) -> None:
        assert number == signal.SIGKILL
        self.killed_s = self.killed_s or self.now_s
        self._end_s = self.now_s

    def _low(self) -> None:
        self.low_s = self.now_s


def test_after_a_core_s_death_en_is_low_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    core = VirtualCore(monkeypatch, last_beat_s=1.0, end_s=1.0023)
    core.run()
    assert core.killed_s is None
    assert core.low_s == 1.0023


@pytest.mark.parametrize("last_beat_s", [1.0, 1.0033, 1.0066])
def test_a_hang_ends_within_two_checks_of_its_time(
    monkeypatch: pytest.MonkeyPatch, last_beat_s: float
) -> None:
    """One check finds the core silent; during the other one it might beat again."""
    core = VirtualCore(monkeypatch, last_beat_s)
    core.run()
    assert core.killed_s is not None
    assert core.killed_s == core.low_s
    silent_s = core.killed_s - last_beat_s
    assert CORE_TIMEOUT_S < silent_s <= CORE_TIMEOUT_S + 2 * PERIOD_S + 1e-6


def test_a_guard_that_was_held_up_itself_gives_the_core_a_check_s_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    core = VirtualCore(monkeypatch, last_beat_s=3.0, end_s=4.0)
    held = iter([0.5])
    check = guard._ended

    def ended(descriptor: int, wait_s: float = guard.CHECK_S) -> bool:
        if core.now_s > 1.0 and (for_s := next(held, 0.0)):
            core.now_s += for_s  # and with it the core: neither gets to anything
            return False
        return check(descriptor, wait_s)

    monkeypatch.setattr(guard, "_ended", ended)
    core.run()
    assert core.killed_s is not None
    assert core.killed_s > 3.0


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
