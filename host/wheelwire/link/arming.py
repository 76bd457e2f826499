"""Arms a robot whose link was just opened: the zero setpoint that comes before all others. Sans-IO.

A device that has started drives nothing before a zero setpoint or a pause, so that a program which
went on publishing meanwhile does not move it. Whoever opens a link only begins, and gets that zero
from here. A link that comes back by itself never sends it.
"""

from __future__ import annotations

from contextlib import suppress
from functools import partial

from wheelwire_protocol.codes import RefusalCode

from ..errors import DeviceRefused, Expired, LinkClosed, LinkLost, WheelwireError
from .device_link import DeviceLink, Opening
from .requests import Answer
from .session import Phase, Session
from .setpoints import SetpointSender

ZERO_TTL_US = 250_000
"""More than the error bound of the clock; the stop behind the zero ends it at once."""
SEEN_S = 0.25
"""How long a state frame or a refusal may take to show what became of the zero."""
LOST_ATTEMPTS = 5
BOOTING_ATTEMPTS = 50
BOOTING_PAUSE_S = 0.02
"""Between two attempts while the sensors of a device that was just started are read first."""


def arming(link: DeviceLink, session: Session) -> Opening:
    """Send a zero setpoint until the device has obeyed or refused one, each with a stop behind it.

    The stop leaves the robot in IDLE, as it was: in DRIVING a device refuses to change parameters.
    A refusal, as on a board that nobody confirmed, is no error of whoever opens the link: the first
    setpoint of the program itself is refused for the same reason.

    Args:
        link: It was opened.
        session: Its session.
    """
    setpoints = session.setpoints
    lost = booting = 0
    while lost < LOST_ATTEMPTS and booting < BOOTING_ATTEMPTS and session.phase is Phase.OPEN:
        results: list[Answer | WheelwireError] = []
        setpoints.awaits_fate = True
        try:
            link.drive_velocity(0.0, 0.0, link.clock_us() + ZERO_TTL_US)
            zero_seq = setpoints.zero_seq
            link.post_stop(results.append)
        except (DeviceRefused, Expired, LinkClosed, LinkLost):
            break
        yield partial(_is_decided, results, setpoints, zero_seq), SEEN_S
        refusal = setpoints.refusal_of(zero_seq)
        if refusal is not None:
            yield from _forget_refusal(link)
        if not setpoints.has_fate(zero_seq):
            lost += 1
        elif refusal != RefusalCode.BOOTING:
            # A lost stop is repeated. Until it is obeyed, the zero drives.
            yield partial(bool, results), ZERO_TTL_US / 1e6
            break
        else:
            booting += 1
            yield bool, BOOTING_PAUSE_S
    setpoints.awaits_fate = False


def _forget_refusal(link: DeviceLink) -> Opening:
    """Stop once more: it would be reported to whoever sends the first setpoint."""
    results: list[Answer | WheelwireError] = []
    with suppress(LinkClosed, LinkLost):
        link.post_stop(results.append)
        yield partial(bool, results), SEEN_S


def _is_decided(results: list[Answer | WheelwireError], zeros: SetpointSender, seq: int) -> bool:
    """Whether the stop was answered, and the device has said what it did with the zero before."""
    return bool(results) and zeros.has_fate(seq)
