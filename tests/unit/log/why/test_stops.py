"""Each staged stop is named right: one cause, or those that the data leaves open."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from support.cases import each
from support.staged_stops import STAGED, SUPPLY, StagedRobot, diagnosed, fails, staged
from wheelwire.log.why.causes import (
    CAUSES,
    HELD,
    OTHER_FAULTS,
    REFUSALS,
    REQUEST_REFUSALS,
    RESETS,
    WHEEL_FAULTS,
)
from wheelwire.log.why.diagnosis import Diagnosis, Stop
from wheelwire_protocol.codes import Fault, RefusalCode, ResetReason
from wheelwire_protocol.framing import encode_frame
from wheelwire_protocol.types import ClearEstop, DeviceHello

PAGE = Path(__file__).parents[4] / "docs" / "causes.md"


@pytest.mark.parametrize("name", STAGED)
def test_a_staged_stop_is_named(name: str) -> None:
    stops = diagnosed(STAGED[name])
    assert tuple(stop.cause for stop in stops) == STAGED[name].stops, [
        one.evidence for one in stops
    ]
    for stop in stops:
        assert stop.sentence.endswith(".")
        assert stop.evidence
        assert stop.look_at


@pytest.mark.parametrize("seed", range(2, 6))
@pytest.mark.parametrize("name", ["encoder dead", "wheel blocked", "motor's wire off"])
def test_similar_stops_are_distinguished_for_any_seed(name: str, seed: int) -> None:
    assert [stop.cause for stop in diagnosed(STAGED[name], seed)] == list(STAGED[name].stops)


@each("name", CAUSES)
def test_what_to_look_at_follows_look_first_at(name: str) -> None:
    look_at = CAUSES[name].look_at
    assert re.match(r"the |what |where |who |whether |`|[a-z]+_[a-z_]+", look_at), look_at
    assert not look_at.endswith(("?", "."))


def test_every_reset_reason_is_staged() -> None:
    causes = {
        cause for one in STAGED.values() for stop in one.stops for cause in stop.split(" or ")
    }
    assert set(RESETS.values()) <= causes


def test_the_other_wheel_is_evidence() -> None:
    (alone,) = diagnosed(STAGED["encoder dead"])
    assert "the right wheel went on" in alone.evidence

    both = staged(
        "encoder_dead",
        lambda robot: robot.sim.set("right.encoder_dead", 1),
        fails("left.encoder_dead"),
        settings=SUPPLY,
    )
    (stop,) = diagnosed(both)
    assert any("wheel stopped counting, too" in text for text in stop.evidence)


def test_a_hello_refused_for_a_reason_of_a_later_release_is_no_stop() -> None:
    robot = StagedRobot(1)
    robot.open()
    robot.drive(0.2, 0.2, 0.5)
    hello = DeviceHello(1, 1, 1, 200, *[0] * 10)
    robot.session.receive(encode_frame(hello, 0), robot.now_us)
    robot.drive(0.2, 0.2, 0.5)
    assert Diagnosis().feed_all(robot.reader.take()) == []


def test_a_latched_stop_is_judged_alike_however_often_it_is_asked_for() -> None:
    robot = StagedRobot(1)
    robot.open()
    robot.drive(0.2, 0.2, 0.5)
    diagnosis = Diagnosis()
    found: list[Stop] = []
    for again in (False, True):
        if again:
            robot.request(ClearEstop(0, 0))
            robot.drive(0.0, 0.0, 0.04)
            robot.drive(0.2, 0.2, 0.2)
        robot.estop()
        found += diagnosis.feed_all(robot.reader.take())
        latched = [diagnosis.latched() for _ in range(3)]
        robot.run(0.1)
        found += diagnosis.feed_all(robot.reader.take())
        assert latched == [found[-1]] * 3
    assert [stop.cause for stop in found] == ["estop_by_session"] * 2


def test_a_wheel_is_named_by_its_side() -> None:
    (stop,) = diagnosed(STAGED["encoder dead, right"])
    assert stop.sentence.startswith("Right wheel stopped counting")


def test_every_fault_reset_and_refusal_has_a_cause() -> None:
    assert set(WHEEL_FAULTS) | set(OTHER_FAULTS) == set(Fault)
    assert set(RESETS) == set(ResetReason)
    named = {name for _, name in WHEEL_FAULTS.values()}
    named |= {
        *OTHER_FAULTS.values(),
        *RESETS.values(),
        *REFUSALS.values(),
        *REQUEST_REFUSALS.values(),
    }
    assert named <= set(CAUSES)
    tables = (*REFUSALS, *REQUEST_REFUSALS, *HELD)
    assert set(tables) == set(RefusalCode) - {RefusalCode.NONE}
    assert len(tables) == len(set(tables))


def test_the_page_has_the_same_causes() -> None:
    heads = re.findall(r"^- ((?:`\w+`[,\s]+)*`\w+`):", PAGE.read_text("utf-8"), re.MULTILINE)
    rows = [name for head in heads for name in re.findall(r"`(\w+)`", head)]
    assert set(rows) == set(CAUSES)
    assert len(rows) == len(set(rows))
