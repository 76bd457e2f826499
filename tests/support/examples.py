"""How many examples a test draws."""

from hypothesis import settings

BY_DEFAULT = 100


def examples(count: int) -> settings:
    """`count` of them, and as much of that in each profile as in a test that names no count."""
    return settings(max_examples=count * settings().max_examples // BY_DEFAULT)
