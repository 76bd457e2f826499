"""What a simulated robot's black box says."""

from __future__ import annotations

from itertools import pairwise

from support.virtual import box_after_a_contact
from wheelwire_protocol.black_box import (
    BOX_SIZE,
    Box,
    BoxCause,
    Contact,
    End,
    Received,
    Step,
    Transition,
    core_hash,
)


def test_a_box_says_what_the_robot_was_given_and_did() -> None:
    image = box_after_a_contact()
    box = Box(image)
    assert len(image) == BOX_SIZE
    assert box.head.cause is BoxCause.ESTOP
    assert box.head.core == core_hash()
    entries = list(box.entries())
    steps = [entry for entry in entries if isinstance(entry, Step)]
    assert steps[-1].t_us - steps[0].t_us > 1_000_000
    assert {after.t_us - before.t_us for before, after in pairwise(steps)} == {1000}
    assert steps[-1].left_counter > steps[0].left_counter
    assert steps[-1].left_duty_q15 > steps[-1].right_duty_q15 > 0
    assert 6000 < steps[-1].battery_mv < 8000
    assert {type(entry.message).__name__ for entry in entries if isinstance(entry, Received)} >= {
        "SetWheelVelocity",
        "Ping",
    }
    contact, stop, end = entries[-3:]
    assert contact == Contact(steps[-1].t_us, open=True)
    assert isinstance(stop, Transition)
    assert (stop.event.name, stop.after.name) == ("ESTOP", "ESTOPPED")
    assert end == End(steps[-1].t_us + 1000, 0, 0)
