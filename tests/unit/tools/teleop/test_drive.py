"""What the keys mean, on a robot in virtual time."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.hand import LETTING_GO, REPEAT_S, Hand, stop_after
from wheelwire.drivers.mock import MockDriver
from wheelwire.tools.teleop.drive import DEFAULT_SPEED, PERIOD_S, RELEASE_FIRST, SPEEDS, TTL_S
from wheelwire.tools.teleop.keys import INTERRUPT, SPACE, Action
from wheelwire_protocol.codes import SupervisorState

TYPED, PRESSED, REPEATED, RELEASED = Action


@pytest.fixture
def hand() -> Iterator[Hand]:
    with MockDriver(realtime=False) as robot:
        yield Hand(robot, step_s=0.01)


@pytest.mark.parametrize(
    ("key", "forward", "left"), [("w", 1, 0), ("s", -1, 0), ("a", 0, 1), ("d", 0, -1)]
)
def test_each_direction(hand: Hand, key: str, forward: int, left: int) -> None:
    hand.key(key)
    hand.wait(0.6)
    linear, angular = hand.teleop.velocity
    assert hand.true("true.x_m") == pytest.approx(forward * linear * 0.5, abs=0.03)
    assert hand.true("true.heading_rad") == pytest.approx(left * angular * 0.5, abs=0.15)


def test_without_the_loop_a_setpoint_ends_sooner(hand: Hand) -> None:
    hand.key("w")
    hand.robot.advance(TTL_S + 0.01)
    assert hand.true("drive_on") == 0


@pytest.fixture
def lives(hand: Hand, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The times to live of all setpoints."""
    found: list[float] = []
    send = hand.robot.set_velocity

    def noted(linear: float, angular: float, ttl: float, *, stamp: float) -> None:
        found.append(ttl)
        send(linear, angular, ttl, stamp=stamp)

    monkeypatch.setattr(hand.robot, "set_velocity", noted)
    return found


def test_the_last_setpoint_lasts_to_the_end_of_the_press(hand: Hand, lives: list[float]) -> None:
    """One that is sent shortly before would come too late on a slow line."""
    hand.key("w")
    hand.wait(1.0)
    assert lives[:-1] == pytest.approx([TTL_S] * (len(lives) - 1))
    assert TTL_S - PERIOD_S - 0.01 < lives[-1] <= TTL_S
    hand.key("w")
    hand.wait(0.1)
    assert lives[-1] == TTL_S  # a new press


def test_a_new_direction_or_speed_is_sent_at_once(hand: Hand, lives: list[float]) -> None:
    hand.key("w")
    hand.wait(0.55)
    before = len(lives)
    hand.key("5")
    assert len(lives) == before + 1
    hand.key("s")
    assert len(lives) == before + 2


def test_a_release_stops_at_once(hand: Hand) -> None:
    hand.key("w", PRESSED)
    hand.wait(0.3)
    hand.key("w", RELEASED)
    assert hand.state() is SupervisorState.IDLE
    assert hand.true("drive_on") == 0


def test_space_stops_what_is_held(hand: Hand) -> None:
    hand.key("w", PRESSED)
    hand.wait(0.3)
    hand.key(SPACE)
    hand.key("w", REPEATED)
    hand.wait(0.1)
    assert hand.state() is SupervisorState.IDLE


def test_e_latches_and_says_once_why_nothing_drives(hand: Hand) -> None:
    hand.key("w")
    hand.wait(0.3)
    hand.key("e")
    assert hand.state() is SupervisorState.ESTOPPED
    for _ in range(10):
        hand.key("w")
        hand.wait(PERIOD_S)
    assert [line.split(";")[0] for line in hand.said] == [
        "e-stop latched",
        "the device refused the setpoint: Emergency stop is latched",
    ]
    assert hand.true("drive_on") == 0
    hand.key("c")
    assert hand.said[-1] == "ESTOPPED cleared"
    hand.key("c")
    assert hand.said[-1] == "nothing is latched"
    hand.key("w")
    hand.wait(0.3)
    assert hand.state() is SupervisorState.DRIVING


def cleared_by_others(hand: Hand) -> None:
    """As by the node, or with the zero setpoint of `c` lost on a bad line."""
    hand.key("e")
    hand.robot.clear_estop()
    hand.said.clear()


