"""Errors travel between processes: `multiprocessing` and `concurrent.futures` pickle them."""

import ast
import copy
import pickle
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.cases import each
from wheelwire import errors
from wheelwire.errors import Release
from wheelwire_protocol.codes import Fault, RefusalCode, SensorState

OURS, THEIRS = Release(1, 2, "0.1.0"), Release(3, 4, "0.2.0")
WITH_ARGUMENTS: dict[type[errors.WheelwireError], errors.WheelwireError] = {
    type(error): error
    for error in (
        errors.PortUnavailable("/dev/x", "it is not there"),
        errors.DeviceSilent("/dev/x", [9600, 115_200]),
        errors.ForeignDevice("/dev/x", [9600], 77),
        errors.ProtocolMismatch(OURS, THEIRS),
        errors.DeviceRefused(RefusalCode.FAULT, "the setpoint", Fault.CONTROL_OVERRUN),
        errors.DeviceRefused(RefusalCode.ESTOPPED, "the setpoint"),
        errors.WrongBoard("240ac4123456", "240ac4abcdef"),
        errors.BoardMismatch("devkit", "other", confirmed=False),
        errors.GroupUnavailable("board", 0x1234, 0x5678),
        errors.SensorStale("imu", SensorState.FROZEN, "STALE, FROZEN"),
        errors.UnknownParameter("wheel_radios", ["wheel_radius"]),
        errors.ParameterOutOfRange("wheel_radius", 7.0, "at most 1"),
    )
}


def all_errors(base: type[errors.WheelwireError]) -> Iterator[type[errors.WheelwireError]]:
    yield base
    for kind in base.__subclasses__():
        if kind.__module__ == errors.__name__:
            yield from all_errors(kind)


@each("kind", list(all_errors(errors.WheelwireError)))
def test_every_error_comes_back_as_it_was(kind: type[errors.WheelwireError]) -> None:
    error = WITH_ARGUMENTS.get(kind) or kind("what happened")
    for back in (pickle.loads(pickle.dumps(error)), copy.copy(error)):  # noqa: S301
        assert type(back) is kind
        assert str(back) == str(error)
        assert back.__dict__ == error.__dict__


def test_exit_codes_are_distinct() -> None:
    codes = [kind.exit_code for kind in all_errors(errors.WheelwireError)]
    assert len(set(codes)) == len(codes)
    assert not {0, 2} & set(codes)


@pytest.mark.parametrize(
    ("kind", "base"),
    [
        (errors.RequestTimeout, TimeoutError),
        (errors.LinkLost, ConnectionError),
        (errors.WrongBoard, ConnectionError),
        (errors.PortUnavailable, OSError),
        (errors.Expired, errors.InvalidCommand),
    ],
)
def test_an_error_is_pythons_of_the_same_meaning_too(
    kind: type[errors.WheelwireError], base: type[Exception]
) -> None:
    assert issubclass(kind, base)


def test_a_closed_link_is_not_a_lost_link() -> None:
    """A loop that waits for a reconnection has to end on a closed driver."""
    assert not issubclass(errors.LinkClosed, (errors.LinkLost, OSError))


ROOT = Path(__file__).parents[2]
SOURCES = sorted(
    path for folder in ("host", "ros_node", "examples") for path in (ROOT / folder).rglob("*.py")
)
OS_ERRORS = {"OSError", "ConnectionError", "TimeoutError"}
ROBOTS = {"robot", "driver", "_robot", "_driver"}


def caught(handlers: list[ast.ExceptHandler]) -> Iterator[str]:
    """The names that the handlers catch, up to one that takes all of ours."""
    for handler in handlers:
        names = (
            {node.id for node in ast.walk(handler.type) if isinstance(node, ast.Name)}
            if (handler.type)
            else set()
        )
        if "WheelwireError" in names:
            return
        yield from names


def calls_a_robot(body: list[ast.stmt]) -> bool:
    return any(
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and getattr(node.func.value, "id", getattr(node.func.value, "attr", "")) in ROBOTS
        for statement in body
        for node in ast.walk(statement)
    )


def test_no_call_of_a_robot_is_where_an_oserror_is_handled() -> None:
    """Three of our errors are OSErrors: they would be mistaken for one of a file."""
    found = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in SOURCES
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Try)
        and OS_ERRORS & set(caught(node.handlers))
        and calls_a_robot(node.body)
    ]
    assert found == []


@pytest.mark.parametrize("hint", ["", "`wheelwire clear` ends it", "Close the contact."])
def test_why_is_a_sentence_of_its_own(hint: str) -> None:
    error = errors.DeviceRefused(RefusalCode.FAULT, "the setpoint", Fault.EXTERNAL, hint=hint)
    error.why = "cliff.front saw no floor."
    assert str(error).endswith(f"{hint or 'clear the fault.'}".rstrip(".") + f". {error.why}")


@pytest.mark.parametrize("cause", [None, OSError("pulled")])
def test_a_stored_error_hides_what_its_caller_was_handling_only_for_a_cause(
    cause: OSError | None,
) -> None:
    stored = errors.LinkLost("the port is gone")
    if cause is not None:
        stored.__cause__ = cause
    handled = ValueError("mine")

    def fail() -> None:
        try:
            raise handled
        except ValueError:
            raise errors.afresh(stored)  # noqa: B904 - as a robot's call does that is in there

    with pytest.raises(errors.LinkLost) as raised:
        fail()
    assert raised.value.__context__ is handled
    assert raised.value.__cause__ is cause
    assert raised.value.__suppress_context__ is (cause is not None)
