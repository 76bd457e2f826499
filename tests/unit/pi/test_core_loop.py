"""The loop that steps the core, in virtual time: when the drive goes, and by whose doing."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import pytest

from wheelwire.board import Configuration
from wheelwire.errors import LinkLost
from wheelwire.pi import core as core_module
from wheelwire.pi.core import McuLoop, make_core
from wheelwire.pi.gpio.base import Gpio, StagePins, WheelPair, inputs_of
from wheelwire.pi.line import Line
from wheelwire.pi.pins import Pins
from wheelwire.pi.settings import McuSettings
from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.codes import StopMode, SupervisorEvent, SupervisorState
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import (
    AnyMessage,
    DeviceHello,
    Event,
    Hello,
    ParameterSet,
    Ping,
    SetDuty,
    Stop,
)

PERIOD_US = 10_000
"""A Linux computer's control period."""
BRAKE_US = 300_000
HOST, SIGNAL = 10, 11
"""Descriptors."""
NONCE = 5
STOP_MODE = PARAMETER_BY_NAME["stop_mode"].id
FOREVER_US = 10_000_000
ARMED = (SupervisorEvent.STOP, 2600)
"""What ends the zero setpoint that arms the robot, and when."""


class Wires(StagePins):
    """The inputs of a stage; notes when the motor is driven, braked or let go."""

    def __init__(self, board: Configuration, world: World) -> None:
        super().__init__(inputs_of(board))
        self._world = world
        self.duty = dict.fromkeys(inputs_of(board), 0.0)

    @property
    def motion(self) -> str:
        if not self.duty["enable"]:
            return "coast"
        return "brake" if self.duty["in1"] == self.duty["in2"] else "drive"

    def set_input(self, name: str, duty: float) -> None:
        self.duty[name] = duty
        self._world.note()


class FakeGpio(Gpio):
    def __init__(self, board: Configuration, world: World) -> None:
        self.board = board
        self._world = world
        self.left, self.right = Wires(board, world), Wires(board, world)

    def ticks(self) -> WheelPair:
        return WheelPair(0, 0)

    def illegal_transitions(self) -> WheelPair:
        self._world.step()  # asked for once in each step, and at no other time
        return WheelPair(0, 0)

    def contact_level(self) -> bool:
        return False

    def keep_alive(self, now_us: int) -> None:
        self._world.kept_us.append(now_us)

    def close(self) -> None: ...


class FakeLine(Line):
    """Bytes that come at given times."""

    def __init__(self, world: World) -> None:
        super().__init__()
        self._world = world
        self.closed_us = 0

    def wait_set(self) -> tuple[list[int], list[int]]:
        return ([] if self.closed_us else [HOST]), []

    def receive(self, ready: list[int]) -> bytes:
        return self._world.take() if HOST in ready else b""

    def send(self, core: object) -> None:
        self._world.received += self._world.decoder.feed(core.take())  # type: ignore[attr-defined]

    def next_host(self) -> bool:
        return False

    def close(self) -> None:
        self.hung_up = False
        self.closed_us = self._world.now_us


