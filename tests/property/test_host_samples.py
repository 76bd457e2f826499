from hypothesis import given
from hypothesis import strategies as st

from support.host_samples import measurement, sample, wrap
from wheelwire.link.sample_stream import LatestSample

int32 = st.integers(-(2**31), 2**31 - 1)
travels = st.integers(-(2**31), 2**31 - 1)


@given(start=int32, travel=travels)
def test_travel_survives_counter_wrap(start: int, travel: int) -> None:
    a = sample(left_ticks=start)
    b = sample(left_ticks=wrap(start + travel))
    assert b.since(a).left == travel
    assert b.since(a).right == 0


@given(
    start=int32,
    steps=st.lists(st.tuples(st.integers(-(2**30), 2**30), st.integers(0, 3)), max_size=30),
)
def test_unbounded_ticks_are_the_sum_of_all_travel_across_wraps_and_resets(
    start: int, steps: list[tuple[int, int]]
) -> None:
    latest_sample = LatestSample()
    latest_sample.put(measurement(left_ticks=start))
    raw, total, boot = start, start, 1
    for travel, dice in steps:
        if dice == 0:  # the device was reset: it counts from 0 again
            raw, boot = 0, boot + 1
        else:
            raw, total = wrap(raw + travel), total + travel
        latest_sample.put(measurement(left_ticks=raw, boot_id=boot))
    assert latest_sample.ticks(0) == (total, 0)
