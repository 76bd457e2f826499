"""The core on an ESP32-C6's instruction set: same results, at a cost within the targets."""

from __future__ import annotations

import pytest

from support import rv32, rv32_baseline

pytestmark = pytest.mark.skipif(not rv32.available(), reason=f"needs {rv32.INSTALL}")


@pytest.fixture(scope="module", autouse=True)
def _built() -> None:
    rv32.build()


@pytest.mark.whole
def test_every_vector_holds() -> None:
    assert rv32.run("vectors").endswith(" 0 failed\n")


def test_the_cost_is_within_the_targets() -> None:
    cost = rv32.cost()
    assert max(work.max for work in cost.instructions.values()) < rv32.AIM_INSTRUCTIONS
    assert cost.code_bytes < rv32.AIM_CODE_BYTES
    assert cost.ram_bytes < rv32.AIM_RAM_BYTES


def test_a_step_that_says_what_holds_the_robot_is_within_its_target() -> None:
    """Once a second, and at a change; never in a step that sends a state."""
    hold = rv32.hold()
    assert hold.runs >= 4
    assert hold.max < rv32.AIM_HOLD_INSTRUCTIONS


def test_nothing_grew_too_much_since_the_last_release() -> None:
    baseline, compiler = rv32_baseline.load(), rv32.compiler_version()
    if baseline.compiler != compiler:
        pytest.skip(f"the baseline is of GCC {baseline.compiler}, here is {compiler}")
    now = rv32_baseline.figures(rv32.cost())
    grown = rv32_baseline.too_much(rv32_baseline.growth(now, baseline.figures))
    assert grown == {}, f"since {baseline.release}; CONTRIBUTING.md says what to do"


def test_a_recorded_step_costs_a_tenth_more_at_most() -> None:
    baseline, compiler = rv32_baseline.load(), rv32.compiler_version()
    if baseline.compiler != compiler:
        pytest.skip(f"the baseline is of GCC {baseline.compiler}, here is {compiler}")
    median = rv32.recorded()["step"].median
    assert median <= baseline.figures["step, median"] * (1 + rv32.AIM_RECORDED_GROWTH)


def test_the_worst_recorded_steps_are_within_their_own_targets() -> None:
    """A recorder does more in them; without one the targets above hold."""
    steps = rv32.recorded()
    segment = steps.pop("step_with_segment")
    assert segment.runs >= 5
    assert segment.max < rv32.AIM_SEGMENT_INSTRUCTIONS
    assert max(work.max for work in steps.values()) < rv32.AIM_RECORDED_INSTRUCTIONS
    assert rv32.recorder_bytes() < rv32.AIM_RECORDER_BYTES


def test_the_run_has_steps_of_every_kind() -> None:
    assert all(work.runs >= 20 for work in rv32.cost().instructions.values())