class World:
    """A clock that moves only while the loop waits, or where a test says; what happens by it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.start_us = self.now_us = 1_000_000
        self.steps_us: list[int] = []
        self.kept_us: list[int] = []
        self.motions: list[tuple[int, str, str]] = []
        """When the wheels began to do what."""
        self.decoder = Decoder()
        self.encoder = Encoder()
        self.received: list[AnyMessage] = []
        self.beats = 0
        self._plan: list[tuple[int, int, Callable[[], bytes]]] = []
        self._ready: list[tuple[int, int, Callable[[], bytes]]] = []
        self.on_step: Callable[[], None] = lambda: None
        monkeypatch.setattr(
            core_module, "time", SimpleNamespace(monotonic_ns=lambda: self.now_us * 1000)
        )
        monkeypatch.setattr(core_module, "select", SimpleNamespace(select=self._select))
        board = Pins()
        parameters = {"brake_time_s": BRAKE_US / 1e6, "ttl_max_s": 5, "max_duty_rate_per_s": 1000}
        core = make_core(McuSettings("l298n", board, parameters=parameters))
        self.gpio = FakeGpio(board, self)
        self.line = FakeLine(self)
        heartbeat = SimpleNamespace(beat=self._beat)
        self.loop = McuLoop(core, self.gpio, self.line, heartbeat, [SIGNAL])  # type: ignore[arg-type]

    def at(self, us: int, act: Callable[[], bytes], descriptor: int = HOST) -> None:
        """`us` after the start the descriptor is readable; `act` gives what there is to read."""
        self._plan.append((self.start_us + us, descriptor, act))
        self._plan.sort(key=lambda entry: entry[0])

    def send(self, us: int, message: Callable[[], AnyMessage]) -> None:
        self.at(us, lambda: self.encoder.encode(message()))

    def open(self) -> None:
        """A session whose clock is synchronised, of a robot that is armed and coasts."""
        self.send(1000, lambda: Hello(NONCE, PROTOCOL_VERSION, schema_hash()))
        self.send(2000, lambda: Ping(self.session, 1, 0))
        self.send(2500, lambda: SetDuty(self.session, 1, 60_000, 0, 0))
        self.send(ARMED[1], lambda: Stop(self.session, 3, 2, StopMode.COAST))

    def drive(self, us: int, life_us: int) -> None:
        """Both wheels, for a life from now."""
        self.send(us, lambda: SetDuty(self.session, us, us + life_us, 9000, 9000))

    @property
    def session(self) -> int:
        (hello,) = [m for m in self.received if isinstance(m, DeviceHello)]
        return NONCE ^ hello.boot_id

    def run(self) -> int:
        """Until the loop ends; returns when, since the start."""
        self.loop.run()
        return self.now_us - self.start_us

    def end(self, us: int) -> None:
        self.at(us, bytes, SIGNAL)

    def changes(self) -> list[tuple[int, str]]:
        """What both wheels began to do when, since the start."""
        both = [(us - self.start_us, left) for us, left, right in self.motions if left == right]
        return [now for now, (_, before) in zip(both[1:], both, strict=False) if now[1] != before]

    def step(self) -> None:
        self.steps_us.append(self.now_us - self.start_us)
        self.on_step()

    def note(self) -> None:
        motion = (self.now_us, self.gpio.left.motion, self.gpio.right.motion)  # type: ignore[attr-defined]
        if not self.motions or self.motions[-1][1:] != motion[1:]:
            self.motions.append(motion)

    def take(self) -> bytes:
        data = b"".join(act() for _, descriptor, act in self._ready if descriptor == HOST)
        if not data:
            self.line.hung_up = True
        return data

    def _beat(self) -> None:
        self.beats += 1

    def _select(
        self, readable: list[int], _writable: list[int], _errors: list[int], wait_s: float
    ) -> tuple[list[int], list[int], list[int]]:
        assert self.now_us < self.start_us + FOREVER_US, "the loop does not end"
        end_us = self.now_us + round(wait_s * 1e6)
        due = [entry for entry in self._plan if entry[1] in readable and entry[0] <= end_us]
        self.now_us = max(self.now_us, due[0][0]) if due else end_us
        self._ready = [entry for entry in due if entry[0] <= self.now_us]
        self._plan = [entry for entry in self._plan if entry not in self._ready]
        return [entry[1] for entry in self._ready], [], []


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    world = World(monkeypatch)
    world.open()
    return world


def stopped(world: World) -> list[tuple[SupervisorEvent, int]]:
    """What ended a drive, and when by the device's own clock."""
    events = [m for m in world.received if isinstance(m, Event)]
    return [
        (SupervisorEvent(event.cause), event.t_us)
        for event in events
        if event.before == SupervisorState.DRIVING
    ]


DRIVEN_US = 33_000
"""Between two steps; the wheels turn from the next one on."""
LONG_US = 4_000_000


