"""A small model of a host and a device: which values are possible, and until when wheels may turn.

It knows the host's requests and the answers that came, but not what was lost on the way. So it
keeps sets of the possible values.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

Values = dict[int, frozenset[float]]
"""The values that a parameter may have, by its id."""


@dataclass
class Model:
    """Times are the host's, in microseconds.

    Attributes:
        values: In the device's memory.
        saved: In its store.
        boots: How often the device was reset; requests before a reset have no effect after it.
        clears: How many requests to clear an e-stop may still be carried out.
        latched: An e-stop was acknowledged, and no request to clear it was sent.
    """

    values: Values
    saved: Values
    boots: int = 0
    clears: int = 0
    latched: bool = False
    _expiries_us: list[int] = field(default_factory=list)

    def may_drive(self, now_us: int) -> bool:
        """Whether a setpoint may still be valid."""
        return not self.latched and any(now_us <= expiry_us for expiry_us in self._expiries_us)

    @property
    def setpoints(self) -> int:
        """The number of setpoints sent; a later stop cancels those before it."""
        return len(self._expiries_us)

    def sent_setpoint(self, expiry_us: int) -> None:
        self._expiries_us.append(expiry_us)

    def stopped(self, setpoints: int, boots: int) -> None:
        """Note the acknowledgement of a stop that was sent after so many setpoints and resets."""
        if boots == self.boots:
            self._expiries_us[:setpoints] = [0] * setpoints

    def estopped(self, boots: int) -> None:
        """Note the acknowledgement of an e-stop; setpoints after it are refused, too."""
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
