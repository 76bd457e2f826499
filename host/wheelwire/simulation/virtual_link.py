"""A link to a simulated device in virtual time, which passes only while something waits."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from wheelwire_protocol.codes import StopMode

from ..errors import LinkClosed, LinkLost, RequestTimeout, WheelwireError
from ..link.connection import LinkInfo, SessionView
from ..link.info import LinkStatistics
from ..link.latest_sample import LatestSample
from ..link.news import Happening, Listener
from ..link.requests import Answer, Done, RequestMessage
from ..link.session import Phase, Session
from .library import FwSim

_log = logging.getLogger("wheelwire.link")

STEP_US = 1000
OPEN_S = 5.0


class VirtualLink(SessionView):
    """The host's end of a simulated line, for one thread.

    Args:
        latest_sample: Receives the samples.
        sim: The device; the link closes it.
        watched: Ids of parameters whose values `value` always has.

    Attributes:
        now_us: The host's time, starting at 0.
    """

    def __init__(
        self, latest_sample: LatestSample, sim: FwSim, watched: Sequence[int] = ()
    ) -> None:
        self.now_us = 0
        self._latest_sample = latest_sample
        latest_sample.now_us = lambda: self.now_us
        self._sim = sim
        self._session = Session(lambda: int.from_bytes(os.urandom(4), "little"), None, watched)
        self._plugged = False
        # The first connection, in `plug` below, is no reconnection.
        self._reconnects = -1
        self._end: LinkClosed | None = None
        self._listener: Listener | None = None

    def open(self) -> None:
        """Plug the cable in for the first time, and open a session."""
        self.plug()
        self._pass_until(lambda: self._session.phase is Phase.OPEN, OPEN_S)
        self._check_alive()

    # --- time and the cable --------------------------------------------------------------------

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self._step()

    def unplug(self) -> None:
        """Pull the cable: the device keeps running."""
        self._plugged = False
        self._session.disconnect(LinkLost("the cable of the simulated robot is unplugged"))
        self._latest_sample.interrupt()
        self._tell_listener()

    def plug(self) -> None:
        """Plug the cable in again."""
        self._plugged = True
        self._reconnects += 1
        self._session.connect(self.now_us)

    # --- as for every link ------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Name for messages."""
        return "mock"

    @property
    def info(self) -> LinkInfo:
        """The port and the device."""
        device = self._session.device
        if device is None:
            raise self._session.error
        return LinkInfo("mock", None, None, device, self._session.board)

    @property
    def statistics(self) -> LinkStatistics:
        """Counters since the link was opened."""
        return replace(self._session.statistics(self.now_us), reconnects=self._reconnects)

    def listen(self, listener: Listener, happening: Happening) -> None:
        """As `Link.listen`."""
        self._listener = listener
        standing = self._session.standing_news(happening)
        if standing is not None:
            listener(standing)

    def drive_velocity(self, left_mps: float, right_mps: float, expiry_us: int) -> None:
        """Send one velocity setpoint that expires at `expiry_us`."""
        self.check()
        make = self._session.setpoints.velocity_frame
        self._flush(make(left_mps, right_mps, expiry_us, self.now_us))

    def drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        """Send one duty setpoint that expires at `expiry_us`."""
        self.check()
        self._flush(self._session.setpoints.duty_frame(left, right, expiry_us, self.now_us))

    def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer."""
        return self._answer(partial(self.post, message))

    def post(self, message: RequestMessage, done: Done) -> None:
        """Send a request without waiting; `done` is called with the result."""
        self._check_alive()
        self._session.request(message, done, self.now_us)

    def stop(self, mode: StopMode = StopMode.CONFIGURED) -> None:
        """Stop and wait for the acknowledgement."""
        self._answer(partial(self.post_stop, mode=mode))

    def post_stop(self, done: Done, mode: StopMode = StopMode.CONFIGURED) -> None:
        """As `stop`, without waiting."""
        self._check_alive()
        self._session.stop(mode, done, self.now_us)

    def estop(self) -> None:
        """Stop, latch and wait for the acknowledgement."""
        self._answer(self.post_estop)

    def post_estop(self, done: Done) -> None:
        """As `estop`, without waiting."""
        self._check_alive()
        self._session.estop(done, self.now_us)

    def withdraw(self, done: Done) -> None:
        """As `Link.withdraw`."""
        self._session.withdraw(done)

    @property
    def has_ended(self) -> bool:
        """The link is down for good."""
        return self._end is not None

    def close(self) -> None:
        """Stop the robot and switch it off. Safe to call more than once."""
        if self._end is not None:
            return
        if self._session.phase is Phase.OPEN:
            # One step takes the stop to the device, whose answer nobody waits for.
            self._session.stop(StopMode.CONFIGURED, lambda _: None, self.now_us)
            self._step()
        elif self._session.setpoints.moves_until_us > self.now_us:
            _log.warning("mock: closed while the robot drives and cannot be reached")
        self._end = LinkClosed("the link is closed; open it again")
        self._session.disconnect(self._end)
        self._latest_sample.fail(self._end)
        self._sim.close()

    # -------------------------------------------------------------------------------------------

    def _step(self) -> None:
        """Advance one millisecond: the host first, then the device."""
        self._check_alive()
        self._session.advance(self.now_us)
        self._flush()
        self._sim.advance_us(STEP_US)
        self.now_us += STEP_US
        # Taken while the cable is unplugged, too: what the device sends then is lost.
        arrived = self._sim.read()
        if self._plugged:
            for measurement in self._session.receive(arrived, self.now_us):
                self._latest_sample.put(measurement)
            if self._session.phase is not Phase.OPEN:
                self._latest_sample.interrupt()  # the device was reset, or has fallen silent
            self._latest_sample.notify_all()
        # Last: what is called may let time pass, or close the link.
        self._tell_listener()

    def _flush(self, setpoint: bytes = b"") -> None:
        """Write what waits, and a setpoint behind it."""
        output = self._session.take_output()
        if self._plugged:
            self._sim.write(output + setpoint)

    def _tell_listener(self) -> None:
        news = self._session.news
        while news:
            happened = news.popleft()
            if self._listener is not None:
                self._listener(happened)

    def _answer(self, post: Callable[[Done], None]) -> Answer:
        replies: list[Answer | WheelwireError] = []
        done = replies.append
        post(done)
        try:
            self._pass_until(lambda: bool(replies), OPEN_S)
        except RequestTimeout:
            self._session.withdraw(done)
            raise
        reply = replies[0]
        if isinstance(reply, WheelwireError):
            raise reply.with_traceback(None)
        return reply

    def _pass_until(self, condition: Callable[[], bool], timeout_s: float) -> None:
        end_us = self.now_us + round(timeout_s * 1e6)
        while not condition():
            if self.now_us > end_us:
                raise RequestTimeout("the simulated robot does not answer")
            self._step()

    def _check_alive(self) -> None:
        if self._end is not None:
            raise self._end.with_traceback(None)
