from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("a real device")
    group.addoption("--port", help="Port of a board to test; see docs/hardware-test.md.")
    group.addoption("--wheels-free", action="store_true", help="Its wheels may turn.")


def pytest_ignore_collect(config: pytest.Config) -> bool | None:
    # Without a board there is nothing to run, and nothing that `make test` could install.
    # The option is not there when this folder is collected as one of many.
    return None if config.getoption("--port", default=None) else True
