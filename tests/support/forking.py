"""Forking the test's process, whose threads the child does not have."""

from __future__ import annotations

import os
import signal
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


def fork() -> int:
    """As `os.fork`, without its warning about threads: they are the point."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


@contextmanager
def forked(child: Callable[[], object]) -> Iterator[None]:
    """Run `child` in a forked process, which lives until the block ends; what it raises fails."""
    done_read, done_write = os.pipe()
    pid = fork()
    if pid == 0:
        outcome = "ok"
        try:
            child()
        except BaseException:
            outcome = traceback.format_exc()
        os.write(done_write, outcome.encode())
        signal.pause()
        os._exit(0)
    os.close(done_write)
    try:
        outcome = os.read(done_read, 10_000).decode()
        assert outcome == "ok", outcome
        yield
    finally:
        os.close(done_read)
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)


def descriptors() -> dict[str, str]:
    """Where each descriptor of this process leads to, by its number."""
    files = os.listdir("/proc/self/fd")  # noqa: PTH208 - open only while it lists
    links = [Path("/proc/self/fd", file) for file in files]
    return {link.name: str(link.readlink()) for link in links if link.is_symlink()}
