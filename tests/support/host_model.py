"""A small model of a host and a device: which values are possible, and until when wheels may turn.

It knows what the host asked for and which answers came. What got lost on the way it does not know,
so it keeps sets of what may be.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

Values = dict[int, frozenset[float]]
"""Parameter id -> the values that it may have."""


@dataclass
class Model:
    """Times are the host's, in microseconds.

    Attributes:
        values: In the device's memory.
        saved: In its store.
        boots: How often the device was reset: what was asked before is of no consequence after.
        clears: How many requests to clear an e-stop may still be carried out.
        latched: An e-stop was acknowledged, and its end was not asked for.
    """

    values: Values
    saved: Values
    boots: int = 0
    clears: int = 0
    latched: bool = False
    _expiries_us: list[int] = field(default_factory=list)

    def may_drive(self, now_us: int) -> bool:
        """Some setpoint that nothing has made void is not expired."""
        return not self.latched and any(now_us <= expiry_us for expiry_us in self._expiries_us)

    @property
    def setpoints(self) -> int:
        """How many were sent; a later stop voids those before it."""
        return len(self._expiries_us)

    def sent_setpoint(self, expiry_us: int) -> None:
        self._expiries_us.append(expiry_us)

    def stopped(self, setpoints: int, boots: int) -> None:
        """A stop was acknowledged that was asked for after so many setpoints and resets."""
        if boots == self.boots:
            self._expiries_us[:setpoints] = [0] * setpoints

    def estopped(self, boots: int) -> None:
        """An e-stop was acknowledged; it also refuses the setpoints that came after it."""
        if boots == self.boots and not self.clears:
            self.stopped(self.setpoints, boots)
            self.latched = True

    def asked_to_clear(self) -> None:
        self.clears += 1
        self.latched = False

    def asked_to_set(self, parameter: int, value: float) -> None:
        self.values[parameter] |= {value}

    def has_set(self, parameter: int, value: float, boots: int) -> None:
        if boots == self.boots:
            self.values[parameter] = frozenset({value})

    def asked_to_save(self, numbers: Iterable[int] | None = None) -> None:
        """Those of these ids; None: all."""
        for number in self.saved if numbers is None else numbers:
            self.saved[number] |= self.values[number]

    def has_saved(self, values: Values, boots: int) -> None:
        """`values`: when it was asked for."""
        if boots == self.boots:
            self.saved |= values

    def reset(self) -> None:
        """The device starts again: an open session's setpoints and its latch are gone."""
        self.stopped(self.setpoints, self.boots)
        self.boots += 1
        self.latched = False
        self.values = dict(self.saved)
