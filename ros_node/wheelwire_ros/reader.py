"""Samples: the thread that reads them as they arrive, and the rate at which the node publishes."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable

from wheelwire import (
    BaseDriver,
    LinkClosed,
    LinkLost,
    RequestTimeout,
    WheelSample,
    WheelwireError,
)

SILENCE_S = 0.25
UNEXPLAINED = 4
"""Times of silence after which the cause is no longer waited for: the link finds it sooner."""
PAUSE_S = 0.05
"""Pause between two attempts to read from a lost link."""
LEAST_WAIT_S = 0.001
JOIN_S = 2.0
SLOWEST_HZ = 2 / SILENCE_S
"""Lowest sampling rate, at which one lost sample does not count as silence."""


class SampleReader:
    """Reads samples from `begin` to `close`.

    Args:
        robot: An open driver.
        on_sample: Called with each sample, in this thread, in order.
        on_change: Called in this thread when samples stop coming, when the reason of that is
            another one, and before the first sample after that or after a reset of the device: the
            session may be a new one.
        on_failure: Called with an error of this thread or of those callbacks; reading has ended.
        on_silent: Called in this thread again and again while no sample comes.
        silent_period_s: Time between two of these calls.
    """

    def __init__(
        self,
        robot: BaseDriver,
        on_sample: Callable[[WheelSample], None],
        on_change: Callable[[], None],
        on_failure: Callable[[Exception], None],
        on_silent: Callable[[], None] = lambda: None,
        silent_period_s: float = SILENCE_S,
    ) -> None:
        self.silence: WheelwireError | None = None
        """Why no sample has come recently; None while samples come."""
        self._robot = robot
        self._samples = robot.samples()
        self._on_sample = on_sample
        self._on_change = on_change
        self._on_failure = on_failure
        self._on_silent = on_silent
        self._silent_period_s = silent_period_s
        self._silent_due_s: float | None = None
        """When to call `on_silent` next; None while samples come."""
        self._closing = threading.Event()
        # A daemon: a read that hangs must not keep the process from ending.
        self._thread = threading.Thread(target=self._run, name="wheelwire samples", daemon=True)

    def begin(self) -> None:
        """Begin to read. Harmless when repeated, by one thread at a time."""
        if self._thread.ident is None:
            self._thread.start()

    @property
    def dropped(self) -> int:
        """Samples that this thread did not take within a second."""
        return self._samples.dropped

    def close(self) -> None:
        """End the thread; no callback runs after this returns."""
        self._closing.set()
        if self._thread.ident is not None and self._thread is not threading.current_thread():
            self._thread.join(JOIN_S)

    def _run(self) -> None:
        try:
            self._read()
        except Exception as error:
            self._on_failure(error)

    def _read(self) -> None:
        boot_id: int | None = None
        unexplained = 0
        while not self._closing.is_set():
            try:
                sample = self._next()
            except StopIteration:
                if not self._closing.is_set():
                    ended = "the robot's samples have ended: configure the node again"
                    self._note_silence(LinkClosed(ended))
                return
            except LinkClosed:
                raise  # for good: the node ends, and its supervisor restarts it
            except WheelwireError as error:
                if isinstance(error, RequestTimeout) and unexplained < UNEXPLAINED:
                    unexplained += 1  # the link may be about to find out that it is lost
                    continue
                self._note_silence(error)
                boot_id = None  # the next sample is a change, even of the same boot
                continue
            # `close` may have been called while it waited: no callback may run any more.
            if self._closing.is_set():
                return
            self.silence, self._silent_due_s, unexplained = None, None, 0
            if sample.boot_id != boot_id:
                boot_id = sample.boot_id
                self._on_change()
            self._on_sample(sample)

    def _next(self) -> WheelSample:
        """The next sample; raises the reason if none comes for a while."""
        while True:
            sample = self._samples.poll()
            if sample is not None:
                return sample
            try:
                self._wait()
            except LinkClosed:
                # The iterator knows better: of a recording that was replayed it ends.
                sample = self._samples.poll()
                if sample is None:
                    raise
                return sample

    def _wait(self) -> None:
        """Wait for a sample, which is in the iterator, too; raises the reason if none comes."""
        end_s = time.monotonic() + SILENCE_S
        while True:
            is_silent = self._silent_due_s is not None
            try:
                self._robot.read(self._tell_silence(end_s) if is_silent else SILENCE_S)
            except (LinkLost, RequestTimeout) as error:
                now_s = time.monotonic()
                if not is_silent:
                    self._silent_due_s = now_s
                if isinstance(error, LinkLost) or now_s >= end_s:
                    raise
            else:
                return

    def _tell_silence(self, end_s: float) -> float:
        """Call `on_silent` if it is due; returns for how long to wait, until `end_s` at most."""
        now_s, due_s = time.monotonic(), self._silent_due_s
        if due_s is not None and now_s >= due_s:
            self._on_silent()
            # No burst after a gap.
            due_s = self._silent_due_s = max(due_s + self._silent_period_s, now_s)
        return max(min(end_s, end_s if due_s is None else due_s) - time.monotonic(), LEAST_WAIT_S)

    def _note_silence(self, error: WheelwireError) -> None:
        # Another cause is news as well: a device that is silent at first, and then unplugged.
        is_news, self.silence = str(error) != str(self.silence), error
        if is_news:
            self._on_change()
        end_s = time.monotonic() + PAUSE_S
        while not self._closing.wait(self._tell_silence(end_s)) and time.monotonic() < end_s:
            pass


def sampling_rate_hz(publish_rate_hz: float) -> int:
    """The rate of the robot's samples: a multiple of the requested rate, to thin them evenly."""
    rate_hz = math.ceil(publish_rate_hz)
    return rate_hz * math.ceil(max(1.0, SLOWEST_HZ / rate_hz))
