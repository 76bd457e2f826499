"""Problems as people listed them in public threads, each laid over a healthy computer."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.made_up_machine import laid_over, load, make
from wheelwire.tools.doctor import examine

HERE = Path(__file__).parent
LISTINGS = sorted((HERE / "listings").glob("*.yaml"))
HEALTHY = sorted((HERE / "healthy").glob("*.yaml"))


@pytest.mark.parametrize("file", LISTINGS, ids=lambda file: file.stem)
def test_the_problem_of_a_listing_is_named_and_nothing_else(file: Path, tmp_path: Path) -> None:
    listing = load(file)
    computer = laid_over(load(HERE / "healthy" / f"{listing['machine']}.yaml"), listing)
    found = [finding.name for finding in examine(make(tmp_path, computer))]
    assert found == listing["expected"]


@pytest.mark.parametrize("file", HEALTHY, ids=lambda file: file.stem)
def test_nothing_is_wrong_with_a_healthy_computer(file: Path, tmp_path: Path) -> None:
    assert list(examine(make(tmp_path, load(file)))) == []


def test_each_listing_has_its_source() -> None:
    assert len(LISTINGS) >= 30
    assert len(HEALTHY) == 3
    for file in LISTINGS:
        listing = load(file)
        assert listing["source"].startswith("https://")
        assert listing["seen"].strip()