def test_a_key_that_is_held_over_a_clear_drives_nothing_until_it_is_let_go(hand: Hand) -> None:
    cleared_by_others(hand)
    for _ in range(60):
        hand.key("w", TYPED)
        hand.wait(REPEAT_S)
        assert hand.true("drive_on") == 0
    assert hand.said == [RELEASE_FIRST]
    hand.wait(1.1)  # longer than ttl_max_s
    hand.key("w", TYPED)
    hand.wait(0.1)
    assert hand.state() is SupervisorState.DRIVING


def press_again_after_a_clear(hand: Hand) -> None:
    """On a terminal that reports releases."""
    cleared_by_others(hand)
    hand.key("w", PRESSED)
    for _ in range(10):
        hand.wait(REPEAT_S)
        hand.key("w", REPEATED)
    assert hand.said == [RELEASE_FIRST]
    hand.key("w", RELEASED)
    hand.key("w", PRESSED)


def test_where_a_release_is_reported_the_next_press_drives_at_once(hand: Hand) -> None:
    press_again_after_a_clear(hand)
    hand.wait(0.05)
    assert hand.true("drive_on") == 1


def test_a_lower_limit_of_the_robots_is_kept() -> None:
    with MockDriver(realtime=False, parameters={"ttl_max_s": 0.15}) as robot:
        hand = Hand(robot, step_s=0.01)
        hand.key("w", PRESSED)
        hand.wait(0.3)
        assert hand.state() is SupervisorState.DRIVING
        hand.key("e")
        hand.key("c")
        assert hand.said[-1] == "ESTOPPED cleared"
        press_again_after_a_clear(hand)
        hand.wait(0.3)
        assert hand.state() is SupervisorState.DRIVING
        assert hand.said == [RELEASE_FIRST]


def test_keys_that_waited_stop_but_do_not_start(hand: Hand) -> None:
    hand.key("w", stale=True)
    hand.wait(0.1)
    assert hand.state() is SupervisorState.IDLE
    hand.key("w", PRESSED)
    hand.wait(0.3)
    hand.key("w", RELEASED, stale=True)
    assert hand.state() is SupervisorState.IDLE
    hand.key("e", stale=True)
    assert hand.state() is SupervisorState.ESTOPPED


def test_speeds_are_tenths_of_the_robots_limit(hand: Hand) -> None:
    assert hand.teleop.velocity == pytest.approx((0.4 * DEFAULT_SPEED / SPEEDS, 0.8))
    hand.key("0")
    assert hand.teleop.velocity == pytest.approx((0.4, 2.0))
    hand.key("+")
    assert hand.teleop.speed == SPEEDS
    hand.key("1")
    hand.key("-")
    assert hand.teleop.speed == 1
    hand.key("=")
    hand.key("=", REPEATED)
    hand.key("=", RELEASED)
    assert hand.teleop.speed == 3


def test_quitting(hand: Hand) -> None:
    hand.key("q", RELEASED)
    assert not hand.teleop.done
    hand.key("q")
    assert hand.teleop.done
    with pytest.raises(KeyboardInterrupt):
        hand.key(INTERRUPT)


PAGE = Path(__file__).parents[4] / "docs" / "teleop.md"
TEXT = PAGE.read_text("utf-8")
SPEEDS_MPS = [float(speed) for speed in re.findall(r"\| at ([\d.]+) m/s(?= )", TEXT)]
DOCUMENTED = [
    (name, speed_mps, float(seconds), float(metres))
    for name, cells in re.findall(r"^\| ([^|]+) ((?:\| [\d.]+ s, [\d.]+ m )+)\|$", TEXT, re.M)
    for speed_mps, (seconds, metres) in zip(
        SPEEDS_MPS, re.findall(r"([\d.]+) s, ([\d.]+) m", cells), strict=True
    )
]


@pytest.mark.parametrize(("name", "speed_mps", "seconds", "metres"), DOCUMENTED)
def test_time_and_distance_to_standstill_are_as_documented(
    name: str, speed_mps: float, seconds: float, metres: float
) -> None:
    stop = stop_after(LETTING_GO[name], round(speed_mps / 0.4 * SPEEDS))
    assert stop.seconds == pytest.approx(seconds, abs=0.02)
    assert stop.metres == pytest.approx(metres, abs=0.004)


def test_every_way_of_letting_go_is_documented() -> None:
    assert {row[0] for row in DOCUMENTED} == set(LETTING_GO)
    assert len(DOCUMENTED) == 3 * len(LETTING_GO)
