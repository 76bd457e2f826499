"""The protocol's version and the hash of its wire layout."""

from __future__ import annotations

PROTOCOL_VERSION = 1


def schema_hash() -> int:
    """Which layout this is, in 32 bits: what host and device must agree on."""
    from .types import SCHEMA_HASH  # here, for the generator runs while `types` is out of date

    return SCHEMA_HASH
