"""The options of every link, and of a serial port; those of pins are in `pin_options`.

Sections of a robot's file are `SerialOptions`, `GpioOptions` and `PigpioOptions`; each driver takes
one of them as its arguments, and the file's keys outside the section.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

from wheelwire_protocol.parameters import PARAMETER_BY_NAME

from ..arguments import flag, text, timeout_s, whole
from ..errors import InvalidArgument, shown
from ..link.connection import CONNECT_TIMEOUT_S, LinkOptions
from ..link.info import ExpectedBoard
from ..link.port_loop import OpenPort
from ..link.ports import port_name
from ..robot.verbs import WATCHED

if TYPE_CHECKING:
    from ..board import Configuration

DEFAULT_BAUD_RATE = 921_600
MAX_BAUD_RATE = 20_000_000
"""No adapter is faster."""
MAX_STREAM_RATE_HZ = 65_535
"""The largest value of the field. Each device has a lower limit, which its line sets."""

P = ParamSpec("P")
_Options = TypeVar("_Options")


def takes(
    options: Callable[P, _Options],
) -> Callable[[Callable[[Any, _Options], None]], Callable[Concatenate[Any, P], None]]:
    """For a driver's `__init__`: its arguments are the fields of `options`."""

    def with_options(
        init: Callable[[Any, _Options], None],
    ) -> Callable[Concatenate[Any, P], None]:
        @wraps(init)
        def with_fields(self: Any, /, *args: P.args, **kwargs: P.kwargs) -> None:
            init(self, options(*args, **kwargs))

        own = Parameter("self", Parameter.POSITIONAL_ONLY)
        fields = signature(options).parameters.values()
        with_fields.__signature__ = Signature([own, *fields])  # type: ignore[attr-defined]
        return with_fields

    return with_options


@dataclass(frozen=True, kw_only=True)
class DeviceOptions:
    """The options of every link to a device; see `TransportDriver` and `SerialDriver`."""

    baud_rate: int = 0
    connect_timeout: float = CONNECT_TIMEOUT_S
    stream_rate_hz: int | None = None
    board_id: str | None = None
    any_board: bool = False
    tap: bool = True

    def link_to(
        self,
        name: str,
        open_port: OpenPort | None = None,
        *,
        board: str | Path | Configuration | None = None,
        parameters: Mapping[str, float] | None = None,
    ) -> LinkOptions:
        """The link to a port, or to what `open_port` opens; these options are checked."""
        rate_hz, board_id = self.stream_rate_hz, self.board_id
        if rate_hz is not None:  # 0 is off on the wire, but a driver needs samples
            rate_hz = whole("stream_rate_hz", rate_hz, 1, MAX_STREAM_RATE_HZ)
        if board_id is not None:
            if not isinstance(board_id, str) or not re.fullmatch("[0-9a-fA-F]{12}", board_id):
                raise InvalidArgument(
                    f"board_id = {shown(board_id)}: give its 12 hex digits, as `wheelwire info` "
                    "shows them"
                )
            board_id = board_id.lower()  # as `DeviceInfo` writes it: ids are compared as text
        # Both are checked by what most programs need for nothing else.
        expected = None if board is None else _expected(board)
        settings = None if parameters is None else _settings(parameters)
        return LinkOptions(
            name,
            baud_rate=whole("baud_rate", self.baud_rate, 0, MAX_BAUD_RATE),
            connect_timeout_s=timeout_s("connect_timeout", self.connect_timeout),
            stream_rate_hz=rate_hz,
            watched=WATCHED,
            board_id=board_id,
            any_board=flag("any_board", self.any_board),
            settings=settings,
            expected_board=expected,
            open_port=open_port,
            tap=flag("tap", self.tap),
        )


@dataclass(frozen=True)
class SerialOptions(DeviceOptions):
    """The section `serial` of a robot's file."""

    port: str = "/dev/ttyUSB0"
    baud_rate: int = field(default=DEFAULT_BAUD_RATE, kw_only=True)


@dataclass(frozen=True)
class SerialDriverOptions(SerialOptions):
    """The options of `SerialDriver`, which needs a port."""

    port: str = field()
    board: str | Path | Configuration | None = field(default=None, kw_only=True)
    parameters: Mapping[str, float] | None = field(default=None, kw_only=True)

    def checked(self) -> LinkOptions:
        """The link, with these options, checked."""
        whole("baud_rate", self.baud_rate, 1, MAX_BAUD_RATE)
        port = port_name(text("port", self.port, "/dev/ttyUSB0"))
        return self.link_to(port, board=self.board, parameters=self.parameters)


def _settings(parameters: Mapping[str, float]) -> dict[int, float]:
    from ..parameters import checked_values

    return {PARAMETER_BY_NAME[name].id: value for name, value in checked_values(parameters).items()}


def _expected(board: str | Path | Configuration) -> ExpectedBoard:
    from ..board import Configuration

    if not isinstance(board, Configuration):
        from ..tools.files.board import load_board

        board = load_board(board)
    return ExpectedBoard(board.name, board.fingerprint(), is_bare=not board.peripherals)
