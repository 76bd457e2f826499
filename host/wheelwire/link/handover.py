"""The state of a session, from which a recorder's or a program's copy of it goes on.

A reader of the traffic begins with it, and then gets all of the session's inputs.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import count
from typing import Any

from wheelwire_protocol.codes import ConfigurationState, EventCode, Fault, SupervisorState
from wheelwire_protocol.types import DeviceHello, Hold

from ..errors import LinkLost, WheelwireError
from .clock import Synchroniser
from .info import ActiveBoard, DeviceInfo, ExpectedBoard
from .session import Session
from .setpoints import REARM_GAP, TTL_MAX, OpenSession
from .traffic import TrafficReader


def hand_over(session: Session, reader: TrafficReader) -> None:
    """Give `reader` the session's state and then all its inputs, or why that is not possible."""
    try:
        start = start_of(session)
    except Exception as error:  # it is this reader's: the robot drives on
        why = f"the call failed, for the link's state is unknown ({error!r}): report this"
        reader.failure = WheelwireError(why)
    else:
        session.traffic.add(reader, start)


def start_of(session: Session) -> bytes:
    """What `resumed` needs. Counters start at zero there, and open requests are left out."""
    preparation, reported = session._preparation, session.reported
    snapshot: dict[str, Any] = {
        "phase": session.phase.name,
        "error": str(session.error),
        "nonce": session._nonce,
        "count": session.count,
        "stream_rate_hz": preparation.stream_rate_hz,
        "watched": reported.watched,
        "settings": list(preparation.settings.items()),
        "any_board": session._any_board,
        "expected_board": preparation.expected_board,
        "hello": session._hello,
        "boots": session._boots.ids,
        "latched": reported.latched,
        "held": session.setpoints.held,
        "hold": reported.hold,
    }
    if session.phase.name == "OPEN":
        liveness, stream = session._liveness, session._state_stream
        snapshot |= {
            "values": list(reported.values.items()),
            "board": reported.board,
            "copies_lost": reported.copies_lost,
            "sensors": session.sensors.snapshot(),
            "clock": session._synchroniser.snapshot(),
            "liveness": [liveness.heard_us, liveness.state_us],
            "stream": stream.snapshot(),
            "requests": session._requests.snapshot(),
            "supervisor": session.setpoints.supervisor,
            "faults": session.setpoints.faults,
            "command_seq": _next_of(session._command_seqs),
        }
    return json.dumps(snapshot).encode()


def resumed(start: bytes, nonce: Callable[[], int]) -> Session:
    """A session that goes on from the state in a record START.

    Raises:
        ValueError: The record is from another release.
    """
    try:
        known = json.loads(start)
        expected = known["expected_board"]
        session = Session(
            nonce,
            known["stream_rate_hz"],
            known["watched"],
            any_board=known["any_board"],
            settings=dict(known["settings"]),
            expected_board=None if expected is None else ExpectedBoard(*expected),
        )
        session.warn_held = lambda *_: None
        _resume(session, known)
    except (KeyError, TypeError) as error:
        raise ValueError(f"it does not begin a session of this release: {error!r}") from error
    return session


def _resume(session: Session, known: dict[str, Any]) -> None:
    session.phase, session._nonce = type(session.phase)[known["phase"]], known["nonce"]
    session.error = LinkLost(known["error"])
    reported = session.reported
    reported.latched = Fault(known["latched"])
    session.setpoints.held = tuple(known["held"])
    for boot_id in known["boots"]:
        session._boots.enter(boot_id)
    if known["hello"] is None:
        return
    session._hello = hello = DeviceHello(*known["hello"])
    session.device, session.count = DeviceInfo.from_hello(hello), known["count"]
    if session.phase.name != "OPEN":
        return
    session.id, session._boot_id = session._nonce ^ hello.boot_id, hello.boot_id
    reported.values = dict(known["values"])
    reported.hold = None if known["hold"] is None else Hold(*known["hold"])
    if known["board"] is not None:
        board = ActiveBoard(*known["board"])
        reported.board = board._replace(state=ConfigurationState(board.state))
    reported.copies_lost = tuple(map(EventCode, known["copies_lost"]))
    session.sensors.resume(known["sensors"])
    session._synchroniser = Synchroniser.resumed(session.id, session._send, known["clock"])
    session._liveness.heard_us, session._liveness.state_us = known["liveness"]
    session._state_stream.resume(*known["stream"])
    session._requests.resume(known["requests"])
    if known["supervisor"] is not None:
        session.setpoints.supervisor = SupervisorState(known["supervisor"])
    session.setpoints.faults = Fault(known["faults"])
    session._command_seqs = count(known["command_seq"])
    session.setpoints.opened = OpenSession(
        session.id, session._synchroniser.clock, session._command_seqs, session._encoder
    )
    for gap in (REARM_GAP.id, TTL_MAX.id):
        if gap in reported.values:
            session.setpoints.take_gap(gap, reported.values[gap])
    reported.collect_watched()


def _next_of(numbers: count[int]) -> int:
    """The number that comes next, which stays there. Copies of a count end with Python 3.14."""
    return int(repr(numbers).removeprefix("count(").removesuffix(")"))
