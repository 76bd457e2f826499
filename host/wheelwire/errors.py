"""All errors of the library. Each message is one line: what happened and what to do.

`exit_code` is what the command line exits with; 2 is reserved for wrong usage.

If Python has an error of the same meaning, ours is also a subclass of it: `PortUnavailable`,
`LinkLost` and `RequestTimeout` are OSErrors. So code that handles an OSError of a file must not
have a robot's calls within the same `try`.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import ClassVar, NamedTuple, TypeVar

from wheelwire_protocol.codes import Fault, RefusalCode, SensorState

NO_FAULT = Fault(0)
_MAX_SHOWN_LENGTH = 60
_HELD = (RefusalCode.ESTOPPED, RefusalCode.FAULT, RefusalCode.CAUSE_PRESENT)
"""Refused because of what holds the robot."""


class WheelwireError(Exception):
    """Base class of the errors that Wheelwire raises.

    Attributes:
        why: If a stop of the robot or a refusal of the device caused this error, the sentence that
            `wheelwire why` gives for it; otherwise empty. Without `watch_stops` only the state and
            the faults are known.
        evidence: What shows it.
        look_at: What to look at first.
    """

    exit_code: ClassVar[int] = 1
    why: str = ""
    evidence: tuple[str, ...] = ()
    look_at: str = ""

    def __reduce__(self) -> tuple[object, ...]:
        # Exception's own version would call the class with the finished message as its arguments.
        return rebuilt, (type(self), self.args, self.__dict__)


ErrorT = TypeVar("ErrorT", bound=WheelwireError)


class PortUnavailable(WheelwireError, OSError):  # noqa: N818 - the design's names say the state
    """The port cannot be opened: it does not exist, is in use, or access is denied.

    Attributes:
        is_other_board: Another board than the one that was named answers there.
        is_in_use: A program has the port open.
    """

    exit_code = 3

    def __init__(
        self, port: str, reason: str, *, is_other_board: bool = False, is_in_use: bool = False
    ) -> None:
        super().__init__(f"cannot open {port}: {reason}")
        self.port = port
        self.reason = reason
        self.is_other_board = is_other_board
        self.is_in_use = is_in_use


class DeviceSilent(WheelwireError):  # noqa: N818
    """The device sent nothing."""

    exit_code = 4

    def __init__(self, port: str, baud_rates: Sequence[int]) -> None:
        super().__init__(
            f"{port} is silent{_at_rates(baud_rates)}: check power, cable and port, "
            "and that the firmware is flashed"
        )
        self.baud_rates = tuple(baud_rates)


class ForeignDevice(WheelwireError):  # noqa: N818
    """The device sends bytes, but no Wheelwire frames.

    Args:
        port: Where.
        baud_rates: That were tried.
        bytes_received: At all of them.
        quote: The newest line of plain text in these, if there is any.
        cure: What that text means, and what to do, where it is known.
    """

    exit_code = 5

    def __init__(
        self,
        port: str,
        baud_rates: Sequence[int],
        bytes_received: int,
        quote: str = "",
        cure: str = "",
    ) -> None:
        cure = cure or (
            "choose another port (`wheelwire ports`), give its baud rate, or flash the firmware"
        )
        said = f", but the text {quote!r}" if quote else ""
        super().__init__(
            f"{port} sent {bytes_received} bytes but no Wheelwire frame{_at_rates(baud_rates)}"
            f"{said}: {cure}"
        )
        self.baud_rates = tuple(baud_rates)


class Release(NamedTuple):
    """The versions of one side of the link."""

    protocol_version: int
    schema_hash: int
    release: str
    """Release of the firmware or of the host library, such as `0.1.0`."""

    def __str__(self) -> str:
        return f"{self.release} (protocol {self.protocol_version}, schema {self.schema_hash:08x})"


class ProtocolMismatch(WheelwireError):  # noqa: N818
    """Host library and firmware are from different releases; the device refuses this host."""

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
        hint: What to do, in addition to the code's own text.
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
            # A newer firmware may have reasons that are unknown here.
            text = f"Code {code}, unknown to this host library: install the firmware's release."
        sentences = [f"the device refused {subject}: {text}", fault_names(faults), hint]
        super().__init__(" ".join(filter(None, sentences)))

    def __str__(self) -> str:
        # Any other code has said the same already.
        said = self.why if self.code in _HELD else ""
        text = super().__str__()
        return f"{text.rstrip('.')}. {said}" if said else text

    def hinted(self, subject: str, hint: str) -> DeviceRefused:
        """The same refusal with another hint; `subject` is what a person calls its object."""
        error = DeviceRefused(self.code, subject, self.faults, hint=hint)
        error.why, error.evidence, error.look_at = self.why, self.evidence, self.look_at
        return error


class LinkLost(WheelwireError, ConnectionError):  # noqa: N818
    """The link is down. It reconnects by itself; wait, or check the cable.

    Args:
        text: What happened.
        causes: Which of `wheelwire why`'s causes are behind it, by name, as far as it is known.
    """

    exit_code = 8
    causes: tuple[str, ...] = ()  # also of one that another process has sent without them

    def __init__(self, text: str, *, causes: tuple[str, ...] = ()) -> None:
        super().__init__(text)
        self.causes = causes


class LinkClosed(WheelwireError):  # noqa: N818
    """The link is closed for good: by `close`, a failed thread, or a fork of the process."""

    exit_code = 17


class WrongBoard(LinkLost):
    """The board at the port is not the one that the link was opened to; it is not used."""

    exit_code = 18

    def __init__(self, expected: str, found: str) -> None:
        super().__init__(
            f"board {found} is at the port in place of {expected}: connect {expected} again, or "
            "open the driver with any_board=True to use whichever board is there"
        )
        self.expected = expected
        self.found = found


class RequestTimeout(WheelwireError, TimeoutError):  # noqa: N818
    """No answer to a repeated request; it is unknown whether it was carried out."""

    exit_code = 9


class InvalidArgument(WheelwireError, ValueError):  # noqa: N818
    """An argument or option has a wrong type or value. Nothing was done."""

    exit_code = 19


class InvalidCommand(InvalidArgument):
    """An invalid command: NaN, infinity, or a time to live out of bounds. Nothing was sent."""

    exit_code = 10


class Expired(InvalidCommand):
    """The command's time to live had run out when it was to be sent. Nothing was sent."""

    exit_code = 28


