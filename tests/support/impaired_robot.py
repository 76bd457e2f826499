"""The host's session and the firmware's core with a bad line between them, in virtual time."""

from __future__ import annotations

from wheelwire.errors import LinkLost
from wheelwire.simulation.bad_line import ImpairedLine, LineEvent, LineProfile

from .host_samples import received
from .virtual import STEP_US, VirtualRobot


class ImpairedVirtualRobot(VirtualRobot):
    """A `VirtualRobot` whose line is impaired by a profile and whose host can be suspended.

    Attributes:
        host_runs: False: the host neither reads nor writes, as if killed or stopped.
        resets: Of the device, so far.
        unplugs: Of the cable, so far.
    """

    def __init__(
        self, seed: int = 1, profile: LineProfile | None = None, /, **settings: float
    ) -> None:
        super().__init__(seed, **settings)
        self.line = ImpairedLine(profile or LineProfile(seed=seed))
        self.host_runs = True
        self.resets = 0
        self.unplugs = 0
        self._plugged = True

    def step(self, most_us: int = STEP_US) -> None:  # noqa: ARG002 - the line moves at any time
        """Advance one millisecond: the line first, then the host, then the device."""
        for event in self.line.advance(self.now_us):
            self._obey(event)
        if self.host_runs:
            self.session.advance(self.now_us)
            self.write()
        for piece in self.line.to_device.take(self.now_us):
            self.sim.write(piece)
        self.sim.advance_us(STEP_US)
        self.now_us += STEP_US
        sent = self.sim.read()
        if self._plugged:
            self.line.to_host.send(sent, self.now_us)
        for piece in self.line.to_host.take(self.now_us):
            if self.host_runs:
                self.samples += received(self.session, piece, self.now_us)

    def reset(self) -> None:
        """Restart the chip."""
        self.resets += 1
        self.sim.reset()

    def unplug(self) -> None:
        """Pull the cable; bytes in transit are lost."""
        self._plugged = False
        self.unplugs += 1
        self.line.clear()
        self.session.disconnect(LinkLost("unplugged"))

    def plug(self) -> None:
        """Plug the cable in again."""
        self._plugged = True
        self.session.connect(self.now_us)

    def write(self, setpoint: bytes = b"") -> None:
        """As the base's."""
        self.line.to_device.send(self.session.take_output() + setpoint, self.now_us)

    def _obey(self, event: LineEvent) -> None:
        if event is LineEvent.RESET:
            self.reset()
        elif event is LineEvent.UNPLUG:
            self.unplug()
        else:
            self.plug()
