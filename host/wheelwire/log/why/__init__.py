"""Why a robot stopped, from what crossed its link: live from the tap, or from a recording.

records -> `history`: what was seen of late -> `diagnosis`: one stop after the other
                                            -> `wheels`: what a wheel did before its fault
a device's black box -> `boxes`: its stop; `device`: all boxes, the ledger, and how it stands now
`causes`: each cause's sentence, and what to look at first
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .diagnosis import Diagnosis as Diagnosis
    from .diagnosis import Stop as Stop

__all__ = ["Diagnosis", "Stop"]


def __getattr__(name: str) -> Any:
    # When used: a driver that is refused imports the table of causes alone.
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(".diagnosis", __name__), name)
    globals()[name] = found  # so that this is asked once
    return found
