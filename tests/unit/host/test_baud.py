from wheelwire.baud import FIRST_US, NEXT_US, USUAL_RATES, BaudSearch


def test_every_usual_rate_is_tried_in_turn_and_then_again() -> None:
    search = BaudSearch(115_200, 0)
    assert search.next(FIRST_US - 1) is None
    rates = [search.next(FIRST_US + number * NEXT_US) for number in range(len(USUAL_RATES))]
    assert sorted(rate for rate in rates if rate) == sorted(USUAL_RATES)
    assert rates[-1] == 115_200
    assert sorted(search.tried) == sorted(USUAL_RATES)


def test_an_unusual_rate_is_tried_first_and_kept_in_the_round() -> None:
    assert BaudSearch(57_600, 0).tried == [57_600]


def test_an_answer_ends_the_search() -> None:
    search = BaudSearch(921_600, 0)
    search.end()
    assert search.next(10**9) is None


def test_without_a_rate_there_is_nothing_to_search() -> None:
    search = BaudSearch(None, 0)
    assert search.next(10**9) is None
    assert search.tried == []