@pytest.mark.parametrize("after_step_us", [1, 2_300, 9_999])
def test_at_its_deadline_a_setpoint_ends_by_a_step_of_its_own(
    world: World, after_step_us: int
) -> None:
    deadline_us = 50_000 + after_step_us
    world.drive(DRIVEN_US, deadline_us - DRIVEN_US)
    world.end(100_000)
    world.run()
    assert world.changes()[:2] == [(40_000, "drive"), (deadline_us, "coast")]
    assert stopped(world) == [ARMED, (SupervisorEvent.DEADLINE, deadline_us)]
    # The regular steps stay where they were.
    first = [us for us in world.steps_us if us < 100_000]
    assert first == sorted([*range(0, 100_000, PERIOD_US), deadline_us])


def test_a_signal_ends_the_drive_at_once_and_the_process_after_the_brake(world: World) -> None:
    world.drive(DRIVEN_US, LONG_US)
    world.end(45_500)
    ended_us = world.run()
    off, brake, coast = world.changes()[1:]
    assert off == (45_500, "coast")
    assert brake == (60_000, "brake")  # a whole period later
    assert coast == (350_000, "coast")
    # In the last steps nothing was set any more.
    assert 360_000 <= ended_us <= 400_000
    assert world.line.closed_us == world.start_us + 45_500


def test_a_signal_just_after_a_first_setpoint_waits_for_its_brake(world: World) -> None:
    """The robot stood for longer than the steps that mean the end of a stop."""
    world.drive(75_400, LONG_US)
    world.end(75_500)
    world.run()
    assert [motion for _, motion in world.changes()] == ["brake", "coast"]


def test_a_host_that_hangs_up_ends_the_drive_at_once(world: World) -> None:
    world.drive(DRIVEN_US, LONG_US)
    world.at(45_500, bytes)
    ended_us = world.run()
    assert world.changes()[1:3] == [(45_500, "coast"), (60_000, "brake")]
    assert 360_000 <= ended_us <= 400_000


def test_a_host_that_never_pauses_delays_neither_a_step_nor_the_deadline(world: World) -> None:
    world.drive(DRIVEN_US, 42_300 - DRIVEN_US)
    for us in range(3_000, 100_000, 100):
        world.send(us, lambda: Ping(world.session, 9, 0))
    world.end(100_000)
    world.run()
    assert world.changes()[:2] == [(40_000, "drive"), (42_300, "coast")]
    assert [us for us in world.steps_us if us < 100_000 and us != 42_300] == [
        *range(0, 100_000, PERIOD_US)
    ]


def test_after_a_delay_there_is_no_burst_of_steps(world: World) -> None:
    def stall() -> None:
        if world.steps_us[-1] == 50_000:
            world.now_us += 45_000

    world.on_step = stall
    world.end(150_000)
    world.run()
    assert len([us for us in world.steps_us if 50_000 < us < 105_000]) <= 2


def test_a_turn_that_was_not_finished_gives_no_beat_and_refreshes_nothing(world: World) -> None:
    def lose() -> None:
        if world.steps_us[-1] == 50_000:
            world.beats = 0
            raise LinkLost("the pins")

    world.on_step = lose
    with pytest.raises(LinkLost):
        world.run()
    assert world.beats == 0
    # In each step, and in no other turn: a loop that makes none must let a watchdog act.
    assert world.kept_us == world.steps_us[:-1]


def test_the_pins_that_are_held_say_when_a_stop_is_over(world: World) -> None:
    """The stop that holds on a slope has no end of its own: the process ends after it began."""
    world.send(5_000, lambda: ParameterSet(world.session, 2, STOP_MODE, StopMode.COAST))
    world.drive(DRIVEN_US, LONG_US)
    world.end(45_500)
    ended_us = world.run()
    assert world.changes()[1:] == [(45_500, "coast")]
    assert 70_000 <= ended_us <= 100_000