class UnknownParameter(WheelwireError, KeyError):  # noqa: N818
    """No parameter has this name."""

    exit_code = 11
    __str__ = Exception.__str__  # KeyError's own puts the text in quotes

    def __init__(self, name: str, known: Iterable[str]) -> None:
        near = meant(name, known)
        hint = f"did you mean {near}?" if near else "`wheelwire params list` shows the names"
        super().__init__(f"no parameter is called {shown(name)}: {hint}")
        self.name = name


class ParameterOutOfRange(WheelwireError, ValueError):  # noqa: N818
    """A parameter's value is out of bounds, or of the wrong kind."""

    exit_code = 12

    def __init__(self, key: str, value: float, bound: str) -> None:
        # Anything may be given: a word is not out of a range.
        is_number = isinstance(value, (int, float)) and value == value
        problem = "is out of range" if is_number else "is not a number"
        hint = with_point(value)
        super().__init__(f"{key} = {shown(value)} {problem}: it must be {bound}{hint}")
        self.key = key
        self.value = value
        self.bound = bound


class DriverUnavailable(WheelwireError):  # noqa: N818
    """The driver does not exist, or something that it needs is missing."""

    exit_code = 13


class SimulatorNotFound(WheelwireError):  # noqa: N818
    """The simulator is not built or cannot be found."""

    exit_code = 14


class ConfigurationError(WheelwireError):
    """A configuration file is invalid."""

    exit_code = 15


class FlashFailed(WheelwireError):  # noqa: N818
    """The firmware could not be written, or does not answer afterwards."""

    exit_code = 16


class OutputFailed(WheelwireError):  # noqa: N818
    """A result could not be written: the disk is full, or the folder is missing or read-only."""

    exit_code = 20

    @classmethod
    @contextmanager
    def of(
        cls, path: object, then: str = "choose a folder that can be written, or free some space"
    ) -> Iterator[None]:
        """Raise this for a failure to write a file or folder; `then`: what to do about it."""
        try:
            yield
        except WheelwireError:
            raise
        except OSError as error:
            path = path or error.filename
            raise cls(f"cannot write {path}: {error.strerror or error}; {then}") from error


class RobotNotNamed(WheelwireError):  # noqa: N818
    """No robot was named, and there is not exactly one candidate. Nothing was opened."""

    exit_code = 21


class ImportFailed(WheelwireError):  # noqa: N818
    """Parameters could not be imported. The message says whether the previous values are back."""

    exit_code = 23


