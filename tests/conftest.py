"""For all tests. Hypothesis measures no time: it says how busy the computer is."""

from __future__ import annotations

import asyncio
import functools
import inspect
import itertools
import os
import shutil
import signal
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from wheelwire.aio import Driver
from wheelwire.link.programs import DIRECTORY_VARIABLE as TAP_DIRECTORY
from wheelwire.link.programs import GROUP_VARIABLE
from wheelwire.pi.storage import DIRECTORY_VARIABLE
from wheelwire.robot.robot import Robot

TESTS = Path(__file__).parent
WHOLE = ("conformance", "integration", "ros")
"""Folders whose tests run processes in real time: `make test-all`, unless one is marked `fast`."""

os.environ.pop("WHEELWIRE_ROBOT", None)  # the robot of whoever runs the tests is none of theirs

# A shell starts what it puts into the background with Ctrl-C ignored, which children inherit.
signal.signal(signal.SIGINT, signal.default_int_handler)

# A busy computer may take more than the usual second for a sample.
Robot.read.__defaults__ = Driver.read.__defaults__ = (30.0,)

settings.register_profile("wheelwire", deadline=None, suppress_health_check=[HealthCheck.too_slow])
# The same examples each time: `make test` fails for a change. `make test-all` draws new ones.
settings.register_profile(
    "quick", settings.get_profile("wheelwire"), max_examples=20, derandomize=True
)
settings.load_profile("wheelwire")


@pytest.fixture(autouse=True)
def _own_latches(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """A test's robots on this computer's pins share no latched e-stop with another test's."""
    # Only by name: making a folder for each of thousands of tests takes time.
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(_directory(tmp_path_factory)))


@pytest.fixture(autouse=True)
def _own_taps(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """A test's robots are not offered to the programs of whoever runs it."""
    folder = tmp_path_factory.getbasetemp() / f"taps-{next(_NUMBERS)}"
    monkeypatch.setenv(TAP_DIRECTORY, str(folder))
    monkeypatch.delenv(GROUP_VARIABLE, raising=False)


@pytest.fixture(autouse=True)
def _own_state(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """What a test's commands store for later is not among what its user has stored."""
    folder = tmp_path_factory.getbasetemp() / f"state-{next(_NUMBERS)}"
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """`make test` imports no file of processes in which nothing is fast: it takes seconds."""
    folder = collection_path.relative_to(TESTS).parts[:1] if collection_path.suffix == ".py" else ()
    is_left_out = (
        config.option.markexpr == "not whole"
        and folder in {("integration",), ("ros",)}
        and "pytest.mark.fast" not in collection_path.read_text("utf-8")
    )
    return is_left_out or None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A test that is a coroutine runs in a loop of its own. What takes real time is marked."""
    for item in items:
        folder = item.path.relative_to(TESTS).parts[0]
        if folder in WHOLE and item.get_closest_marker("fast") is None:
            item.add_marker("whole")
        if isinstance(item, pytest.Function) and inspect.iscoroutinefunction(item.obj):
            item.obj = _in_a_loop(item.obj)


def _in_a_loop(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    @functools.wraps(test)
    def run(*args: object, **kwargs: object) -> None:
        asyncio.run(test(*args, **kwargs))

    return run


def _directory(factory: pytest.TempPathFactory) -> Path:
    return factory.getbasetemp() / f"latches-{next(_NUMBERS)}"


_NUMBERS = itertools.count()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """One line about what this computer lacks, whatever the number of tests."""
    reasons = {
        str(report.longrepr[2]).removeprefix("Skipped: ")
        for report in terminalreporter.stats.get("skipped", [])
        # Nobody has exported a black box yet: this computer lacks nothing.
        if isinstance(report.longrepr, tuple) and "empty parameter set" not in report.longrepr[2]
    }
    if shutil.which("clang++") is None and not terminalreporter.config.option.markexpr:
        reasons.add("`make fuzz` needs clang: sudo apt install clang")
    if reasons:
        terminalreporter.write_line(f"skipped here: {'; '.join(sorted(reasons))}")
