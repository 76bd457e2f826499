"""What a state frame costs the link's thread, in calls of Python code."""

import threading
from collections import Counter
from types import FrameType

import pytest

from support.waiting import wait_until
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator

MOST_CALLS = 20
"""For a frame, with its share of what is due now and then: pings, checks of the port."""
FRAMES = 100


@pytest.mark.whole  # it waits for a second of frames
def test_a_state_frame_costs_the_links_thread_few_calls() -> None:
    calls: Counter[str] = Counter()
    counting = False

    def count(frame: FrameType, event: str, _argument: object) -> None:
        if counting and event == "call":
            calls[frame.f_code.co_name] += 1

    with Simulator() as simulator:
        threading.setprofile(count)  # of threads that start from here on
        try:
            robot = SerialDriver(simulator.port, tap=False)
        finally:
            threading.setprofile(None)
        with robot:
            robot.read()
            begun = robot.statistics.frames_received
            counting = True
            wait_until(lambda: robot.statistics.frames_received >= begun + FRAMES)
            counting = False
            frames = robot.statistics.frames_received - begun
    assert calls["receive"] > 0, "the link's thread was not counted"
    assert sum(calls.values()) / frames <= MOST_CALLS, calls.most_common(30)
