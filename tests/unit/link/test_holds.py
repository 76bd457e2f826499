"""The words for what holds a robot, and for what ended its last motion."""

from __future__ import annotations

import os

import pytest

from wheelwire.link.holds import HeldBy, LastStop, Program, start_of
from wheelwire_protocol.codes import (
    Contradiction,
    EstopSource,
    Fault,
    Held,
    ResetReason,
    StopCause,
    StopFlag,
)
from wheelwire_protocol.types import Hold

NOTHING = Hold(7, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)


def test_nothing_holds_it() -> None:
    found = HeldBy.of(NOTHING, Fault(0))
    assert not found
    assert found.names == found.sentences == ()
    assert str(found) == "Nothing holds it."


def test_each_flag_has_its_code_and_its_sentence() -> None:
    for flag in Held:
        found = HeldBy.of(NOTHING._replace(held=flag), Fault(0))
        assert found
        assert flag in found
        assert found.names == (flag.name,)
        assert str(found) == flag.doc
        assert flag.doc.endswith(".")


def test_latch_fault_and_contradiction_are_described_in_full() -> None:
    hold = NOTHING._replace(
        held=Held.ESTOP | Held.FAULT | Held.CONTRADICTION,
        estop_source=EstopSource.CONTACT,
        contradictions=Contradiction.SUPPLY_DROP,
    )
    latch, fault, contradiction = HeldBy.of(hold, Fault.OVERSPEED).sentences
    assert latch.endswith("Who latched it: the e-stop contact.")
    assert fault.endswith(f"OVERSPEED: {Fault.OVERSPEED.doc}")
    assert contradiction.endswith(Contradiction.SUPPLY_DROP.doc)


def test_cleared_faults_are_left_out() -> None:
    assert HeldBy.of(NOTHING, Fault.OVERSPEED) == HeldBy()


def test_a_stop_in_words() -> None:
    hold = NOTHING._replace(
        stop_cause=StopCause.BUMPER,
        stop_flags=StopFlag.AT_REST,
        stop_held=Held.BUMPER_REAR,
        stop_session=9,
        stop_command=12,
        stop_us=5_000_000,
        stop_mmps=250,
        rolled_mm=30,
    )
    stop = LastStop.of(hold, 3.5)
    assert (stop.cause.name, stop.t_us, stop.stamp) == ("BUMPER", 5_000_000, 3.5)
    assert str(stop) == (
        f"A bumper held it off. BUMPER_REAR: {Held.BUMPER_REAR.doc} It went at 0.25 m/s, and came "
        "to rest 0.03 m farther on. It had obeyed the setpoint 12 of its session."
    )


def test_a_reset_has_its_reason_and_no_time() -> None:
    hold = NOTHING._replace(
        stop_cause=StopCause.RESET,
        stop_reset=ResetReason.PANIC,
        stop_flags=StopFlag.EARLIER_START,
        stop_session=9,
    )
    stop = LastStop.of(hold, 3.5)
    assert (stop.reset_reason, stop.t_us, stop.stamp) == (ResetReason.PANIC, None, None)
    assert stop.was_earlier_start
    assert "PANIC" in str(stop)


def test_a_code_of_a_later_firmware_is_refused() -> None:
    with pytest.raises(ValueError, match="200"):
        LastStop.of(NOTHING._replace(stop_cause=200), None)


def test_a_program_is_the_same_only_while_its_process_is() -> None:
    started = start_of(os.getpid())
    assert started is not None
    mine = Program(os.getpid(), started, "python3 drive.py")
    assert mine.is_running
    assert str(mine) == f"`python3 drive.py`, process {os.getpid()}, which runs still"
    later = mine._replace(started=started - 1)  # another one had this number
    assert not later.is_running
    assert str(later).endswith("which has ended")
    assert start_of(2**22 + 1) is None
