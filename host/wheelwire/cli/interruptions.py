"""What interrupts a command: Ctrl-C, SIGTERM and SIGHUP, or a lost link.

A signal stops the robot, and the command says what it did. A command waits for a lost link, or ends
and says what to do.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

import typer

from wheelwire.errors import LinkClosed, LinkLost, RequestTimeout, WheelwireError
from wheelwire.robot.robot import Robot
from wheelwire.samples import WheelSample

from . import INTERRUPTED

_ENDING = (signal.SIGTERM, signal.SIGHUP)

SLICE_S = 0.2
"""How long one wait for a sample lasts at most, so that its caller can end in between."""
SILENT_S = 1.0
"""A robot without a sample for this long counts as silent."""


class Interrupted(BaseException):
    """A signal ended the command. The message says what was done by then.

    Not an Exception, so that error handlers do not continue after it.
    """

    def __init__(self, exit_code: int, message: str) -> None:
        super().__init__(message)
        self.exit_code = exit_code


class Ending:
    """The text that the command prints if a signal ends it."""

    def __init__(self) -> None:
        self.outcome = "interrupted before anything was done"

    @contextmanager
    def stops(self, robot: Robot, then: Callable[[], str] = str) -> Iterator[None]:
        """Stop `robot` if a signal ends the block, and report whether it has stopped.

        Args:
            robot: The robot that may be driving.
            then: Returns what else to report, once the block is left.
        """
        try:
            yield
        except (KeyboardInterrupt, typer.Abort, Interrupted):
            self.outcome = "; ".join(filter(None, (stop(robot), then())))
            raise


def stop(robot: Robot) -> str:
    """Stop the robot; returns what to report."""
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
    except Interrupted as ended:
        raise Interrupted(ended.exit_code, ending.outcome) from None
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
    raise Interrupted(128 + number, "")  # an exception, so that all blocks are left in order


def watch(
    robot: Robot,
    until: float,
    now: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> Iterator[WheelSample | str]:
    """The newest samples until `until`, a time of `now`; goes on when a lost link is back.

    It says once that the link was lost, and that it is back before the first sample after that.

    Raises:
        LinkClosed: The driver was closed, or its link has failed for good.
    """
    is_lost = False
    heard = now()
    while (moment := now()) < until:
        try:
            sample = robot.read(min(SLICE_S, until - moment))
        except LinkClosed:
            raise
        except (LinkLost, RequestTimeout) as error:
            silent = isinstance(error, RequestTimeout)
            if not is_lost and (not silent or now() - heard >= SILENT_S):
                is_lost = True
                yield "the robot sends nothing; waiting" if silent else str(error)
            # Some losses are reported at once, and would be asked for again and again.
            sleep(max(0.0, min(SLICE_S, until - now()) - (now() - moment)))
            continue
        heard = now()
        if is_lost:
            is_lost = False
            yield "the link is back"
        yield sample


@contextmanager
def ended_by_a_loss() -> Iterator[None]:
    """Explain that a lost link ends the command, and what to do."""
    try:
        yield
    except LinkLost as error:
        if type(error) is not LinkLost:
            raise  # another board, or closed: its message says what to do
        reason = str(error).partition(";")[0]
        raise LinkLost(
            f"{reason}; the robot stops by itself when its last setpoint expires: check cable and "
            "power, then run the command again"
        ) from error
