"""How many Python functions, in how many files, `set_velocity` calls until its bytes are written.

What a driving program waits for most is this path; each layer that is added to it shows here.
"""

from __future__ import annotations

import sys
from types import FrameType

import pytest

import wheelwire
from wheelwire.simulation.simulator import Simulator

MOST_CALLS, MOST_FILES = 20, 9


def files_of_calls(robot: wheelwire.Robot) -> list[str]:
    """The file of each function that is called until the write, and its name."""
    calls: list[str] = []
    is_written = False

    def note(frame: FrameType, event: str, argument: object) -> None:
        nonlocal is_written
        if event == "call" and not is_written:
            calls.append(f"{frame.f_code.co_filename}:{frame.f_code.co_name}")
        elif event == "c_call" and getattr(argument, "__name__", "") in {"write", "send"}:
            is_written = True

    sys.setprofile(note)
    try:
        robot.set_velocity(0.01, 0.0)
    finally:
        sys.setprofile(None)
    assert is_written
    return calls


@pytest.mark.parametrize("earlier", [0, 999])
def test_a_setpoint_takes_few_calls(earlier: int) -> None:
    with Simulator() as simulator, wheelwire.open_driver("serial", simulator.port) as robot:
        for number in range(earlier):
            robot.set_velocity(0.01, 0.0)
            if number % 20 == 0:
                robot.control_counters()  # the device has read what came before: the line is empty
        calls = files_of_calls(robot)
    # The constructor of a named tuple is in no file.
    files = {call.rpartition(":")[0] for call in calls} - {"<string>"}
    assert len(calls) <= MOST_CALLS, "\n".join(calls)
    assert len(files) <= MOST_FILES, sorted(files)
