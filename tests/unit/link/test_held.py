"""After the chip has restarted, a program that never stopped asking for motion gets none."""

from __future__ import annotations

from contextlib import suppress

import pytest

from support.virtual_line import VirtualLine
from wheelwire.errors import DeviceRefused, LinkLost, WheelwireError
from wheelwire.link.handover import resumed, start_of
from wheelwire.link.session import Phase
from wheelwire_protocol.codes import RefusalCode
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import ClearEstop, ParameterValue, SetDuty, SetWheelVelocity

GAPS = tuple(PARAMETER_BY_NAME[name].id for name in ("rearm_gap_s", "ttl_max_s"))


class WarnedLine(VirtualLine):
    """A line that has its session's warnings."""

    def __init__(self, **parameters: float) -> None:
        super().__init__(watched=GAPS)
        self.device.parameters.update(parameters)
        self.device.reset()
        self.warnings: list[str] = []
        self.session.warn_held = lambda text, *of: self.warnings.append(text % of)
        self.open()

    def moved(self) -> bool:
        """Whether the device has obeyed a setpoint that moves it since the last call."""
        obeyed = [m for m in self.device.obeyed if m[-2:] != (0.0, 0.0)]
        self.device.forget()
        return bool(obeyed)

    def asked(self) -> bool:
        """Whether a setpoint of this session has reached the device, which may have refused it."""
        setpoints = self.device.asked(SetWheelVelocity) + self.device.asked(SetDuty)
        return any(one.session_id == self.session.id for one in setpoints)

    def publish(self, seconds: float, period_s: float = 0.05) -> list[int | None]:
        """Ask for motion, as a program that handles each error; what each call came to."""
        codes: list[int | None] = []
        for _ in range(round(seconds / period_s)):
            try:
                self.drive()
            except DeviceRefused as refused:
                codes.append(refused.code)
            except WheelwireError:  # out of reach
                codes.append(None)
            self.run(period_s)
        return codes

    def outage(self, seconds: float, *, reset: bool) -> None:
        """The line is cut for this time, and the program goes on publishing."""
        self.publish(0.2)
        assert self.moved()
        if reset:
            self.device.reset()
        losses = self.to_host.impairment, self.to_device.impairment
        for one in losses:
            one.loss = 1.0
        self.publish(seconds)
        for one in losses:
            one.loss = 0.0
        self.device.forget()


@pytest.fixture
def warned() -> WarnedLine:
    return WarnedLine()


@pytest.fixture
def held(warned: WarnedLine) -> WarnedLine:
    """The chip has restarted, and the program asks for motion in vain."""
    warned.outage(0.3, reset=True)
    assert warned.publish(1.0)
    return warned


@pytest.mark.parametrize("outage_s", [0.3, 3.0])
@pytest.mark.parametrize("period_s", [0.02, 0.3, 0.55, 0.9])
def test_a_program_that_publishes_through_a_reset_is_held_and_warned_once(
    warned: WarnedLine, outage_s: float, period_s: float
) -> None:
    warned.outage(outage_s, reset=True)
    codes = warned.publish(6.0, period_s)
    assert not warned.asked()
    assert set(codes) <= {None, RefusalCode.UNARMED}
    assert codes[-1] == RefusalCode.UNARMED
    assert warned.session.setpoints.is_unarmed
    assert warned.warnings == [
        "the robot is held: unarmed; send a zero setpoint (robot.set_velocity(0, 0)) or pause for "
        "1 s"
    ]


def test_a_zero_setpoint_ends_it_at_once(warned: WarnedLine) -> None:
    warned.outage(3.0, reset=True)
    warned.publish(1.0)
    warned.drive(0.0, 0.0)
    assert set(warned.publish(0.2)) == set()
    assert warned.moved()
    assert not warned.session.setpoints.is_unarmed


