import pytest

from support.virtual_line import VirtualLine
from wheelwire.link.clock import ClockEstimator, Exchange
from wheelwire.link.sample_stream import StateStream
from wheelwire.simulation.bad_line import Impairment
from wheelwire_protocol.codes import Fault, SupervisorState
from wheelwire_protocol.types import WheelState

MINUTE_US = 60_000_000


def test_a_repeated_or_older_state_frame_is_no_sample(line: VirtualLine) -> None:
    line.device.lost.add(WheelState)
    line.run(0.05)
    count = len(line.samples)
    newer = line.device.state
    older = newer._replace(t_us=newer.t_us - 5_000)
    for state in (newer, newer, older):
        line.device.send(state)
    line.run(0.01)
    assert len(line.samples) == count + 1
    assert line.statistics.stale_states == 2


def test_the_stamp_of_a_sample_is_the_hosts_time_of_its_latch() -> None:
    impairment = Impairment(delay_us=2_000, jitter_us=8_000)
    line = VirtualLine(to_device=impairment, to_host=impairment).open()
    line.run(10.0)
    for sample in line.samples:
        latched_us = sample.t_us - line.device.clock_offset_us
        assert abs(sample.stamp * 1e6 - latched_us) <= sample.stamp_error_s * 1e6 + 1


def test_each_side_of_a_sample_is_that_of_the_state_frame(line: VirtualLine) -> None:
    line.device.lost.add(WheelState)
    line.run(0.05)
    state = line.device.state._replace(
        left_ticks=11,
        right_ticks=-12,
        left_mps=0.25,
        right_mps=-0.5,
        left_duty_q15=32767,
        right_duty_q15=-32767,
        command_seq=13,
        supervisor=SupervisorState.FAULT,
        faults=Fault.RIGHT_NOT_COUNTING,
        overruns=14,
        battery_mv=11_100,
    )
    line.device.send(state)
    line.run(0.005)
    sample = line.samples[-1]
    assert (sample.left_ticks, sample.right_ticks) == (11, -12)
    assert (sample.left_mps, sample.right_mps) == (0.25, -0.5)
    assert (sample.left_duty, sample.right_duty) == (1.0, -1.0)
    assert (sample.state, sample.faults) == (SupervisorState.FAULT, Fault.RIGHT_NOT_COUNTING)
    assert (sample.command_seq, sample.overruns, sample.battery_v) == (13, 14, 11.1)


def state(t_us: int, boot_id: int = 1) -> WheelState:
    """As on the wire, where 32 bits of the clock are."""
    fields = dict.fromkeys(WheelState._fields, 0)
    return WheelState(**{**fields, "boot_id": boot_id, "t_us": t_us % (1 << 32)})


def in_step(offset_us: int) -> ClockEstimator:
    """The clock of a device that is ahead by `offset_us`."""
    clock = ClockEstimator()
    clock.add(Exchange(0, offset_us, offset_us, 0))
    return clock


@pytest.mark.parametrize("pause_us", [10_000, 40 * MINUTE_US, 90 * MINUTE_US])
def test_the_devices_time_goes_on_across_its_wrap(pause_us: int) -> None:
    begin_us = (1 << 32) - 5_000
    clock, stream = in_step(begin_us), StateStream()
    for host_us in (0, pause_us, pause_us + 10_000):
        measured = stream.newest([state(begin_us + host_us)], clock, host_us)
        assert measured is not None
        assert measured.t_us == begin_us + host_us


def test_a_reset_device_begins_with_its_own_time() -> None:
    stream = StateStream()
    stream.newest([state(50 * MINUTE_US)], in_step(50 * MINUTE_US), 0)
    measured = stream.newest([state(7_000, boot_id=2)], in_step(-13_000), 20_000)
    assert measured is not None
    assert measured.t_us == 7_000


@pytest.mark.parametrize("minutes", [1, 35, 36, 50, 70, 71, 72, 100])
def test_frames_that_waited_for_a_stopped_program_hide_no_fresh_one(minutes: int) -> None:
    """It was stopped by Ctrl-Z: its clock went on, and the line kept what came at first."""
    offset_us = 12_345
    clock, stream = in_step(offset_us), StateStream()
    stream.newest([state(offset_us)], clock, 0)
    pause_us = minutes * MINUTE_US
    for old_us in (5_000, 10_000):
        stream.newest([state(offset_us + old_us)], clock, pause_us)
    seen = []
    for since_us in range(0, 5_000_000, 100_000):
        host_us = pause_us + since_us
        measured = stream.newest([state(offset_us + host_us)], clock, host_us)
        if measured is not None:
            assert measured.t_us == offset_us + host_us
            seen.append(since_us)
    assert seen[0] <= 4_000_000
    assert seen == list(range(seen[0], 5_000_000, 100_000))


@pytest.mark.parametrize("minutes", [1, 36, 50, 71])
def test_after_a_sleep_the_first_frame_of_the_new_session_is_fresh(minutes: int) -> None:
    """The computer's clock stood still meanwhile."""
    stream = StateStream()
    stream.newest([state(0)], in_step(0), 0)
    slept_us = minutes * MINUTE_US
    measured = stream.newest([state(slept_us + 20_000)], in_step(slept_us), 20_000)
    assert measured is not None
    assert measured.t_us == slept_us + 20_000


def test_clocks_that_drift_apart_for_days_lose_no_frame() -> None:
    for drift in (-400e-6, 400e-6):
        stream, clock = StateStream(), ClockEstimator()
        for hour in range(0, 72, 1):
            host_us = hour * 60 * MINUTE_US
            device_us = 10 * MINUTE_US + round(host_us * (1 + drift))
            clock.add(Exchange(host_us, device_us, device_us, host_us))
            for since_us in (0, 30_000_000, 70_000_000):
                t_us = device_us + round(since_us * (1 + drift))
                measured = stream.newest([state(t_us)], clock, host_us + since_us)
                assert measured is not None
                assert measured.t_us == t_us
