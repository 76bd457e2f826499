from wheelwire.link.port_policy import FIRST_US, NEXT_US, ROUND_US, USUAL_RATES, BaudSearch


def test_every_usual_rate_is_tried_in_turn_before_the_port_is_reopened() -> None:
    search = BaudSearch(115_200, 0)
    assert search.next(FIRST_US - 1) is None
    others = len(USUAL_RATES) - 1
    rates = [search.next(FIRST_US + number * NEXT_US) for number in range(others)]
    assert sorted([115_200, *(rate for rate in rates if rate)]) == sorted(USUAL_RATES)
    assert not search.over
    assert search.next(ROUND_US) is None
    assert search.over
    assert sorted(search.tried) == sorted(USUAL_RATES)


def test_each_round_begins_with_the_rate_that_was_answered_last() -> None:
    search = BaudSearch(115_200, 0)
    search.end(460_800)
    search.begin(10**9)
    assert search.rate == 460_800
    assert not search.over
    assert search.next(10**9 + FIRST_US) == 921_600


def test_an_unusual_rate_is_tried_first_and_kept_in_the_round() -> None:
    assert BaudSearch(57_600, 0).tried == [57_600]


def test_an_answer_ends_the_search() -> None:
    search = BaudSearch(921_600, 0)
    search.end(921_600)
    assert search.next(10**9) is None


def test_without_a_rate_there_is_nothing_to_search() -> None:
    search = BaudSearch(None, 0)
    assert search.next(ROUND_US - 1) is None
    assert not search.over
    assert search.next(ROUND_US) is None
    assert search.over
    assert search.tried == []
