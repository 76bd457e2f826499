"""The thread that takes a robot's samples as they come."""

from __future__ import annotations

import threading
from collections.abc import Callable

from wheelwire import BaseDriver, LinkClosed, WheelSample, WheelwireError

SILENCE_S = 0.25
PAUSE_S = 0.05
"""Between two looks at a link that is lost."""
JOIN_S = 2.0


class SampleReader:
    """Reads until `close`.

    Args:
        robot: An open driver.
        on_sample: Called with each sample, in this thread.
        on_change: Called when a silence begins, and before the first sample after one or of
            another boot, in this thread: the session may be another one.
        on_failure: Called with what went wrong here, or in one of those; nothing is read any more.
    """

    def __init__(
        self,
        robot: BaseDriver,
        on_sample: Callable[[WheelSample], None],
        on_change: Callable[[], None],
        on_failure: Callable[[Exception], None],
    ) -> None:
        self.silence: WheelwireError | None = None
        """Why no sample came lately; None while they come."""
        self._robot = robot
        self._on_sample = on_sample
        self._on_change = on_change
        self._on_failure = on_failure
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="wheelwire samples", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread; when this returns, nothing is called any more."""
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
                raise  # nothing will come any more: the node ends, and is started again
            except WheelwireError as error:
                self._note_silence(error)
                boot_id = None
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
