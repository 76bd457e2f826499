"""The protocol's version and the hash of its wire layout."""

from __future__ import annotations

PROTOCOL_VERSION = 1


def schema_hash() -> int:
    """The 32-bit hash of the wire layout; host and device must have the same."""
    from .types import SCHEMA_HASH  # here, because the generator runs with an outdated `types`

    return SCHEMA_HASH
