"""Presses in virtual time."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wheelwire.tools.teleop.keys import (
    DIRECTIONS,
    DOWN,
    FIRST_LIFE_S,
    REPEAT_LIFE_S,
    STILL,
    UP,
    Action,
    KeyEvent,
    Presses,
)

TYPED, PRESSED, REPEATED, RELEASED = Action


def presses(*events: tuple[float, str, Action]) -> Presses:
    result = Presses()
    for now, key, action in events:
        result.take(KeyEvent(key, action), now)
    return result


def way(result: Presses, now: float) -> tuple[int, int]:
    return result.motion(now)[:2]


@pytest.mark.parametrize("action", [TYPED, PRESSED])
def test_a_press_lives_until_the_keyboard_would_have_repeated_it(action: Action) -> None:
    result = presses((10.0, "w", action))
    assert result.motion(10.0) == (1, 0, 10.0 + FIRST_LIFE_S)
    assert way(result, 10.69) == (1, 0)
    assert result.motion(10.7) == STILL


@pytest.mark.parametrize("delay_s", [0.25, 0.5, 0.66])
@pytest.mark.parametrize("action", [TYPED, REPEATED])
def test_a_held_key_drives_without_a_gap_and_ends_after_its_last_repeat(
    delay_s: float, action: Action
) -> None:
    first = TYPED if action is TYPED else PRESSED
    result = presses((0.0, "w", first))
    repeats = [delay_s + number / 30 for number in range(30)]
    for earlier, later in itertools.pairwise([0.0, *repeats]):
        assert way(result, earlier) == way(result, later - 0.001) == (1, 0)
        result.take(KeyEvent("w", action), later)
    assert way(result, repeats[-1] + REPEAT_LIFE_S - 0.001) == (1, 0)
    assert result.motion(repeats[-1] + REPEAT_LIFE_S) == STILL


def test_a_repeat_does_not_shorten_the_press() -> None:
    result = presses((0.0, "w", TYPED), (0.1, "w", TYPED))
    assert result.motion(0.1).until == FIRST_LIFE_S


def test_a_release_ends_the_press_at_once() -> None:
    result = presses((0.0, "w", PRESSED), (0.1, "w", RELEASED))
    assert result.motion(0.1) == STILL
    result = presses((0.0, "w", PRESSED), (0.1, "a", RELEASED))  # never pressed
    assert way(result, 0.1) == (1, 0)


def test_two_directions_make_an_arc() -> None:
    result = presses((0.0, UP, PRESSED), (0.3, "a", PRESSED))
    assert way(result, 0.3) == (1, 1)
    result.take(KeyEvent(UP, RELEASED), 0.4)
    assert way(result, 0.4) == (0, 1)


def test_two_keys_of_one_direction_are_one() -> None:
    assert way(presses((0.0, UP, PRESSED), (0.0, "w", PRESSED)), 0.1) == (1, 0)


@pytest.mark.parametrize("action", [TYPED, PRESSED])
def test_the_newest_of_two_opposite_directions_counts(action: Action) -> None:
    result = presses((0.0, "w", action), (0.1, DOWN, action))
    assert way(result, 0.1) == (-1, 0)
    assert result.motion(0.81) == STILL  # the previous one does not come back


def test_where_releases_are_reported_the_newest_keys_repeats_speak_for_all() -> None:
    result = presses((0.0, "w", PRESSED), (0.5, "w", REPEATED), (0.6, "a", PRESSED))
    for number in range(20):
        now = 1.1 + number / 30
        assert way(result, now) == (1, 1)
        result.take(KeyEvent("a", REPEATED), now)
    assert way(result, now + REPEAT_LIFE_S) == (0, 0)  # both: the releases may have been lost


def test_where_they_are_not_each_key_lives_its_own_life() -> None:
    result = presses((0.0, "w", TYPED), (0.6, "w", TYPED), (0.7, "a", TYPED))
    assert way(result, 0.75) == (1, 1)
    assert way(result, 0.81) == (0, 1)


def test_a_key_held_over_a_stop_must_be_pressed_again() -> None:
    result = presses((0.0, "w", PRESSED))
    result.clear()
    result.take(KeyEvent("w", REPEATED), 0.5)
    assert result.motion(0.5) == STILL
    result.take(KeyEvent("w", PRESSED), 0.6)
    assert way(result, 0.6) == (1, 0)


events = st.tuples(st.sampled_from(sorted(DIRECTIONS)), st.sampled_from(list(Action)))


@given(st.lists(st.tuples(st.floats(0, 1), events), max_size=30))
def test_nothing_moves_longer_than_a_life_after_the_last_event(
    course: list[tuple[float, tuple[str, Action]]],
) -> None:
    result, now = Presses(), 0.0
    for pause, event in course:
        now += pause
        result.take(KeyEvent(*event), now)
        motion = result.motion(now)
        assert {motion.forward, motion.left} <= {-1, 0, 1}
        assert motion is STILL or now < motion.until <= now + FIRST_LIFE_S
    assert result.motion(now + FIRST_LIFE_S) == STILL


@given(st.lists(st.tuples(st.floats(0, 1), st.sampled_from(sorted(DIRECTIONS))), max_size=30))
def test_where_releases_are_reported_letting_go_of_all_keys_stops(
    course: list[tuple[float, str]],
) -> None:
    result, now = Presses(), 0.0
    for pause, key in course:
        now += pause
        result.take(KeyEvent(key, PRESSED), now)
    for key in {key for _, key in course}:
        result.take(KeyEvent(key, RELEASED), now)
    assert result.motion(now) == STILL
