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
from wheelwire.link.sharing_folder import DIRECTORY_VARIABLE as TAP_DIRECTORY
from wheelwire.link.sharing_folder import GROUP_VARIABLE
from wheelwire.pi.storage import DIRECTORY_VARIABLE
from wheelwire.robot.robot import Robot

TESTS = Path(__file__).parent
WHOLE = ("conformance", "integration", "ros")
"""Folders whose tests run processes in real time: `make test-all`, unless one is marked `fast`."""
REAL_TIME = "whole or hypothesis"
CHOSEN: dict[str, Callable[[str, str], bool]] = {
    "not whole": lambda folder, text: (
        folder not in ("integration", "ros") or "pytest.mark.fast" in text
    ),
    REAL_TIME: lambda folder, text: (
        folder in WHOLE or "pytest.mark.whole" in text or "hypothesis" in text
    ),
}
"""Whether a file of this folder and text has tests of what the Makefile chooses."""

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


_NUMBERS = itertools.count()


@pytest.fixture(autouse=True)
def _own_folders(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """A test shares nothing with another test, or with whoever runs it.

    Its robots on this computer's pins have no latched e-stop of another's, its robots are not
    offered to a user's programs, and what its commands store is not among what a user has stored.
    """
    for variable in (DIRECTORY_VARIABLE, TAP_DIRECTORY, "XDG_STATE_HOME"):
        # Only by name: making a folder for each of thousands of tests takes time.
        folder = tmp_path_factory.getbasetemp() / f"own-{next(_NUMBERS)}"
        monkeypatch.setenv(variable, str(folder))
    monkeypatch.delenv(GROUP_VARIABLE, raising=False)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Each of many processes would import, for seconds, a file of which no test is chosen."""
    may_be_chosen = CHOSEN.get(config.option.markexpr)
    if may_be_chosen is None or collection_path.suffix != ".py":
        return None
    folder = collection_path.relative_to(TESTS).parts[0]
    return not may_be_chosen(folder, collection_path.read_text("utf-8")) or None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """A test that is a coroutine runs in a loop of its own. What takes real time is marked."""
    for item in items:
        folder = item.path.relative_to(TESTS).parts[0]
        if folder in WHOLE and item.get_closest_marker("fast") is None:
            item.add_marker("whole")
        if isinstance(item, pytest.Function) and inspect.iscoroutinefunction(item.obj):
            item.obj = _in_a_loop(item.obj)
    if config.option.markexpr == REAL_TIME:
        items[:] = _mixed(items)


def _mixed(items: list[pytest.Item]) -> list[pytest.Item]:
    """All folders' files side by side, so that some wait while others compute; long ones first."""
    files: dict[Path, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.path, []).append(item)
    folders: dict[str, list[Path]] = {}
    for path in files:
        folders.setdefault(path.relative_to(TESTS).parts[0], []).append(path)
    place = {
        path: 0.0
        if any(item.get_closest_marker("early") for item in files[path])
        else (number + 1) / len(paths)
        for paths in folders.values()
        for number, path in enumerate(paths)
    }
    return [item for path in sorted(files, key=place.__getitem__) for item in files[path]]


def _in_a_loop(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    @functools.wraps(test)
    def run(*args: object, **kwargs: object) -> None:
        asyncio.run(test(*args, **kwargs))

    return run


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """One line about what this computer lacks, whatever the number of tests."""
    reasons = {
        str(report.longrepr[2]).removeprefix("Skipped: ")
        for report in terminalreporter.stats.get("skipped", [])
        # Nobody has exported a black box yet: this computer lacks nothing.
        if isinstance(report.longrepr, tuple) and "empty parameter set" not in report.longrepr[2]
    }
    expression = terminalreporter.config.option.markexpr
    if shutil.which("clang++") is None and expression != "not whole":
        reasons.add("`make fuzz` needs clang: sudo apt install clang")
    if reasons:
        terminalreporter.write_line(f"skipped here: {'; '.join(sorted(reasons))}")
