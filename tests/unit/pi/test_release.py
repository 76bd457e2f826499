"""Which pins let go of the wheels, by a table written by hand, and when pigpiod is sent them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pigpio
import pytest

from support.stage_boards import PI, PINS, STANDBY, board_of
from wheelwire.pi.gpio import gpiozero, pigpiod
from wheelwire.pi.gpio.base import HIGH_Q15, Gpio, pwm_pins, release_pins
from wheelwire.pi.gpio.pigpiod import PigpiodGpio
from wheelwire.pi.settings import McuSettings
from wheelwire.tools.files.board import load_board, shipped_boards
from wheelwire_protocol.codes import Fault, SupervisorState
from wheelwire_protocol.core import Outputs, StageInputs
from wheelwire_protocol.power_stages import OUTPUTS, Stage

SCRIPT = 7
LOW = StageInputs(0, 0, 0, 0, 0)
STAGES = {
    Stage.ENABLE_IN1_IN2: (("enable", "in1", "in2"), ("enable",)),
    Stage.PWM_IN1_IN2: (("in1", "in2", "pwm"), ("in1", "in2", "pwm")),
    Stage.IN_IN: (("in1", "in2"), ("in1", "in2")),
    Stage.HALF_BRIDGES: (("enable", "in1", "in2"), ("enable", "in1", "in2")),
    Stage.PWM_DIR: (("pwm", "dir"), ("pwm",)),
}
"""By hand: the inputs of each stage, and those of them that let the motor coast when they are low.
The others of a stage only choose a direction."""
HELD = [(stage, side) for stage in STAGES for side in (0, 1)]


def released(stage: Stage) -> set[int]:
    return {gpio for name in STAGES[stage][1] for gpio in PINS[name]}


class Daemon:
    """A client that writes down its calls, with what the daemon would answer."""

    library = pigpio
    address = "here"

    def __init__(self, *_: object) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.status = pigpio.PI_SCRIPT_RUNNING

    def call(self, method: str, *arguments: Any) -> Any:
        self.calls.append((method, *arguments))
        if method == "script_status":
            mine = arguments[0] == SCRIPT and self.find("store_script")
            return (self.status, ()) if mine else (pigpio.PI_SCRIPT_HALTED, ())
        if method == "run_script":
            self.status = pigpio.PI_SCRIPT_RUNNING
        return SCRIPT

    def find(self, method: str) -> list[int]:
        """Where in the order of the calls these are."""
        return [place for place, call in enumerate(self.calls) if call[0] == method]

    def outputs(self) -> dict[int, int]:
        """The newest duty or level of each output that was sent, by GPIO."""
        setters = ("write", "hardware_PWM", "set_PWM_dutycycle")
        return {call[1]: call[-1] for call in self.calls if call[0] in setters}

    def check(self) -> None: ...

    def close(self) -> None: ...


@pytest.fixture
def daemon(monkeypatch: pytest.MonkeyPatch) -> Daemon:
    daemon = Daemon()
    monkeypatch.setattr(pigpiod, "PigpioClient", lambda *_: daemon)
    return daemon


def open_pins(stage: Stage, standby: int | None = None) -> PigpiodGpio:
    parameters = {"pwm_frequency_hz": 20_000.0, "glitch_filter_ns": 1000.0}
    return PigpiodGpio(McuSettings("pigpio", board_of(stage, standby)), parameters)


def drive(gpio: PigpiodGpio, stage: Stage) -> None:
    """All inputs high: what is sent does not depend on the core."""
    high = {f"{name}_q15": HIGH_Q15 for name in STAGES[stage][0]}
    gpio.left.apply(LOW._replace(**high))
    gpio.right.apply(LOW._replace(**high))


def driven(stage: Stage) -> set[int]:
    return {gpio for name in STAGES[stage][0] for gpio in PINS[name]}


@pytest.mark.parametrize("standby", [None, STANDBY])
@pytest.mark.parametrize("stage", STAGES)
def test_both_wheels_and_standby_are_let_go_of(stage: Stage, standby: int | None) -> None:
    expected = released(stage) | ({standby} if standby is not None else set())
    assert set(release_pins(board_of(stage, standby))) == expected
    assert len(release_pins(board_of(stage, standby))) == len(expected)


SHIPPED = {
    "bts7960": {25, 26, 27, 33, 32, 4},
    "drv8833": {26, 27, 32, 4, 21},
    "esp32c6": {10, 11},
    "esp32s3": {4, 7},
    "l298n": {25, 33},
    "mdd10a": {25, 33},
    "pi4b": {18, 19},
    "tb6612": {25, 26, 27, 33, 32, 4, 21},
}
"""By hand, from the boards' files: the GPIOs that have to be low for both motors to be off."""


def test_each_shipped_board_has_its_release_pins() -> None:
    assert {name: set(release_pins(load_board(name))) for name in shipped_boards()} == SHIPPED


@pytest.mark.parametrize(("stage", "side"), HELD)
def test_each_high_input_that_drives_or_brakes_a_wheel_holds_the_board(
    stage: Stage, side: int
) -> None:
    gpio = SimpleNamespace(board=board_of(stage))
    for name in OUTPUTS:
        wheels = [LOW, LOW]
        wheels[side] = LOW._replace(**{f"{name}_q15": 1})
        outputs = Outputs(wheels[0], wheels[1], 0, 1000, SupervisorState.IDLE, Fault(0))
        assert Gpio.is_released(cast("Gpio", gpio), outputs) is (name not in STAGES[stage][1])


