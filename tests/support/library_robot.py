"""The core as a library in virtual time, with a host, and with ticks that a test sets."""

from __future__ import annotations

from typing import TypeVar

from wheelwire_protocol.codes import Chip, ResetReason
from wheelwire_protocol.core import Core, Identity, Outputs

from .host_samples import received
from .virtual_host import VirtualHost

Self = TypeVar("Self", bound="LibraryRobot")


class LibraryRobot(VirtualHost):
    """A robot whose ticks a test sets."""

    def __init__(self, core: Core | None = None) -> None:
        super().__init__(1)
        identity = Identity(0x1234, Chip.LINUX, 7, ResetReason.POWER_ON)
        self.core = core or Core(identity, save=lambda _block: True)
        self.now_us = 1_000_000
        self.left_ticks = 0
        self.right_ticks = 0
        self.contact_open = False
        self.illegal = (0, 0)
        self.outputs: Outputs

    def start(self: Self) -> Self:
        self.outputs = self.core.start(self.now_us, self.left_ticks, self.right_ticks)
        return self

    def open(self: Self) -> Self:
        """Start it, and open a session."""
        return self.start().connect()

    def connect(self: Self) -> Self:
        """Open a session."""
        return super().open()

    def step(self) -> Outputs:
        """One control step."""
        self.session.advance(self.now_us)
        self.write()
        self.now_us += self.outputs.period_us
        self.outputs = self.core.step(
            self.now_us,
            self.left_ticks,
            self.right_ticks,
            contact_open=self.contact_open,
            left_illegal=self.illegal[0],
            right_illegal=self.illegal[1],
        )
        self.receive(self.core.take())
        return self.outputs

    def receive(self, data: bytes) -> None:
        """What the core has sent in a step."""
        self.samples += received(self.session, data, self.now_us)

    def write(self, setpoint: bytes = b"") -> None:
        """As the base's."""
        self.core.feed(self.session.take_output() + setpoint)
