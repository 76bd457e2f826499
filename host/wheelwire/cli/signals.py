"""Ctrl-C, SIGTERM and SIGHUP: they stop the robot, and the user is told what was done."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

import typer

from wheelwire.drivers.base import BaseDriver
from wheelwire.errors import WheelwireError

from . import INTERRUPTED

_ENDING = (signal.SIGTERM, signal.SIGHUP)


class Interrupted(BaseException):
    """A signal ended the command. The message says what was done by then.

    Not an Exception: nothing that handles errors may go on after it.
    """

    def __init__(self, exit_code: int, message: str) -> None:
        super().__init__(message)
        self.exit_code = exit_code


class _Signal(BaseException):
    """SIGTERM or SIGHUP came. An exception, so that all blocks are left in order."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


class Ending:
    """What the user is told if a signal ends the command."""

    def __init__(self) -> None:
        self.outcome = "interrupted before anything was done"

    @contextmanager
    def stops(self, robot: BaseDriver, then: Callable[[], str] = str) -> Iterator[None]:
        """Stop `robot` if a signal ends the block, and tell whether it has stopped.

        Args:
            robot: The robot that may be driving.
            then: Says what else there is to know or to do, once the block is left.
        """
        try:
            yield
        except (KeyboardInterrupt, typer.Abort, _Signal):
            self.outcome = "; ".join(filter(None, (stop(robot), then())))
            raise


def stop(robot: BaseDriver) -> str:
    """Stop the robot; returns what to tell of it."""
    try:
        robot.stop()
    except WheelwireError as error:
        return f"the stop was not acknowledged ({error}); the robot stops by itself"
    return "stopped"


@contextmanager
def ended_by_signals() -> Iterator[Ending]:
    """SIGTERM and SIGHUP leave the block as Ctrl-C does: robot stopped, terminal restored.

    Raises:
        Interrupted: Such a signal, or Ctrl-C, has ended the block.
    """
    ending = Ending()
    # What `nohup` or a service ignores stays ignored.
    heard = [number for number in _ENDING if signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, _raise) for number in heard}
    try:
        yield ending
    except _Signal as ended:
        raise Interrupted(128 + ended.number, ending.outcome) from None
    except (KeyboardInterrupt, typer.Abort):
        # typer turns Ctrl-C at one of its questions into Abort.
        raise Interrupted(INTERRUPTED, ending.outcome) from None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _raise(number: int, _frame: FrameType | None) -> None:
    # A service manager sends both, a closed terminal too: the second must not cut the stop short.
    for ending in _ENDING:
        if signal.getsignal(ending) == _raise:
            signal.signal(ending, signal.SIG_IGN)
    raise _Signal(number)
