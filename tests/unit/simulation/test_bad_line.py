"""The line's script, and the files that describe it."""

from __future__ import annotations

from pathlib import Path

import pytest

from wheelwire.errors import ConfigurationError
from wheelwire.simulation.bad_line import (
    CUT_TIMEOUT_US,
    ImpairedLine,
    Impairment,
    Incident,
    LineEvent,
    LineProfile,
)
from wheelwire.tools.files.bad_line import load_profile, shipped_profiles

FRAME = b"\0\x02\x05\0"


def events(line: ImpairedLine, seconds: float) -> list[tuple[int, LineEvent]]:
    """(ms, what) of a run with a frame to the host each millisecond."""
    found = []
    for ms in range(round(seconds * 1000)):
        found += [(ms, what) for what in line.advance(ms * 1000)]
        line.to_host.send(FRAME, ms * 1000)
        line.to_host.take(ms * 1000)
    return found


def test_unplugging_again_and_again() -> None:
    line = ImpairedLine(LineProfile(incidents=(Incident(0.1, "unplug", for_s=0.05, every_s=0.2),)))
    assert events(line, 0.5) == [
        (100, LineEvent.UNPLUG),
        (150, LineEvent.PLUG),
        (300, LineEvent.UNPLUG),
        (350, LineEvent.PLUG),
    ]


def test_a_reset_waits_for_the_middle_of_a_frame() -> None:
    line = ImpairedLine(LineProfile(incidents=(Incident(0.1, "reset"),)))
    assert events(line, 0.3) == [(101, LineEvent.RESET)]
    assert line.to_host.truth.hit == 0  # this one was no good frame


def test_a_silent_device_is_reset_too() -> None:
    line = ImpairedLine(LineProfile(incidents=(Incident(0.1, "reset"),)))
    assert line.advance(100_000) == []
    assert line.next_us == 100_000 + CUT_TIMEOUT_US
    assert line.advance(line.next_us) == [LineEvent.RESET]


def test_a_stall_ends() -> None:
    line = ImpairedLine(LineProfile(incidents=(Incident(0.0, "stall", for_s=0.05),)))
    line.advance(0)
    line.to_host.send(FRAME, 10_000)
    assert line.next_us == 50_000
    line.advance(50_000)
    assert line.to_host.take(50_000) == [FRAME]


@pytest.mark.parametrize("name", shipped_profiles())
def test_the_shipped_profiles_can_be_read(name: str) -> None:
    assert load_profile(name) != LineProfile()


def test_a_profile_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("seed: 7\nto_host: {corrupt: 0.5}\nincidents:\n  - {what: reset, at_s: 2.0}\n")
    assert load_profile(str(path)) == LineProfile(
        to_host=Impairment(corrupt=0.5), incidents=(Incident(2.0, "reset"),), seed=7
    )


def test_no_profile_of_that_name() -> None:
    with pytest.raises(ConfigurationError, match="noisy"):
        load_profile("nowhere")
