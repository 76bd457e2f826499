"""Starting other processes from tests."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any


def interruptible() -> None:
    """For `preexec_fn`: restore SIGINT, which a background job such as `make test &` ignores."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def captured(*command: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, whatever that is, and keep what it prints."""
    words = [str(word) for word in command]
    return subprocess.run(words, capture_output=True, text=True, check=False, **options)


@contextmanager
def talking(*command: object, **options: Any) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A program until the end of the block at most, and the first line that it prints."""
    words = [str(word) for word in command]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, **options) as process:
        try:
            assert process.stdout
            yield process, process.stdout.readline()
        finally:
            process.kill()


def children(pid: int) -> list[int]:
    """The child processes of all its threads that were not waited for; none once it has ended."""
    found = []
    # A thread, or all of them, may end meanwhile.
    with suppress(FileNotFoundError, ProcessLookupError):
        for thread in Path(f"/proc/{pid}/task").iterdir():
            with suppress(FileNotFoundError, ProcessLookupError):
                found += [int(child) for child in (thread / "children").read_text().split()]
    return found


def cpu_s(pids: list[int]) -> float:
    """The processor time that these processes have used up to now. [s]"""
    ticks = 0
    for pid in pids:
        after_name = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        ticks += int(after_name[11]) + int(after_name[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def open_files() -> frozenset[tuple[str, str]]:
    """The descriptors of this process: the number of each, and what it leads to."""
    found = set()
    for file in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):  # the listing's own
            found.add((file.name, str(file.readlink())))
    return frozenset(found)


def opened_since(before: frozenset[tuple[str, str]]) -> frozenset[tuple[str, str]]:
    """The descriptors that were opened since, and are open still.

    To count them would not do: meanwhile what another test has left behind may be collected.
    """
    return open_files() - before
