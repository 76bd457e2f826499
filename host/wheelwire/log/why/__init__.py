"""Why a robot stopped, from what crossed its link: live, or from a recording.

records -> `history`: what was seen of late -> `diagnosis`: one stop after the other
                                            -> `wheel_fault`: what a wheel did before its fault
a device's black box -> `black_box`: its stop, its re-run
a device's own reports -> `device`: with all its boxes, its ledger, and how it stands now
`causes`: each cause's sentence, and what to look at first
`watch`: live, beside the program that drives; `explanation`: the cause in a refused call's error
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
