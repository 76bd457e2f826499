"""A short endurance run; `make soak MINUTES=...` is the long one."""

from __future__ import annotations

from support.soak import run
from support.waiting import undisturbed

MINUTES = 0.12
LAP_S = 2.0


def test_every_loss_is_reported_and_every_incident_survived() -> None:
    # A stall of seconds leaves time for one lap only.
    laps = undisturbed(lambda: run(MINUTES, LAP_S), lambda laps: len(laps) > 1)
    assert {lap.incident for lap in laps} == {"reset", "unplug"}
    for lap in laps:
        assert lap.hit > 0
        assert lap.uncounted == (0, 0, 0, 0)
        assert lap.ticks_wrong == 0
        assert lap.sessions == 0
    assert len({(lap.threads, lap.files) for lap in laps}) == 1
