"""The thread that reads a robot's samples as they arrive."""

from __future__ import annotations

import threading
from collections.abc import Callable

from wheelwire import BaseDriver, LinkClosed, WheelSample, WheelwireError

SILENCE_S = 0.25
PAUSE_S = 0.05
"""Between two attempts to read from a lost link."""
JOIN_S = 2.0


class SampleReader:
    """Reads samples until `close`.

    Args:
        robot: An open driver.
        on_sample: Called with each sample, in this thread.
        on_change: Called in this thread when samples stop coming, and before the first sample after
            that or after a reset of the device: the session may be a new one.
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
        self._on_sample = on_sample
        self._on_change = on_change
        self._on_failure = on_failure
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="wheelwire samples", daemon=True)
        self._thread.start()

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
        while not self._closing.is_set():
            try:
                sample = self._robot.read(SILENCE_S)
            except LinkClosed:
                raise  # for good: the node ends, and its supervisor restarts it
            except WheelwireError as error:
                self._note_silence(error)
                boot_id = None  # the next sample is a change, even of the same boot
                continue
            if self._closing.is_set():
                return
            self.silence = None
            if sample.boot_id != boot_id:
                boot_id = sample.boot_id
                self._on_change()
            self._on_sample(sample)

    def _note_silence(self, error: WheelwireError) -> None:
        began, self.silence = self.silence is None, error
        if began:
            self._on_change()
        self._closing.wait(PAUSE_S)
