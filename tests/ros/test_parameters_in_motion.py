"""Parameters that somebody sets while the robot drives: what is refused then stops nothing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter

from support.ros import Repeater
from support.ros_rig import NODE, SPEED_MPS, Rig, open_rig, twist
from wheelwire_protocol.codes import SupervisorState

GEOMETRY: dict[str, Any] = {
    "wheel_radius": 0.05,
    "wheel_separation": 0.3,
    "counts_per_revolution": 720,
    "left_encoder_inverted": True,
    "ttl_max_s": 3.0,
}
RATE_HZ = 5.0
"""Of a planner; a stop in between would be seen for a fifth of a second."""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    # On a busy computer a command may come late: what the test looks for is not that.
    with open_rig(tmp_path_factory.mktemp("rig"), cmd_vel_timeout=2.0, ttl_max_s=2.0) as rig:
        yield rig


@pytest.fixture
def before(rig: Rig) -> dict[str, Any]:
    return {name: rig.graph.parameter(NODE, name) for name in GEOMETRY}


def messages(values: dict[str, Any]) -> list[Any]:
    return [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]


def driving(rig: Rig) -> Repeater:
    return Repeater(rig.commands, lambda: twist(SPEED_MPS), RATE_HZ)


def reach_full_speed(rig: Rig) -> None:
    rig.truth(lambda state: min(state.left_mps, state.right_mps) > 0.95 * SPEED_MPS)
    rig.simulator.take_states()


def drove_on(rig: Rig) -> bool:
    """Whether it did so since it had reached its speed, and does so a while later."""
    rig.wait_past(0.5)
    return all(
        state.state is SupervisorState.DRIVING
        and min(state.left_mps, state.right_mps) > 0.9 * SPEED_MPS
        for state in rig.simulator.take_states()
    )


def test_requests_are_refused_or_obeyed_and_the_robot_drives_on(
    rig: Rig, before: dict[str, Any]
) -> None:
    def set_all(values: dict[str, Any]) -> bool:
        """All values or none; whether they were set."""
        service = f"{NODE}/set_parameters_atomically"
        answer = rig.graph.call(SetParametersAtomically, service, parameters=messages(values))
        return bool(answer.result.successful)

    gain = rig.graph.parameter(NODE, "proportional_gain")
    with driving(rig):
        reach_full_speed(rig)
        results = rig.graph.set_parameters(NODE, messages(GEOMETRY))
        assert [result.successful for result in results] == [False] * len(GEOMETRY)
        assert all("Not possible while driving" in result.reason for result in results)
        assert not set_all({"proportional_gain": gain * 1.01, **GEOMETRY})
        assert rig.graph.parameter(NODE, "proportional_gain") == gain
        allowed = {"proportional_gain": 1.2, "integral_gain": 15.0}
        assert set_all(allowed)
        assert drove_on(rig)
    assert {name: rig.graph.parameter(NODE, name) for name in allowed} == allowed
    assert {name: rig.graph.parameter(NODE, name) for name in GEOMETRY} == before
