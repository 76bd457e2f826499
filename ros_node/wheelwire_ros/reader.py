"""The thread that reads a robot's samples as they arrive."""

from __future__ import annotations

import threading
from collections.abc import Callable

from wheelwire import BaseDriver, LinkClosed, RequestTimeout, WheelSample, WheelwireError

SILENCE_S = 0.25
UNEXPLAINED = 4
"""Times of silence after which the cause is no longer waited for: the link finds it sooner."""
PAUSE_S = 0.05
"""Between two attempts to read from a lost link."""
JOIN_S = 2.0


class SampleReader:
    """Reads samples until `close`.

    Args:
        robot: An open driver.
        on_sample: Called with each sample, in this thread, in order.
        on_change: Called in this thread when samples stop coming, when the reason of that is
            another one, and before the first sample after that or after a reset of the device: the
            session may be a new one.
        on_failure: Called with an error of this thread or of those callbacks; reading has ended.
    """

    def __init__(
        self,
        robot: BaseDriver,
        on_sample: Callable[[WheelSample], None],
        on_change: Callable[[], None],
        on_failure: Callable[[Exception], None],
    ) -> None:
        self.silence: WheelwireError | None = None
        """Why no sample has come recently; None while they come."""
        self._robot = robot
        self._samples = robot.samples()
        self._on_sample = on_sample
        self._on_change = on_change
        self._on_failure = on_failure
        self._closing = threading.Event()
        # A daemon: a read that hangs must not keep the process from ending.
        self._thread = threading.Thread(target=self._run, name="wheelwire samples", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """Samples that this thread did not take within a second."""
        return self._samples.dropped

    def close(self) -> None:
        """End the thread; no callback runs after this returns."""
        self._closing.set()
        if self._thread is not threading.current_thread():
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
            self.silence, unexplained = None, 0
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
            self._robot.read(SILENCE_S)  # only waits: each sample is in the iterator, too

    def _note_silence(self, error: WheelwireError) -> None:
        # Another cause is news as well: a device that is silent at first, and then unplugged.
        is_news, self.silence = str(error) != str(self.silence), error
        if is_news:
            self._on_change()
        self._closing.wait(PAUSE_S)