class CommissioningFailed(WheelwireError):  # noqa: N818
    """A measurement on the robot cannot be made or makes no sense. The wheels were stopped."""

    exit_code = 24


class BoardNotKept(WheelwireError):  # noqa: N818
    """The new board was not kept; the previous one is active."""

    exit_code = 26


class BoardMismatch(LinkLost):
    """The device is on another board than the one that was named; nothing is driven."""

    exit_code = 27

    def __init__(self, expected: str, found: str, *, confirmed: bool = True) -> None:
        unconfirmed = "" if confirmed else ", which is not confirmed"
        super().__init__(
            f"the device's board is {found}{unconfirmed}, not {expected}: name the board that is "
            "there, or store the other one with `wheelwire board write`"
        )
        self.expected = expected
        self.found = found


class GroupUnavailable(WheelwireError):  # noqa: N818
    """Host and device do not have the same messages of a group. All others work."""

    exit_code = 25

    def __init__(self, group: str, host: int, device: int, *, needed_by: str = "") -> None:
        theirs = f"the device's have 0x{device:08x}" if device else "the device has none"
        needed_by = needed_by and f"{needed_by}: "
        super().__init__(
            f"{needed_by}this library's messages about {group}s have the hash 0x{host:08x}, "
            f"{theirs}: use firmware and library of one release for this; everything else works"
        )
        self.group = group
        self.host = host
        self.device = device


class SensorMissing(WheelwireError):  # noqa: N818
    """The robot has no such sensor."""

    exit_code = 32


class SensorStale(WheelwireError):  # noqa: N818
    """A sensor's samples cannot be used now.

    Args:
        channel: Its name, as in `imu`.
        state: Why.
        sentence: The same for people.
    """

    exit_code = 33

    def __init__(self, channel: str, state: SensorState, sentence: str) -> None:
        super().__init__(f"{channel} is {sentence}; `wheelwire sensors` shows all channels")
        self.channel = channel
        self.state = state


class RecordingError(WheelwireError):
    """A recording cannot be read, or not be written."""

    exit_code = 29


def afresh(error: ErrorT) -> ErrorT:
    """A copy to be raised of an error that is stored, and is raised again and again.

    The original's traceback would keep its callers' frames alive, and grow each time.
    """
    raised = copy.copy(error)
    raised.__cause__ = error.__cause__
    # A cause, even None, would hide which error its caller was handling.
    raised.__suppress_context__ = error.__suppress_context__
    return raised


def rebuilt(
    kind: type[WheelwireError], arguments: tuple[object, ...], state: dict[str, object]
) -> WheelwireError:
    """An error with these arguments of `Exception` and these attributes: a copy.

    The original may be in another process.
    """
    # The arguments are those of Exception. `__init__`, which takes others, is not called.
    error = kind.__new__(kind, *arguments)
    # An OSError leaves that to `__init__`.
    error.args = arguments
    error.__dict__.update(state)
    return error


def shown(value: object) -> str:
    """Format `value` for an error message: never long, and never raises."""
    try:
        text = repr(value)
    except Exception:  # such as an int with more digits than Python agrees to print
        text = f"a {type(value).__name__}"
    return text if len(text) <= _MAX_SHOWN_LENGTH else f"{text[:_MAX_SHOWN_LENGTH]}..."


def meant(name: object, known: Iterable[str], cutoff: float = 0.5) -> str:
    """The one of `known` that is most like `name`, ignoring case; empty without one."""
    from difflib import get_close_matches  # here: it is slow to import

    by_lower = {one.lower(): one for one in known}
    near = get_close_matches(shown(name).strip("'").lower(), by_lower, n=1, cutoff=cutoff)
    return by_lower[near[0]] if near else ""


def with_point(value: object) -> str:
    """A hint for a number with a decimal comma: "; did you mean 0.2?"; empty for anything else."""
    found = re.fullmatch(r"\s*([-+]?\d+),(\d+)\s*", value) if isinstance(value, str) else None
    return f"; did you mean {found[1]}.{found[2]}?" if found else ""


def fault_names(faults: Fault) -> str:
    """Each of these faults, and what it means."""
    return " ".join(f"{fault.name}: {fault.doc}" for fault in Fault if fault in faults)


def _at_rates(baud_rates: Sequence[int]) -> str:
    return f" at {', '.join(map(str, baud_rates))} baud" if baud_rates else ""