@pytest.mark.parametrize("pair", [(0.1, 0.0), (0.0, -0.1), (0.1, -0.1)])
def test_one_wheel_at_rest_is_no_zero_nor_is_a_duty_let_through(
    held: WarnedLine, pair: tuple[float, float]
) -> None:
    for ask in (held.set_velocity, held.set_duty):
        with pytest.raises(DeviceRefused):
            ask(*pair)
    held.run(0.05)
    assert not held.asked()


def test_a_stop_does_not_end_it(held: WarnedLine) -> None:
    held.stop()
    assert held.publish(1.0)[-1] == RefusalCode.UNARMED
    assert not held.asked()


def test_so_does_a_pause(warned: WarnedLine) -> None:
    warned.outage(3.0, reset=True)
    assert warned.publish(1.0)
    assert warned.session.setpoints.is_unarmed
    warned.run(1.01)
    assert not warned.session.setpoints.is_unarmed
    assert warned.publish(0.2) == []
    assert warned.moved()


@pytest.mark.parametrize(
    ("gap", "gap_s"), [("rearm_gap_s", 2.0), ("ttl_max_s", 2.0), ("rearm_gap_s", 0.0)]
)
def test_the_pause_is_the_longer_one_of_the_devices_two_times(gap: str, gap_s: float) -> None:
    warned = WarnedLine(**{gap: gap_s})
    warned.outage(0.3, reset=True)
    pause_s = max(gap_s, 1.0)
    assert warned.publish(3 * pause_s, pause_s - 0.05)[-1] == RefusalCode.UNARMED
    assert not warned.asked()
    assert f"pause for {pause_s:g} s" in warned.warnings[0]
    warned.run(0.1)
    assert warned.publish(0.2) == []


def test_a_lost_link_without_a_reset_holds_nobody(warned: WarnedLine) -> None:
    warned.outage(3.0, reset=False)
    warned.run_until(lambda: warned.session.phase is Phase.OPEN)
    assert warned.publish(0.2) == []
    assert warned.moved()
    assert warned.warnings == []


def test_a_session_that_is_lost_meanwhile_holds_on(held: WarnedLine) -> None:
    held.session.renew(LinkLost("the computer was suspended"), held.now_us)
    assert RefusalCode.UNARMED in held.publish(3.0)
    assert not held.asked()
    assert len(held.warnings) == 1


def test_a_slow_preparation_does_not_count_as_a_pause(warned: WarnedLine) -> None:
    warned.publish(0.2)
    warned.device.lost.add(ParameterValue)
    warned.device.reset()
    warned.publish(3.0)
    warned.device.forget()
    warned.device.lost.clear()
    assert warned.publish(3.0)[-1] == RefusalCode.UNARMED
    assert not warned.asked()


def test_the_next_reset_is_reported_again(warned: WarnedLine) -> None:
    for times in (1, 2):
        warned.outage(0.3, reset=True)
        warned.publish(0.5)
        assert len(warned.warnings) == times
        warned.drive(0.0, 0.0)
        warned.publish(0.1)


def test_a_zero_that_has_expired_ends_nothing(held: WarnedLine) -> None:
    with pytest.raises(WheelwireError, match="ttl"):
        held.drive(0.0, 0.0, ttl_s=0.0)
    assert held.publish(0.5)
    assert not held.asked()


def test_a_resumed_session_knows_what_is_held(held: WarnedLine) -> None:
    follower = resumed(start_of(held.session), lambda: 0)
    assert follower.setpoints.held == held.session.setpoints.held
    assert follower.setpoints.is_unarmed
    with pytest.raises(DeviceRefused):
        follower.setpoints.frame(SetWheelVelocity, 0.1, 0.1, held.now_us + 500_000, held.now_us)


def test_a_refusal_by_the_device_is_reported_too(warned: WarnedLine) -> None:
    warned.estop()
    warned.run(0.05)
    warned.request(ClearEstop(0, 0))
    assert warned.publish(1.0)
    assert not warned.moved()
    assert len(warned.warnings) == 1
    warned.drive(0.0, 0.0)
    with suppress(DeviceRefused):
        warned.publish(0.1)
    assert warned.moved()
    assert not warned.session.setpoints.is_unarmed
