"""Black boxes that `wheelwire why --rerun FILE --export-test` wrote: each is done again.

The core that recorded a box gives the same duties and states, bit by bit. A later core does the
same as it, in the same steps, or the test fails: then delete the box, if the change is meant.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from wheelwire.log.why.black_box import read_box
from wheelwire_protocol.black_box import RerunOutcome

BOXES = sorted(Path(__file__).with_name("boxes").glob("*.box"))


@pytest.mark.parametrize("box", BOXES, ids=lambda box: box.stem)
def test_a_box_is_done_again(box: Path) -> None:
    found = read_box(box).rerun(any_core=True)
    assert found.outcome is not RerunOutcome.UNREADABLE, (
        "this core's state has other fields: delete it"
    )
    assert found.outcome is RerunOutcome.SAME, found
