"""A link to a simulated device in virtual time, which passes only while something waits."""

from __future__ import annotations

from collections.abc import Sequence

from wheelwire_protocol.codes import StopMode

from ..errors import LinkClosed, LinkLost, RequestTimeout
from ..link import LINK_LOG
from ..link.device_link import InlineLink, arming
from ..link.requests import Done, RequestMessage
from ..link.sample_stream import LatestSample
from ..link.session import Phase, Session, random_nonce
from ..link.statistics import LinkStatistics
from ..link.traffic import Kind, TrafficReader
from .libfwsim import FwSim

STEP_US = 1000
OPEN_S = 5.0


class VirtualLink(InlineLink):
    """The host's end of a simulated line, for one thread.

    Args:
        latest_sample: Receives the samples.
        sim: The device; the link closes it.
        watched: Ids of parameters whose values `value` always has.
    """

    in_virtual_time = True
    now_us = 0
    """The host's time, starting at 0."""
    output = b""
    frames = ()
    _end: LinkClosed | None = None

    def __init__(
        self, latest_sample: LatestSample, sim: FwSim, watched: Sequence[int] = ()
    ) -> None:
        self._latest_sample = latest_sample
        latest_sample.now_us = lambda: self.now_us
        latest_sample.wait_for = self.wait_for
        self.simulator = sim
        self._session = Session(random_nonce, None, watched)
        self.reported = self._session.reported
        self._drive_through(self)
        self._plugged = False
        # The first connection, in `plug` below, is not a reconnection.
        self._reconnects = -1

    def open(self) -> None:
        """Plug the cable in for the first time, and open a session."""
        self.plug()
        if not self.wait_for(lambda: self._session.knows_device, OPEN_S):
            raise RequestTimeout(
                "the simulated robot does not answer: install one release of all parts"
            )
        self._check_alive()
        if self.arms:
            for ready, timeout_s in arming(self, self._session):
                self.wait_for(ready, timeout_s)

    # --- time and the cable --------------------------------------------------------------------

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self._step(end_us - self.now_us)

    def unplug(self) -> None:
        """Pull the cable: the device keeps running."""
        self._plugged = False
        self._session.disconnect(
            LinkLost("the cable of the simulated robot is unplugged", causes=("cable_pulled",))
        )
        self._latest_sample.interrupt()
        self._tell_listener()

    def plug(self) -> None:
        """Plug the cable in again."""
        self._plugged = True
        self._reconnects += 1
        self._session.connect(self.now_us)

    def _pass(self, most_us: int) -> None:
        self._step(most_us)

    # --- as for every link ------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Name for messages."""
        return "mock"

    @property
    def statistics(self) -> LinkStatistics:
        """Counters since the link was opened."""
        return self._session.statistics(self.now_us, self._reconnects)

    def listen_to_traffic(self, reader: TrafficReader) -> None:
        """As `Link.listen_to_traffic`; everything asked for afterwards is passed on."""
        self._session.listen(reader, self.now_us)
        # It begins once the session knows its board; until then virtual time has to pass.
        self.wait_for(lambda: reader in self.traffic.readers, OPEN_S)

    def clock_ns(self) -> int:
        """The host's time."""
        return self.now_us * 1000

    def check_room(self) -> None:
        """The line takes any setpoint."""

    def send(self, frame: bytes, now_us: int) -> None:  # noqa: ARG002 - that of the link
        """Write a setpoint's frame, behind what waits."""
        self._flush(frame)

    def post(self, message: RequestMessage, done: Done) -> None:
        """Send a request without waiting; `done` is called with the result."""
        self._check_alive()
        self._session.request(message, done, self.now_us)

    def post_stop(self, done: Done, mode: StopMode | None = StopMode.CONFIGURED) -> None:
        """As `stop`, without waiting."""
        self._check_alive()
        self._session.stop(mode, done, self.now_us)

    def withdraw(self, done: Done) -> None:
        """As `Link.withdraw`."""
        self._session.withdraw(done)

    def close(self) -> None:
        """Stop the robot and switch it off. Safe to call more than once."""
        if self._end is not None:
            return
        if self._session.phase is Phase.OPEN:
            # One step takes the stop to the device; nothing waits for the answer.
            self._session.stop(StopMode.CONFIGURED, lambda _: None, self.now_us)
            self._step()
        elif self._session.setpoints.moves_until_us > self.now_us:
            LINK_LOG.warning("mock: closed while the robot drives and cannot be reached")
        self._end = LinkClosed("the link is closed; open it again")
        self._session.disconnect(self._end)
        self._latest_sample.fail(self._end)
        self.simulator.close()

    # -------------------------------------------------------------------------------------------

    def _step(self, most_us: int = STEP_US) -> None:
        """Advance to the next whole millisecond in which something happens: host, then device."""
        self._check_alive()
        due_us = self._session.next_deadline_us
        if due_us is None or self.now_us >= due_us:
            self._session.advance(self.now_us)
            due_us = self._session.next_deadline_us
        self._flush()
        if due_us is not None:
            most_us = min(most_us, due_us - self.now_us)
        self.now_us += self.simulator.advance_to_bytes(STEP_US, most_us)
        # Taken while the cable is unplugged, too: what the device sends then is lost.
        arrived = self.simulator.read()
        if self._plugged:
            if arrived:
                for measurement in self._session.receive(arrived, self.now_us):
                    self._latest_sample.put(measurement)
                self._latest_sample.sensors.take(self.name, self._session.sensors.sensed)
            if self._session.phase is not Phase.OPEN:
                self._latest_sample.interrupt()  # the device was reset, or has fallen silent
            self._latest_sample.notify_all()
        # Last: what is called may let time pass, or close the link.
        self._tell_listener()

    def _flush(self, setpoint: bytes = b"") -> None:
        """Write what waits, and a setpoint behind it."""
        output = self._session.take_output()
        if self._plugged and (output or setpoint):
            self.simulator.write(output + setpoint)
            self.traffic.put(Kind.SENT, self.now_us, output + setpoint)
