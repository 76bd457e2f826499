"""The last run's report in the documentation."""

import pytest

from publish import MARK, PAGE, published

REPORT = "# On a machine\n\n## Codec\n\nC # and ## stay.\n\n\n"


def test_the_last_report_gives_way_to_the_new_one() -> None:
    page = f"# Benchmarks\n\nProse.\n\n{MARK}\n## On an old machine\n"
    assert published(page, REPORT) == (
        f"# Benchmarks\n\nProse.\n\n{MARK}\n## On a machine\n\n### Codec\n\nC # and ## stay.\n"
    )


def test_the_page_shows_only_what_was_missed() -> None:
    missed = "**Missed**, with the target: ratio 2 (3).\n"
    ends = (
        f"{missed}\nReached, with the target: lost 0 (0).\n\n**link failed with exit code 1.**\n\n"
    )
    page = published(f"Prose.\n{MARK}", f"# A\n\n## Link\n\n{ends}## Codec\n\nFast.\n")
    assert page == f"Prose.\n{MARK}\n## A\n\n### Link\n\n{missed}\n### Codec\n\nFast.\n"


def test_publishing_twice_changes_nothing() -> None:
    once = published(f"Prose.\n{MARK}", REPORT)
    assert published(once, REPORT) == once


def test_a_page_without_its_mark_is_not_overwritten() -> None:
    with pytest.raises(ValueError, match="has no line"):
        published("Prose.\n", REPORT)


def test_the_page_has_its_mark() -> None:
    assert PAGE.read_text("utf-8").count(MARK) == 1
