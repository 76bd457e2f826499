"""The line's script, and the files that describe it."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.cases import each
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


@each(
    ("text", "complaint"),
    [
        (
            "to_host: {lost: 0.1}",
            ", line 1: to_host.lost = 0.1: unknown key; did you mean to_host.loss?",
        ),
        ("to_host:\n  loss: 2.0", ", line 2: to_host.loss = 2.0: it must be a probability, 0 to 1"),
        ("to_host: {loss: much}", "to_host.loss = 'much': it must be a probability"),
        ("to_host: {loss: yes}", "to_host.loss = True: it must be a probability"),
        ("to_host: {loss: .nan}", "to_host.loss = nan: it must be a probability"),
        ("to_host: {baud_rate: .inf}", "to_host.baud_rate = inf: it must be a whole number"),
        ("to_host: {baud_rate: 9600.5}", "to_host.baud_rate = 9600.5: it must be a whole number"),
        ("to_host: {delay_us: 2024-01-01}", "to_host.delay_us = '2024-01-01': it must be a whole"),
        ("to_host: {split: 'yes'}", "to_host.split = 'yes': it must be true or false"),
        ("to_host: {split: 1}", "to_host.split = 1: it must be true or false"),
        ("to_host: 3", "to_host = 3: it must be names with values"),
        ("to_host:", "to_host = None: it must be names with values"),
        (
            "incidents:\n- {what: reset, at_s: 1}\n- {what: fire, at_s: 1.0}",
            ", line 3: incidents[1].what = 'fire': choose from stall, unplug, reset",
        ),
        ("incidents: [{what: reset}]", ", line 1: incidents[0].at_s is missing"),
        ("incidents: [{what: stall, at_s: .inf}]", "incidents[0].at_s = inf: it must be seconds"),
        ("incidents: [{what: stall, at_s: -1}]", "incidents[0].at_s = -1: it must be seconds"),
        (
            "incidents: [{what: stall, at_s: 1, for_s: 2, every_s: 1}]",
            "incidents[0].every_s = 1: it must be greater than for_s = 2",
        ),
        ("incidents: {what: reset, at_s: 1.0}", "list one incident per line, each after a dash"),
        ("to_host: {", ", line 1: 'to_host: {': a comma or a closing bracket is missing"),
        ("seeds: 1", ", line 1: seeds = 1: unknown key; did you mean seed?"),
        ("seed: much", "seed = 'much': it must be a whole number"),
        ("seed: 1.5", "seed = 1.5: it must be a whole number"),
        ("seed: -1", "seed = -1: it must be a whole number"),
        ("seed: on", "seed = True: it must be a whole number"),
        ("seed: 2024-02-30", "seed = '2024-02-30': it must be a whole number"),
        ("seed:", "seed = None: it must be a whole number"),
        ("seed: 1\nseed: 2", ", line 2: seed is given twice (first in line 1): remove one"),
        ("", "the file is empty: it must be names with values"),
        ("variables: {mass_kg: 1}", "this is a plant, for `wheelwire sim --plant FILE`"),
    ],
)
def test_a_profile_that_cannot_be(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(ConfigurationError) as error:
        load_profile(str(path))
    assert complaint in str(error.value)
    assert str(error.value).startswith(str(path))
    assert len(str(error.value).splitlines()) == 1


def test_no_profile_of_that_name() -> None:
    with pytest.raises(ConfigurationError, match="noisy"):
        load_profile("nowhere")
