from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from support.simulator_on_line import LINES
from support.stalls import again_after_a_stall
from wheelwire.simulation.simulator import Simulator


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """These tests run programs in real time: a stall of the computer is told from a defect."""
    for item in items:
        # The hook sees the tests of all directories.
        if isinstance(item, pytest.Function) and Path(__file__).parent in item.path.parents:
            item.obj = again_after_a_stall(item.obj)


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator() as simulator:
        yield simulator


@pytest.fixture(params=LINES)
def line(request: pytest.FixtureRequest) -> str:
    """What opens a link is tested on each of the lines."""
    name: str = request.param
    return name
