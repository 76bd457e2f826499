"""What a robot reports, in words: codes and flags print as their names, and `asdict` has all."""

from __future__ import annotations

import json

import pytest

import wheelwire
from wheelwire import Fault, Health, HeldBy, SensorEvent, SensorEventCode, SupervisorState
from wheelwire_protocol.codes import Capability, DocumentedFlag, Reflex
from wheelwire_protocol.peripherals import PeripheralFlag


def test_a_code_prints_as_its_name_and_counts_as_its_number() -> None:
    state = SupervisorState.DRIVING
    assert (str(state), f"{state}", f"{state:>8}", f"{state:d}") == (
        *["DRIVING"] * 2,
        " DRIVING",
        "2",
    )
    assert json.dumps([state]) == "[2]"


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (Capability.BATTERY | Capability.RESTART, "BATTERY|RESTART"),
        (Reflex.STOP, "STOP"),
        (Fault(0), "NONE"),
        (PeripheralFlag(1 << 30) | PeripheralFlag.PULL_UP, "PULL_UP|0x40000000"),
    ],
)
def test_flags_print_as_their_names(flags: DocumentedFlag, words: str) -> None:
    assert (str(flags), f"{flags}", f"{flags:08x}") == (words, words, f"{int(flags):08x}")


def test_health_as_a_dictionary() -> None:
    health = Health(
        is_open=True,
        age_s=0.01,
        rate_hz=100.0,
        loss=0.0,
        clock_error_s=float("nan"),
        latched=SupervisorState.FAULT,
        faults=Fault.LEFT_NOT_COUNTING,
        setpoints_expired=0,
        ttl_max_s=1.0,
        held_by=HeldBy(),
    )
    told = wheelwire.asdict(health)
    assert (told["latched"], told["faults"]) == ("FAULT", ["LEFT_NOT_COUNTING"])
    assert told["clock_error_s"] is None
    assert told["held_by"]["flags"] == []
    json.dumps(told)


def test_an_event_as_a_dictionary() -> None:
    event = SensorEvent("imu", SensorEventCode.STATE, 0, "imu: OK", 5, 0.5, 0.001)
    assert wheelwire.asdict(event)["code"] == "STATE"


def test_what_has_no_fields_is_refused() -> None:
    with pytest.raises(TypeError, match="int has no fields"):
        wheelwire.asdict(5)
