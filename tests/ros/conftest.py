from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from wheelwire.simulation.simulator import Simulator

if TYPE_CHECKING:
    from support.ros import Graph


@pytest.fixture
def graph() -> Iterator[Graph]:
    from support.ros import open_graph  # here: it needs rclpy

    with open_graph() as graph:
        yield graph


@pytest.fixture
def simulator(tmp_path: Path) -> Iterator[Simulator]:
    with Simulator(link=tmp_path / "port") as simulator:
        yield simulator
