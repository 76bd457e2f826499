from __future__ import annotations

import pytest

from support.lines import LINES


@pytest.fixture(params=LINES)
def line(request: pytest.FixtureRequest) -> str:
    """What opens a link is tested on each of the lines."""
    name: str = request.param
    return name
