"""Whatever happens to an application or to the process that moves the pins, the wheels stop.

The figures are of `bench/dying.py`. Here a busy test machine is allowed to be late.
"""

import itertools

import pytest

from support.dying import CORE_WAYS, WAITING_WAYS, WAYS, die

PATIENT_MS = 2000
LESS_PATIENT_MS = 500
"""A busy test machine is no hung core."""
LATE_US = 1_000_000
BUSY_US = 2_000_000
BRAKE_US = 1_000_000


@pytest.mark.parametrize(
    ("place", "way"), list(itertools.product(["l298n, software PWM", "mock"], WAYS))
)
def test_an_application_that_dies_stops_its_robot(place: str, way: str) -> None:
    death = die(place, way, patience_ms=None if place == "mock" else PATIENT_MS)
    assert death.late_us < LATE_US
    if way in WAITING_WAYS:
        assert death.ended_us is None
    else:
        assert death.ended_us is not None
        assert death.ended_us < BRAKE_US + BUSY_US


@pytest.mark.parametrize(
    ("place", "way"),
    [
        *itertools.product(["l298n", "l298n, software PWM"], CORE_WAYS),
        ("pigpio", "core killed"),
        ("pigpio", "killed (SIGKILL)"),
        ("pigpio", "stopped (SIGSTOP)"),
    ],
)
def test_a_core_that_dies_leaves_the_bridge_off(place: str, way: str) -> None:
    assert die(place, way, patience_ms=LESS_PATIENT_MS).failure_to_removed_us < BUSY_US
