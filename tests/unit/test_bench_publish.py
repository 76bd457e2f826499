"""The last run's report in the documentation."""

import pytest

from bench.publish import MARK, PAGE, published

REPORT = "# On a machine\n\n## Codec\n\nC # and ## stay.\n\n![Plot](codec.png)\n\n\n"


def test_the_last_report_gives_way_to_the_new_one() -> None:
    page = f"# Benchmarks\n\nProse.\n\n{MARK}\n## On an old machine\n"
    assert published(page, REPORT, "plots") == (
        f"# Benchmarks\n\nProse.\n\n{MARK}\n"
        "## On a machine\n\n### Codec\n\nC # and ## stay.\n\n![Plot](plots/codec.png)\n"
    )


def test_publishing_twice_changes_nothing() -> None:
    once = published(f"Prose.\n{MARK}", REPORT, "plots")
    assert published(once, REPORT, "plots") == once


def test_a_page_without_its_mark_is_not_overwritten() -> None:
    with pytest.raises(ValueError, match="has no line"):
        published("Prose.\n", REPORT, "plots")


def test_the_page_has_its_mark() -> None:
    assert PAGE.read_text("utf-8").count(MARK) == 1
