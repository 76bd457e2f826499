"""What a session asks the device by itself: what it needs to be open, the board, the sensors.

The stream rate and the settings are set, the watched parameters read, and the device's board
compared with the expected one, if there is one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from wheelwire_protocol.codec import schema_hash
from wheelwire_protocol.codes import Capability, Group
from wheelwire_protocol.types import (
    ConfigurationGet,
    GroupGet,
    GroupInfo,
    ParameterGet,
    ParameterSet,
    SensorStream,
    SetStreamRate,
)

from ..errors import WheelwireError
from .device_reports import DeviceReports
from .info import DeviceInfo, ExpectedBoard
from .requests import Answer, Done, RequestMessage, RequestQueue

if TYPE_CHECKING:
    from .sensor_stream import SensorStream as Sensors


class Preparation:
    """The requests of a session's own.

    Args:
        requests: Where they go.
        reported: Has the watched parameters, the board, and the sensors' rate.
        settings: Parameter id -> the value that the device is given whenever a session opens.
        stream_rate_hz: Rate of the state frames; None keeps the device's own.
        expected_board: The board that the device has to be on; on another one no session opens.

    Attributes:
        failure: Of the first request that failed without which the session cannot open.
        questions: How many others are open; what follows from an answer is a new one.
    """

    def __init__(
        self,
        requests: RequestQueue,
        reported: DeviceReports,
        settings: Mapping[int, float],
        stream_rate_hz: int | None,
        expected_board: ExpectedBoard | None,
    ) -> None:
        self.failure: WheelwireError | None = None
        self.questions = 0
        self.settings = dict(settings)
        self.stream_rate_hz = stream_rate_hz
        self.expected_board = expected_board
        self._requests = requests
        self._reported = reported
        self._needed = 0
        """Requests without which the session cannot open, and that are not answered yet."""
        self._asks_for_board = False
        """Until the device has said which board it is on, or that it cannot tell."""

    @property
    def is_complete(self) -> bool:
        """Whether the session can open, as far as its own requests are concerned."""
        return not (self._needed or (self.expected_board is not None and self._asks_for_board))

    def begin(self, session_id: int, device: DeviceInfo, now_us: int) -> None:
        """The device has opened a session: send what prepares it."""
        # Settings before watched values: what is read then is what is active.
        needed: list[RequestMessage] = [
            ParameterSet(session_id, 0, id_, value) for id_, value in self.settings.items()
        ]
        needed += [ParameterGet(session_id, 0, id_) for id_ in self._reported.watched]
        if self.stream_rate_hz is not None:
            needed.append(SetStreamRate(session_id, 0, self.stream_rate_hz))
        self._needed = len(needed)
        self.failure = None
        for message in needed:
            self._requests.submit(message, self._on_needed, now_us)
        self._ask_for_board(session_id, device, now_us)

    def _on_needed(self, answer: Answer | WheelwireError) -> None:
        self._needed -= 1
        if isinstance(answer, WheelwireError) and self.failure is None:
            self.failure = answer

    def _ask_for_board(self, session_id: int, device: DeviceInfo, now_us: int) -> None:
        """Ask for the device's board; the session needs the answer only if it expects one."""
        # Only a device that restarts when asked can have another board.
        self._asks_for_board = Capability.RESTART in device.capabilities

        def end(_: Answer | WheelwireError) -> None:
            self._asks_for_board = False

        # If the board stays the same, only a program that uses the sensors needs it.
        sensors = self._reported.sensors_if_asked
        if sensors is not None and not sensors.rate_hz:
            sensors = None
        if self._asks_for_board or sensors is not None:
            # The answer is recorded like every other one.
            self._ask_for_group(Group.CONFIGURATION, ConfigurationGet(session_id, 0), end, now_us)
        if sensors is not None:
            question = _sensor_request(sensors, session_id)
            self._ask_for_group(Group.SENSOR, question, lambda _: None, now_us)

    def ask_for_sensors(self, sensors: Sensors, session_id: int, now_us: int) -> None:
        """Ask again what the sensors are."""
        self._ask(_sensor_request(sensors, session_id), lambda _: None, now_us)

    def _ask_for_group(
        self, group: Group, question: RequestMessage, done: Done, now_us: int
    ) -> None:
        """Ask `question`, if the device means the same by the messages of that group."""

        def take_group(answer: Answer | WheelwireError) -> None:
            # A device of another release may mean something else by them.
            if isinstance(answer, GroupInfo) and answer.hash == schema_hash(group):
                self._ask(question, done, now_us)
            else:
                done(answer)

        self._ask(GroupGet(question.session_id, 0, group), take_group, now_us)

    def _ask(self, message: RequestMessage, done: Done, now_us: int) -> None:
        self.questions += 1

        def take(answer: Answer | WheelwireError) -> None:
            done(answer)
            # After it: what it asks for next is counted before another thread finds zero.
            self.questions -= 1

        self._requests.submit(message, take, now_us)


def _sensor_request(sensors: Sensors, session_id: int) -> SensorStream:
    """As the application asked before, in this session or in an earlier one."""
    sensors.due_us = None
    return SensorStream(session_id, 0, sensors.rate_hz)
