"""Samples: the thread that reads them as they arrive, and the rate at which the node publishes."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from wheelwire import BaseDriver, LinkClosed, RequestTimeout, WheelSample, WheelwireError

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
        self._note_heard()
        while not self._closing.is_set():
            try:
                sample = self._samples.poll()
            except LinkClosed:
                raise  # for good: the node ends, and its supervisor restarts it
            except (StopIteration, WheelwireError) as end:
                if not self._closing.is_set():
                    lost = end if isinstance(end, WheelwireError) else LinkClosed(ENDED)
                    self._note_silence(lost)
                return
            if sample is None:
                self._wait()
                continue  # `close` may have been called meanwhile: no callback may run any more
            was_silent, self.silence = self.silence is not None, None
            self._note_heard()
            if was_silent or sample.boot_id != boot_id:
                boot_id = sample.boot_id
                self.on_change()
            self.on_sample(sample)

    def _note_heard(self) -> None:
        self._heard_s = time.monotonic()
        self._due_s = self._heard_s + SILENCE_S
        """When to call `on_silent`."""

    def _wait(self) -> None:
        """Wait for a sample; if none comes, find out why, and call `on_silent` if it is due."""
        left_s = min(self._due_s - time.monotonic(), SILENCE_S)
        try:
            if not self._samples.wait(max(left_s, LEAST_WAIT_S)):
                self.robot.read(LEAST_WAIT_S)  # one that comes now is in the iterator, too
        except LinkClosed:
            # The iterator knows better: of a recording that was replayed it ends.
            if not self._samples.is_ready():
                raise
        except WheelwireError as error:
            now_s = time.monotonic()
            # The link may be about to find out that it is lost.
            if not isinstance(error, RequestTimeout) or now_s - self._heard_s > UNEXPLAINED_S:
                self._note_silence(error)
            if now_s >= self._due_s:
                self.on_silent()
                # No burst after a gap.
                self._due_s = max(self._due_s + self.silent_period_s, now_s)

    def _note_silence(self, error: WheelwireError) -> None:
        # Another cause is news as well: a device that is silent at first, and then unplugged.
        is_news, self.silence = str(error) != str(self.silence), error
        if is_news:
            self.on_change()


def sampling_rate_hz(publish_rate_hz: float) -> int:
    """The rate of the robot's samples: a multiple of the requested rate, to thin them evenly."""
    rate_hz = math.ceil(publish_rate_hz)
    return rate_hz * math.ceil(max(1.0, SLOWEST_HZ / rate_hz))
