"""What all benchmarks rest on."""

from support.benchmark import Target, import_ms, interleaved, ratio, summary_of_targets, table


def test_measures_take_turns_and_the_first_round_is_left_out() -> None:
    calls: list[str] = []

    def measure(name: str) -> float:
        calls.append(name)
        return float(len(calls))

    found = interleaved({"a": lambda: measure("a"), "b": lambda: measure("b")}, rounds=2)
    assert calls == ["a", "b"] * 3
    assert found == {"a": [3.0, 5.0], "b": [4.0, 6.0]}


def test_a_slow_round_does_not_change_a_ratio() -> None:
    assert ratio([2.0, 200.0, 2.2], [1.0, 100.0, 1.0]) == 2.0


def test_a_table_is_markdown() -> None:
    assert table(("what", "ns"), [["decode", "1"]]) == "| what | ns |\n|-|-:|\n| decode | 1 |\n"


def test_an_import_is_timed_without_the_interpreter() -> None:
    times = import_ms(["unittest.mock"], rounds=1)
    assert set(times) == {"", "unittest.mock"}
    assert times[""] > 0


def test_a_target_that_is_missed_stands_out() -> None:
    targets = [
        Target("speed", "9", ">= 12", reached=False),
        Target("wrong", "0", "0", reached=True),
    ]
    assert summary_of_targets(targets).splitlines() == [
        "**Missed**, with the target: speed 9 (>= 12).",
        "",
        "Reached, with the target: wrong 0 (0).",
    ]
