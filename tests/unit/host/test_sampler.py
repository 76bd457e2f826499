from support.virtual_line import VirtualLine
from wheelwire.faultline import Faults


def test_a_repeated_or_older_state_frame_is_no_sample() -> None:
    line = VirtualLine().open()
    line.device.rate_hz = 0
    line.run(0.05)
    count = len(line.samples)
    newer = line.device.state(line.now_us)
    older = newer._replace(t_us=newer.t_us - 5_000)
    for state in (newer, newer, older):
        line.device.send(state)
    line.run(0.01)
    assert len(line.samples) == count + 1
    assert line.session.statistics(line.now_us).stale_states == 2


def test_the_stamp_of_a_sample_is_the_hosts_time_of_its_latch() -> None:
    faults = Faults(delay_us=2_000, jitter_us=8_000)
    line = VirtualLine(to_device=faults, to_host=faults).open()
    line.run(10.0)
    for sample in line.samples:
        latched_us = sample.t_us - line.device.clock_offset_us
        assert abs(sample.stamp * 1e6 - latched_us) <= sample.stamp_error_s * 1e6 + 1
