"""What an open robot has its parts do, and in which order: at its end, a failure, a new session."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock, call

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from support.host_samples import sample
from wheelwire import SupervisorState, WheelSample
from wheelwire_ros import parameters
from wheelwire_ros.open_robot import OpenRobot
from wheelwire_ros.time_base import TimeBase

IDLE, DRIVING = SupervisorState.IDLE, SupervisorState.DRIVING
TIMED_OUT, FAULT = SupervisorState.TIMED_OUT, SupervisorState.FAULT


class Parts:
    """An open robot whose parts are mocks of one parent, which has all calls in their order."""

    def __init__(self) -> None:
        self.calls = Mock()
        self.open = OpenRobot.__new__(OpenRobot)
        calls, robot = self.calls, self.open
        calls.context.ok.return_value = True
        calls.connection.is_prepared = False
        calls.connection.active = True
        calls.resets.note.return_value = False
        calls.notes.at.return_value = None
        calls.sensors.take.return_value = False
        calls.estimator.unseen_m = 0.0
        parts: dict[str, Any] = {
            "_node": SimpleNamespace(
                context=calls.context,
                threads=calls.threads,
                bridge=calls.bridge,
                setting=calls.setting,
                update_state=calls.update_state,
                get_logger=lambda: calls.logger,
            ),
            "connection": calls.connection,
            "estimator": calls.estimator,
            "_resources": calls.resources,
            "_reader": calls.reader,
            "_resets": calls.resets,
            "_notes": calls.notes,
            "_pacer": calls.pacer,
            "_time_base": calls.time_base,
            "_publisher": calls.publisher,
            "_sensors": calls.sensors,
            "_newest": None,
            "_closing": False,
            "_preparing": False,
            "_stop": "",
            "_is_held": False,
        }
        for name, part in parts.items():
            setattr(robot, name, part)

    def samples(self, *samples: WheelSample) -> list[Any]:
        """Hand these over; returns the calls because of the last one."""
        for one in samples:
            self.calls.mock_calls.clear()
            self.open._on_sample(one)
        return list(self.calls.mock_calls)


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> Parts:
    monkeypatch.setattr(parameters, "tuning", lambda _: "tuning")
    return Parts()


def test_a_callback_of_the_driver_that_fails_stops_the_robot_and_ends_the_node(
    parts: Parts,
) -> None:
    error = RuntimeError("a defect")
    parts.calls.update_state.side_effect = error
    for report in (parts.open._on_held, parts.open._on_stop):
        parts.calls.mock_calls.clear()
        report(Mock())
        assert parts.calls.mock_calls[-2:] == [
            call.connection.robot.shutdown(),
            call.threads.fail(error),
        ]


def test_a_thread_of_samples_that_fails_stops_the_robot_first(parts: Parts) -> None:
    error = RuntimeError("a defect")
    parts.open._fail(error)
    expected = [call.connection.robot.shutdown(), call.threads.fail(error)]
    assert [made for made in parts.calls.mock_calls if made != call.context.ok()] == expected


def test_a_failure_to_close_is_ignored(parts: Parts) -> None:
    parts.open._closing = True
    parts.open._fail(RuntimeError("the closing"))
    assert parts.calls.mock_calls == []


def test_the_end_ignores_commands_then_stops_then_gives_back(parts: Parts) -> None:
    parts.open.close()
    assert parts.calls.mock_calls == [
        call.connection.deactivate(),
        call.connection.robot.shutdown(),
        call.resources.close(),
    ]


def test_where_the_robot_is_lost_or_back_its_session_is_prepared(parts: Parts) -> None:
    parts.open._on_reach()
    assert parts.calls.mock_calls == [
        call.threads.requests.submit(parts.open._prepare),
        call.update_state(),
    ]
    parts.open._on_reach()  # one preparation at a time
    assert len(parts.calls.threads.requests.submit.mock_calls) == 1
    parts.open._prepare()
    assert parts.calls.connection.follow.mock_calls == [call()]
    parts.open._on_reach()
    assert len(parts.calls.threads.requests.submit.mock_calls) == 2


def test_a_preparation_that_fails_in_an_unknown_way_stops_the_robot(parts: Parts) -> None:
    parts.calls.connection.follow.side_effect = RuntimeError("a defect")
    parts.open._prepare()
    assert call.connection.robot.shutdown() in parts.calls.mock_calls
    assert not parts.open._preparing


def test_a_new_session_s_geometry_reaches_commands_and_odometry(parts: Parts) -> None:
    parts.calls.connection.drive = "geometry"
    parts.open._on_session()
    assert parts.calls.bridge.mirror.mock_calls == [call(parts.calls.connection.robot)]
    assert parts.calls.connection.tuning == "tuning"
    assert parts.calls.estimator.drive == "geometry"


@pytest.mark.parametrize("after", [IDLE, TIMED_OUT, FAULT])
def test_the_commands_hear_of_each_end_of_a_drive(parts: Parts, after: SupervisorState) -> None:
    assert call.connection.note_standstill() not in parts.samples(sample(state=DRIVING))
    assert call.connection.note_standstill() not in parts.samples(sample(state=DRIVING))
    assert call.connection.note_standstill() in parts.samples(sample(state=after))
    assert call.connection.note_standstill() not in parts.samples(sample(state=after))


def test_each_change_of_state_or_faults_is_reported(parts: Parts) -> None:
    told = call.update_state()
    assert told in parts.samples(sample(state=IDLE))
    assert told not in parts.samples(sample(state=IDLE))
    assert told in parts.samples(sample(state=DRIVING))
    parts.calls.resets.note.return_value = True
    assert told in parts.samples(sample(state=DRIVING))


def test_a_sample_is_counted_also_where_it_is_not_published(parts: Parts) -> None:
    parts.calls.connection.active = False
    one = sample()
    made = parts.samples(one)
    assert call.estimator.update(one) in made
    assert not parts.calls.publisher.publish.mock_calls
    parts.calls.connection.active = True
    parts.samples(one)
    assert len(parts.calls.publisher.publish.mock_calls) == 1
    parts.calls.context.ok.return_value = False
    parts.samples(one)
    assert len(parts.calls.publisher.publish.mock_calls) == 1


def test_odom_goes_forward_where_a_silent_robot_is_back(parts: Parts) -> None:
    """With /clock the two streams of time differ: a late sample is older than a held message."""
    clock_s = [100.0]
    parts.open._time_base = TimeBase(
        lambda: round(clock_s[0] * 1e9), Mock(), is_simulated=lambda: True
    )
    parts.calls.notes.replay = None
    parts.calls.connection.driven_until_s = 0.0
    parts.samples(sample(stamp=time.monotonic() - 0.01))
    (_, first_ns, odom_ns) = parts.calls.publisher.publish.mock_calls[-1].args
    assert first_ns == pytest.approx(odom_ns, abs=1e7)
    clock_s[0] += 0.1
    parts.open._on_silent()
    (_, nothing, held_ns) = parts.calls.publisher.publish.mock_calls[-1].args
    assert nothing is None
    clock_s[0] += 0.05
    parts.samples(sample(stamp=time.monotonic() - 0.1))
    (_, stamp_ns, back_ns) = parts.calls.publisher.publish.mock_calls[-1].args
    assert odom_ns < held_ns < back_ns
    assert first_ns < stamp_ns < held_ns
