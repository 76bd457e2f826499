from wheelwire.link.port_policy import IDLE_REST_US, READ_REST_US, REST_US, Coalescing


def test_each_frame_of_a_slow_stream_is_read_when_it_comes() -> None:
    coalescing = Coalescing()
    for number in range(1, 20):
        now_us = number * REST_US
        coalescing.note_read(number, now_us)
        assert coalescing.rest_until_us <= now_us


def test_a_fast_stream_is_left_alone_between_reads() -> None:
    coalescing = Coalescing()
    coalescing.note_read(1, 100_000)
    coalescing.note_read(2, 101_000)
    assert coalescing.rest_until_us == 101_000 + REST_US
    coalescing.note_read(12, 101_000 + REST_US)
    assert coalescing.rest_until_us == 101_000 + 2 * REST_US


def test_a_program_that_reads_is_read_for_more_often() -> None:
    for gap_us, rest_us in ((1000, READ_REST_US), (READ_REST_US, 0)):
        coalescing = Coalescing()
        coalescing.note_read(1, 100_000)
        coalescing.note_read(2, 100_000 + gap_us)
        rest_until_us = 100_000 + gap_us + rest_us if rest_us else 0
        assert coalescing.short_rest_until_us == rest_until_us


def test_a_rest_that_brought_one_frame_is_the_last() -> None:
    coalescing = Coalescing()
    coalescing.note_read(1, 100_000)
    coalescing.note_read(2, 101_000)
    now_us = coalescing.rest_until_us
    coalescing.note_read(3, now_us)
    assert coalescing.rest_until_us <= now_us


def test_answers_in_quick_succession_are_no_stream() -> None:
    coalescing = Coalescing()
    for number in range(1, 20):
        coalescing.note_read(number, 1000 * number, has_state=False)
    assert coalescing.rest_until_us == 0


def test_samples_of_sensors_in_quick_succession_are_a_stream() -> None:
    coalescing = Coalescing()
    coalescing.note_read(1, 100_000, has_state=False, has_sensed=True)
    coalescing.note_read(2, 101_000, has_state=False, has_sensed=True)
    assert coalescing.rest_until_us == 101_000 + REST_US


def test_an_idle_robot_is_left_alone_for_some_frames() -> None:
    for period_us, frames, rest_us in (
        (20_000, 1, 0),
        (10_000, 1, IDLE_REST_US),
        (25_000, 2, IDLE_REST_US),
        (10_000, 20, IDLE_REST_US),
        (10_000, 50, REST_US),  # 5000 frames a second: a longer rest would overflow the port
    ):
        coalescing = Coalescing()
        coalescing.note_read(1, 100_000)
        now_us = 100_000 + period_us
        coalescing.note_read(1 + frames, now_us)
        assert coalescing.idle_until_us == (now_us + rest_us if rest_us else 0)
        coalescing.note_read(2 + frames, now_us + 1, has_state=False)
        assert coalescing.idle_until_us == coalescing.rest_until_us, "after an answer"
