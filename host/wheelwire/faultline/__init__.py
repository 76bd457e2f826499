"""A bad line between a host and a device, seeded: one model for virtual time and for real time."""

from .direction import Books, Direction
from .line import FaultLine, Happening
from .profile import Faults, Incident, LineProfile, load_profile, shipped_profiles

__all__ = [
    "Books",
    "Direction",
    "FaultLine",
    "Faults",
    "Happening",
    "Incident",
    "LineProfile",
    "load_profile",
    "shipped_profiles",
]
