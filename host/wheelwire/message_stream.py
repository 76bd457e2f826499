"""Messages over a byte stream, both ways, across every loss of the port. Sans-IO."""

from __future__ import annotations

from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import Counters, Encoder
from wheelwire_protocol.types import AnyMessage


class MessageStream:
    """Messages in, bytes out; and back."""

    def __init__(self) -> None:
        self.frames_sent = 0
        self.bytes_received = 0
        self._encoder = Encoder()
        self._decoder = Decoder()
        self._output = bytearray()

    @property
    def counters(self) -> Counters:
        """Of what was received, since the start."""
        return self._decoder.counters

    def restart(self) -> None:
        """The port was opened: sequence numbers start anew, and what waited is void."""
        self._encoder = Encoder()
        self._decoder.restart()
        self._output.clear()

    def restart_sequence(self) -> None:
        """What is received next need not follow what was received last."""
        self._decoder.restart_sequence()

    def send(self, message: AnyMessage) -> None:
        """Put a message into the output."""
        self._output += self._encoder.encode(message)
        self.frames_sent += 1

    def take_output(self) -> bytes:
        """The bytes to send, once."""
        output = bytes(self._output)
        self._output.clear()
        return output

    def discard_output(self) -> None:
        """What waits is void."""
        self._output.clear()

    def receive(self, data: bytes) -> list[AnyMessage]:
        """The messages that the bytes complete."""
        self.bytes_received += len(data)
        return self._decoder.feed(data)