@pytest.mark.parametrize("stage", STAGES)
def test_the_watchdog_runs_before_any_output_is_set_and_pulls_each_wheel_low(
    daemon: Daemon, stage: Stage
) -> None:
    open_pins(stage, STANDBY)
    (stored,), (run,) = daemon.find("store_script"), daemon.find("run_script")
    setters = [*daemon.find("write"), *daemon.find("hardware_PWM")]
    setters += [*daemon.find("set_PWM_dutycycle"), *daemon.find("set_PWM_frequency")]
    assert stored < run < min(setters)
    countdown, _, rest = daemon.calls[stored][1].decode().partition(" jp 0 ")
    words = rest.split()
    assert countdown == "tag 0 mils 10 dcr p0"
    assert words[-1] == "halt"
    assert set(words[:-1:3]) == {"w"}
    assert set(words[2::3]) == {"0"}
    assert {int(word) for word in words[1::3]} == released(stage) | {STANDBY}
    assert daemon.calls[run][2][0] == 11


def test_the_watchdog_is_refreshed_each_20_ms(daemon: Daemon) -> None:
    gpio = open_pins(Stage.IN_IN)
    for now_us in range(0, 100_000, 1000):
        gpio.keep_alive(now_us)
    refreshed = daemon.find("update_script")
    assert len(refreshed) == 5
    # All of its parameters: the counter alone would leave the pins of another script.
    assert {tuple(daemon.calls[place][2]) for place in refreshed} == {
        tuple(daemon.calls[daemon.find("run_script")[0]][2])
    }


@pytest.mark.parametrize("stage", STAGES)
def test_after_the_watchdog_has_acted_each_output_of_both_wheels_is_sent_again(
    daemon: Daemon, stage: Stage
) -> None:
    gpio = open_pins(stage, STANDBY)
    gpio.keep_alive(0)
    drive(gpio, stage)
    daemon.calls.clear()
    drive(gpio, stage)
    assert daemon.outputs() == {}  # nothing has changed
    daemon.calls.append(("store_script",))  # which `clear` forgot
    daemon.status = pigpio.PI_SCRIPT_HALTED
    gpio.keep_alive(20_000)
    assert len(daemon.find("run_script")) == 1
    drive(gpio, stage)
    sent = daemon.outputs()
    assert set(sent) == driven(stage) | {STANDBY}
    assert all(sent.values())


@pytest.mark.parametrize("stage", STAGES)
def test_at_the_end_both_wheels_are_low_before_the_watchdog_goes(
    daemon: Daemon, stage: Stage
) -> None:
    gpio = open_pins(stage)
    drive(gpio, stage)
    daemon.calls.clear()
    gpio.close()
    (end,) = daemon.find("delete_script")
    before = daemon.calls[:end]
    lows = {call[1] for call in before if call[0] != "script_status" and call[-1] == 0}
    assert lows == released(stage)
    assert daemon.find("stop_script") == []  # another program could take its number meanwhile


class HeldPins:
    """A pin factory whose pins are another process's for some attempts."""

    def __init__(self, held: dict[int, int]) -> None:
        self._held = held
        self.low: list[int] = []

    def pin(self, gpio: int) -> SimpleNamespace:
        self._held[gpio] = self._held.get(gpio, 0) - 1
        if self._held[gpio] >= 0:
            raise OSError(f"GPIO{gpio}: GPIO busy")
        return SimpleNamespace(output_with_state=lambda level: self.low.append(gpio * (1 - level)))


FOR_EVER = 1_000_000


@pytest.mark.parametrize(
    ("held", "low"),
    [
        ({18: 3, 19: 5}, [18, 19]),  # the dead core's, for a moment
        ({18: FOR_EVER}, [19]),
        ({19: FOR_EVER}, [18]),
    ],
)
def test_the_guard_pulls_each_pin_low_that_it_can_have(
    monkeypatch: pytest.MonkeyPatch, held: dict[int, int], low: list[int]
) -> None:
    factory = HeldPins(dict(held))
    monkeypatch.setattr(gpiozero, "pin_factory", lambda: factory)
    monkeypatch.setattr(gpiozero, "kernel_channels", lambda _: None)
    gpiozero.EnableLow(McuSettings("l298n", PI))()
    assert factory.low == low


@pytest.mark.parametrize("stage", STAGES)
def test_the_guard_releases_both_wheels_with_and_without_the_kernels_pwm(
    monkeypatch: pytest.MonkeyPatch, stage: Stage
) -> None:
    board = board_of(stage, STANDBY)
    for by_kernel in (False, True):
        factory, off = HeldPins({}), list[int]()
        monkeypatch.setattr(gpiozero, "pin_factory", lambda: factory)  # noqa: B023
        channels = [
            SimpleNamespace(close=lambda gpio=gpio: off.append(gpio))  # noqa: B023
            for gpio in pwm_pins(board)
        ]
        monkeypatch.setattr(gpiozero, "kernel_channels", lambda _: channels if by_kernel else None)  # noqa: B023
        gpiozero.EnableLow(McuSettings("l298n", board))()
        assert set(off) == (set(pwm_pins(board)) if by_kernel else set())
        assert set(off) | set(factory.low) >= released(stage) | {STANDBY}
        assert not set(off) & set(factory.low)
