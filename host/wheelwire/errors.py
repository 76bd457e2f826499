"""All errors of the library. Each message is one line: what happened, and what to do.

`exit_code` is the exit code of the command line; 2 is reserved for wrong usage.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from wheelwire_protocol.codes import Fault, RefusalCode

NO_FAULT = Fault(0)
_LONGEST_SHOWN = 60


class WheelwireError(Exception):
    """Base of every error that Wheelwire raises on purpose."""

    exit_code: ClassVar[int] = 1

    def __reduce__(self) -> tuple[object, ...]:
        # Exception's own would call the class with the finished text for its arguments.
        return _restored, (type(self), self.args, self.__dict__)


class PortUnavailable(WheelwireError):  # noqa: N818 - the design's names say the state, not "Error"
    """The port cannot be opened: not there, in use, or not permitted."""

    exit_code = 3

    def __init__(self, port: str, reason: str) -> None:
        super().__init__(f"cannot open {port}: {reason}")
        self.port = port


class DeviceSilent(WheelwireError):  # noqa: N818
    """The device sent nothing."""

    exit_code = 4

    def __init__(self, port: str, baud_rates: Sequence[int]) -> None:
        super().__init__(
            f"{port} is silent{_tried(baud_rates)}: check power, cable and port, "
            "and that the firmware is flashed"
        )
        self.baud_rates = tuple(baud_rates)


class ForeignDevice(WheelwireError):  # noqa: N818
    """Bytes come, but no Wheelwire frame."""

    exit_code = 5

    def __init__(self, port: str, baud_rates: Sequence[int], bytes_received: int) -> None:
        super().__init__(
            f"{port} sent {bytes_received} bytes but no Wheelwire frame{_tried(baud_rates)}: "
            "choose another port (`wheelwire ports`), give its baud rate, or flash the firmware"
        )
        self.baud_rates = tuple(baud_rates)


@dataclass(frozen=True)
class Release:
    """How one side of the link identifies itself."""

    protocol_version: int
    schema_hash: int
    release: str
    """Of the firmware or the host library, such as `0.1.0`."""

    def __str__(self) -> str:
        return f"{self.release} (protocol {self.protocol_version}, schema {self.schema_hash:08x})"


class ProtocolMismatch(WheelwireError):  # noqa: N818
    """Host and firmware are of different releases; the device does not move for this host."""

    exit_code = 6

    def __init__(self, host: Release, device: Release) -> None:
        super().__init__(
            f"host library {host} and firmware {device} do not match: install both from one release"
        )
        self.host = host
        self.device = device


class DeviceRefused(WheelwireError):  # noqa: N818
    """The device refused a request or a setpoint; nothing moved or changed because of it.

    Args:
        code: A `RefusalCode`, if this library knows it.
        subject: What was refused.
        faults: The latched faults, if they are the reason.
        hint: What to do, beyond what the code says.
    """

    exit_code = 7

    def __init__(
        self, code: int, subject: str, faults: Fault = NO_FAULT, *, hint: str = ""
    ) -> None:
        self.code = code
        self.faults = faults
        try:
            text = RefusalCode(code).doc
        except ValueError:
            text = f"Code {code}, which this host library does not know."
        latched = [f"{fault.name}: {fault.doc}" for fault in Fault if fault in faults]
        sentences = [f"the device refused {subject}: {text}", *latched, hint]
        super().__init__(" ".join(filter(None, sentences)))


class LinkLost(WheelwireError):  # noqa: N818
    """The link is down. It reconnects by itself; wait, or check the cable."""

    exit_code = 8


class LinkClosed(LinkLost):
    """The link is down for good: it was closed, its thread failed, or this is a forked process."""

    exit_code = 17


class WrongBoard(LinkLost):
    """The port leads to another board than the one that the link was opened to; it is not used."""

    exit_code = 18

    def __init__(self, expected: str, found: str) -> None:
        super().__init__(
            f"board {found} is at the port in place of {expected}: connect {expected} again, or "
            "open the driver with any_board=True to use whichever board is there"
        )
        self.expected = expected
        self.found = found


class RequestTimeout(WheelwireError):  # noqa: N818
    """No answer came, although the request was repeated: whether it was carried out is unknown."""

    exit_code = 9


class InvalidArgument(WheelwireError, ValueError):  # noqa: N818
    """An argument or option has the wrong type or size. Nothing was done."""

    exit_code = 19


class InvalidCommand(InvalidArgument):
    """An invalid command: NaN, infinity, no time to live left. Nothing was sent."""

    exit_code = 10


class UnknownParameter(WheelwireError, KeyError):  # noqa: N818
    """No parameter has this name."""

    exit_code = 11
    __str__ = Exception.__str__  # KeyError's own puts the text in quotes

    def __init__(self, name: str, known: Iterable[str]) -> None:
        from difflib import get_close_matches  # here, because it is slow to import

        near = get_close_matches(shown(name).strip("'"), list(known), n=1, cutoff=0.5)
        hint = f"did you mean {near[0]}?" if near else "list the parameters to see the names"
        super().__init__(f"no parameter is called {shown(name)}: {hint}")
        self.name = name


class ParameterOutOfRange(WheelwireError, ValueError):  # noqa: N818
    """A parameter's value is outside its bounds, or not a number of its kind."""

    exit_code = 12

    def __init__(self, key: str, value: float, bound: str) -> None:
        super().__init__(f"{key} = {shown(value)} is out of range: it must be {bound}")
        self.key = key
        self.value = value
        self.bound = bound


class DriverUnavailable(WheelwireError):  # noqa: N818
    """There is no driver of this name, or its requirements are not installed."""

    exit_code = 13


class SimulatorNotFound(WheelwireError):  # noqa: N818
    """The simulated device is not built, or not found."""

    exit_code = 14


class ConfigurationError(WheelwireError):
    """A configuration file is invalid."""

    exit_code = 15


class FlashFailed(WheelwireError):  # noqa: N818
    """The firmware could not be written to a chip, or does not answer afterwards."""

    exit_code = 16


class OutputFailed(WheelwireError):  # noqa: N818
    """A result could not be written: a full disk, a folder that is missing or not writable."""

    exit_code = 20


class RobotNotNamed(WheelwireError):  # noqa: N818
    """No robot was named, and which one is meant cannot be told. Nothing was opened."""

    exit_code = 21


def _restored(
    kind: type[WheelwireError], arguments: tuple[object, ...], state: dict[str, object]
) -> WheelwireError:
    error = kind.__new__(kind, *arguments)
    error.__dict__.update(state)
    return error


def shown(value: object) -> str:
    """Format `value` for an error message: never long, and never raises."""
    try:
        text = repr(value)
    except Exception:  # such as of an int with more digits than Python will print
        text = f"a {type(value).__name__}"
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."


def _tried(baud_rates: Sequence[int]) -> str:
    return f" at {', '.join(map(str, baud_rates))} baud" if baud_rates else ""
