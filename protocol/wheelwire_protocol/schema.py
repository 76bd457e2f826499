"""The protocol's version and the hashes of its wire layout, one for each group of messages."""

from __future__ import annotations

from .codes import Group

PROTOCOL_VERSION = 2


def schema_hash(group: Group = Group.BASE) -> int:
    """The 32-bit hash of a group's wire layout; host and device must have the same to use it."""
    from .types import GROUP_HASHES  # here, because the generator runs with an outdated `types`

    return GROUP_HASHES[group]
