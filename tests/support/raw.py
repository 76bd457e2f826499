"""A host that sends exactly what a test says, to firmware in virtual time."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from wheelwire.simulation.libfwsim import FwSim
from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.types import AnyMessage, DeviceHello, Hello, Ping, WheelState

M = TypeVar("M")
NONCE = 0x12345678
ARMING_MS = 1010
"""More than rearm_gap_s and ttl_max_s by default."""


class RawHost:
    """Sends and receives frames, and does nothing else by itself.

    Args:
        seed: Seed of the simulated firmware.
        store: Its file of saved parameters.
    """

    def __init__(self, seed: int = 1, store: Path | None = None) -> None:
        self.sim = FwSim(seed, store)
        self.encoder = Encoder()
        self.decoder = Decoder()
        self.received: list[AnyMessage] = []
        self.boot_id = 0
        self.run_ms(100)  # the device starts

    @property
    def session_id(self) -> int:
        """Id of the session that `open` opened."""
        return NONCE ^ self.boot_id

    def send(self, *messages: AnyMessage) -> None:
        """Put frames on the line."""
        for message in messages:
            self.sim.write(self.encoder.encode(message))

    def run_ms(self, milliseconds: int) -> None:
        """Let time pass and collect the device's messages."""
        for _ in range(milliseconds):
            self.sim.advance_us(1000)
            self.received += self.decoder.feed(self.sim.read())

    def ask(self, message: AnyMessage, answer: type[M]) -> M:
        """Send, wait 5 ms, and return the one answer of that type."""
        self.received.clear()
        self.send(message)
        self.run_ms(5)
        (found,) = self.of(answer)
        return found

    def of(self, kind: type[M]) -> list[M]:
        """The received messages of one type."""
        return [message for message in self.received if isinstance(message, kind)]

    def hello(self, nonce: int = NONCE) -> DeviceHello:
        """Send a Hello with our own version and schema."""
        return self.ask(Hello(nonce, PROTOCOL_VERSION, schema_hash()), DeviceHello)

    def open(self) -> RawHost:
        """Open a session, synchronise the clock, and pause for as long as it takes to be armed."""
        self.connect()
        self.run_ms(ARMING_MS)
        return self

    def connect(self) -> RawHost:
        """As `open`, without the pause: what comes next must be a zero setpoint."""
        self.boot_id = self.hello().boot_id
        self.send(Ping(self.session_id, 1, 0))
        self.run_ms(5)
        return self

    def reset(self) -> None:
        """Reset the device, and open a session of its new boot."""
        self.sim.reset()
        self.run_ms(100)
        self.open()

    @property
    def device_us(self) -> int:
        """The device's clock."""
        return int(self.sim.get("device_us"))

    def state(self) -> WheelState:
        """The newest state frame of the next 20 ms."""
        self.received.clear()
        self.run_ms(20)
        return self.of(WheelState)[-1]
