"""What a session needs before it is called open: clock, watched parameters, rate. Sans-IO."""

from __future__ import annotations

from collections.abc import Sequence

from wheelwire_protocol.types import ParameterGet, SetStreamRate

from .conversation import Conversation
from .errors import DeviceRefused, WheelwireError
from .lifecycle import Lifecycle, Phase
from .requests import RequestMessage

RETRY_US = 1_000_000
"""Until the next attempt after the device opened a session, but refused what it needs."""


class Preparation:
    """Takes each session from its opening to its use.

    Args:
        lifecycle: Of the session.
        conversation: In it.
        watched: Ids of parameters whose values are read.
        stream_rate_hz: To be asked for; None leaves it as the device has it.
    """

    def __init__(
        self,
        lifecycle: Lifecycle,
        conversation: Conversation,
        watched: Sequence[int],
        stream_rate_hz: int | None,
    ) -> None:
        self._lifecycle = lifecycle
        self._conversation = conversation
        self._watched = tuple(watched)
        self._stream_rate_hz = stream_rate_hz
        self._settled = False
        self._failure: WheelwireError | None = None

    def begin(self, now_us: int) -> None:
        """A session was opened: ask for what it needs, while the clock is being read."""
        self._settled = False
        self._failure = None
        self._conversation.requests.submit_all(self._requests(), self._done, now_us)

    def advance(self, now_us: int) -> None:
        """Open the session for use once all is there; give it up when something is refused."""
        lifecycle = self._lifecycle
        if lifecycle.phase is not Phase.PREPARING or not self._settled:
            return
        if self._failure is not None:
            refused = isinstance(self._failure, DeviceRefused)
            lifecycle.greet(self._failure, now_us, RETRY_US if refused else 0)
        elif self._conversation.synchroniser.ready:
            lifecycle.phase = Phase.OPEN

    def _done(self, failure: WheelwireError | None) -> None:
        self._settled = True
        self._failure = failure

    def _requests(self) -> list[RequestMessage]:
        session = self._lifecycle.session_id
        requests: list[RequestMessage] = [ParameterGet(session, 0, id_) for id_ in self._watched]
        if self._stream_rate_hz is not None:
            requests.append(SetStreamRate(session, 0, self._stream_rate_hz))
        return requests
