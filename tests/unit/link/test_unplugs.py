"""Every call ends, at whatever moment the robot is unplugged; `bench/unplugs.py` has more."""

from collections.abc import Callable

import pytest

from support import unplugs

pytestmark = pytest.mark.timeout(120)


@pytest.mark.whole
@pytest.mark.parametrize("run", [unplugs.with_threads, unplugs.with_asyncio])
def test_every_call_ends_at_an_unplug(run: Callable[[int, int], unplugs.Outcome]) -> None:
    outcome = run(150, 1)
    assert not outcome.unbounded
    assert not outcome.unheard
    # Both kinds of ends have to occur, or no unplug came during a call.
    assert outcome.ends["returned"] > 5
    assert outcome.ends["LinkLost"] > 5
