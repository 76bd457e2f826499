"""Samples: the thread that reads them as they arrive, and the rate at which the node publishes."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from wheelwire import (
    BaseDriver,
    LinkClosed,
    RequestTimeout,
    WheelSample,
    WheelwireError,
)

SILENCE_S = 0.25
UNEXPLAINED_S = 1.25
"""Silence after which the cause is no longer waited for: the link finds it sooner."""
LEAST_WAIT_S = 0.001
ENDED = "the robot's samples have ended: configure the node again"
JOIN_S = 2.0
SLOWEST_HZ = 2 / SILENCE_S
"""Lowest sampling rate, at which one lost sample does not count as silence."""


@dataclass
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

    robot: BaseDriver
    on_sample: Callable[[WheelSample], None]
    on_change: Callable[[], None]
    on_failure: Callable[[Exception], None]
    on_silent: Callable[[], None] = lambda: None
    silent_period_s: float = SILENCE_S

    def __post_init__(self) -> None:
        self.silence: WheelwireError | None = None
        """Why no sample has come recently; None while samples come."""
        self._samples = self.robot.samples()
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
            self.on_failure(error)

    def _read(self) -> None:
        boot_id: int | None = None
        heard_s = time.monotonic()
        due_s = heard_s + SILENCE_S  # when to call `on_silent`
        while not self._closing.is_set():
            try:
                sample = self._samples.poll()
            except LinkClosed:
                raise  # for good: the node ends, and its supervisor restarts it
            except (StopIteration, WheelwireError) as end:
                if not self._closing.is_set():
                    self._note_silence(
                        end if isinstance(end, WheelwireError) else LinkClosed(ENDED)
                    )
                return
            if sample is not None:
                # `close` may have been called while it waited: no callback may run any more.
                if self._closing.is_set():
                    return
                self.silence, heard_s = None, time.monotonic()
                due_s = heard_s + SILENCE_S
                if sample.boot_id != boot_id:
                    boot_id = sample.boot_id
                    self.on_change()
                self.on_sample(sample)
            elif (error := self._why_none(due_s)) is not None:
                # The link may be about to find out that it is lost.
                unexplained = isinstance(error, RequestTimeout)
                if not unexplained or time.monotonic() - heard_s > UNEXPLAINED_S:
                    boot_id = None  # the next sample is a change, even of the same boot
                    self._note_silence(error)
                self.on_silent()
                # No burst after a gap.
                due_s = max(due_s + self.silent_period_s, time.monotonic())

    def _why_none(self, until_s: float) -> WheelwireError | None:
        """Wait for a sample; returns why none came."""
        try:
            if not self._samples.wait(max(until_s - time.monotonic(), LEAST_WAIT_S)):
                self.robot.read(LEAST_WAIT_S)  # one that comes now is in the iterator, too
        except LinkClosed:
            # The iterator knows better: of a recording that was replayed it ends.
            if not self._samples.is_ready():
                raise
        except WheelwireError as error:
            return error
        return None

    def _note_silence(self, error: WheelwireError) -> None:
        # Another cause is news as well: a device that is silent at first, and then unplugged.
        is_news, self.silence = str(error) != str(self.silence), error
        if is_news:
            self.on_change()


def sampling_rate_hz(publish_rate_hz: float) -> int:
    """The rate of the robot's samples: a multiple of the requested rate, to thin them evenly."""
    rate_hz = math.ceil(publish_rate_hz)
    return rate_hz * math.ceil(max(1.0, SLOWEST_HZ / rate_hz))
