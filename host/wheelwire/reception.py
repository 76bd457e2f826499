"""What arrives: each message to whom it concerns, and none that is not ours. Sans-IO."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import groupby
from typing import cast

from wheelwire_protocol.codes import RefusalCode
from wheelwire_protocol.types import (
    Ack,
    AnyMessage,
    ControlCounters,
    DeviceHello,
    Event,
    LinkCounters,
    ParameterEntry,
    ParameterValue,
    Pong,
    Refuse,
    WheelState,
)

from .conversation import Conversation
from .errors import LinkLost
from .lifecycle import Lifecycle, Phase
from .message_stream import MessageStream
from .requests import Answer
from .samples import WheelSample
from .statistics import Tally


class Reception:
    """Takes bytes from the line.

    Args:
        stream: Makes messages of them.
        lifecycle: Knows which session a message must belong to.
        conversation: Takes those that do.
        tally: Counts the others.
    """

    def __init__(
        self,
        stream: MessageStream,
        lifecycle: Lifecycle,
        conversation: Conversation,
        tally: Tally,
    ) -> None:
        self._stream = stream
        self._lifecycle = lifecycle
        self._conversation = conversation
        self._tally = tally
        self._handlers: dict[type[AnyMessage], Callable[..., None]] = {
            DeviceHello: lifecycle.on_hello,
            Pong: self._on_pong,
            Event: self._on_event,
            Refuse: self._on_refuse,
            Ack: self._on_answer,
            ParameterValue: self._on_answer,
            ParameterEntry: self._on_answer,
            LinkCounters: self._on_answer,
            ControlCounters: self._on_answer,
        }

    def take(self, data: bytes, now_us: int) -> list[WheelSample]:
        """Handle what has arrived; returns new samples, of state frames in a row the newest."""
        samples = []
        for kind, messages in groupby(self._stream.receive(data), type):
            if kind is WheelState:
                sample = self._on_states(cast("Iterator[WheelState]", messages), now_us)
                if sample is not None:
                    samples.append(sample)
            else:
                for message in messages:
                    self._handle(message, now_us)
        return samples

    def _handle(self, message: AnyMessage, now_us: int) -> None:
        handler = self._handlers.get(type(message))
        if handler is None:
            self._tally.foreign += 1  # a message of the host's own kind: an echo
        else:
            handler(message, now_us)

    def _on_pong(self, pong: Pong, now_us: int) -> None:
        if self._lifecycle.is_ours(pong.session_id, now_us):
            self._conversation.on_pong(pong, now_us)

    def _on_states(self, states: Iterator[WheelState], now_us: int) -> WheelSample | None:
        lifecycle = self._lifecycle
        ours = [
            state
            for state in states
            if lifecycle.is_this_boot(state.boot_id, now_us) and lifecycle.phase is Phase.OPEN
        ]
        return self._conversation.on_states(ours, now_us) if ours else None

    def _on_event(self, event: Event, now_us: int) -> None:
        if self._lifecycle.is_this_boot(event.boot_id, now_us):
            self._conversation.on_event(event)

    def _on_refuse(self, refuse: Refuse, now_us: int) -> None:
        if not self._lifecycle.is_ours(refuse.session_id, now_us):
            return
        self._tally.refused += 1
        if refuse.code == RefusalCode.NO_SESSION:
            error = LinkLost("the device no longer knows this session; opening a new one")
            self._lifecycle.greet(error, now_us)
        else:
            self._conversation.on_refuse(refuse, now_us)

    def _on_answer(self, answer: Answer, now_us: int) -> None:
        if self._lifecycle.is_ours(answer.session_id, now_us):
            self._conversation.on_answer(answer, now_us)
