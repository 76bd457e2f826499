from __future__ import annotations

import pytest

from support.virtual import VirtualRobot


@pytest.fixture
def robot() -> VirtualRobot:
    """A simulated device, and a host with an open session."""
    return VirtualRobot().open()
