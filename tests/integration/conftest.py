from __future__ import annotations

from collections.abc import Iterator

import pytest

from support.simulator_on_line import LINES
from wheelwire.simulation.simulator import Simulator


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator() as simulator:
        yield simulator


@pytest.fixture(params=LINES)
def line(request: pytest.FixtureRequest) -> str:
    """What opens a link is tested on each of the lines."""
    name: str = request.param
    return name
