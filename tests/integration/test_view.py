"""The view on the whole screen, with simulated robots, without a terminal."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("textual")
from support.full_disk import no_space
from support.viewing import Viewing, viewing
from support.waiting import wait_until
from wheelwire.connect import open_driver
from wheelwire.drivers.attached import AttachedDriver
from wheelwire.drivers.mock import MockDriver
from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import InvalidArgument, LinkClosed
from wheelwire.log.reader import records
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.attach import open_or_attach
from wheelwire.tools.view.tuning import LOST
from wheelwire_protocol.codes import SupervisorState

IDLE, ESTOPPED = SupervisorState.IDLE, SupervisorState.ESTOPPED
SIZES = [(80, 24), (60, 20), (200, 60), (30, 8)]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where r records to."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def robot() -> Iterator[MockDriver]:
    robot = open_driver("mock")
    assert isinstance(robot, MockDriver)
    with robot:
        yield robot


async def begin_to_drive(at: Viewing) -> None:
    await at.press("t", "y")
    await at.sees("keys drive, speed 4: 0.16 m/s")
    await at.drives()


async def tune(at: Viewing, name: str, value: str) -> None:
    """Give a parameter a value on trial, on the parameters' screen."""
    table = at.app.screen.query_one("#table")
    names = list(at.app.controls.tuning.infos)
    table.move_cursor(row=names.index(name))  # type: ignore[attr-defined]
    await at.press("enter", *value, "enter")
    await at.until(lambda: "on trial" in at.value_of(name))


async def open_parameters(at: Viewing) -> None:
    await at.press("p")
    await at.until(lambda: at.app.controls.tuning.infos)
    await at.sees("wheel_radius, 0.005 to 1 m")


@pytest.mark.parametrize("size", SIZES)
async def test_it_shows_a_robot_at_any_size(robot: MockDriver, size: tuple[int, int]) -> None:
    async with viewing(robot, size) as at:
        for text in ("IDLE: Stopped", "LEFT asked", "RIGHT asked", "supply", "space stop"):
            await at.sees(text)
        await at.until(lambda: "Hz" in at.screen)


async def test_the_help_and_the_question_fit_the_narrow_screen(robot: MockDriver) -> None:
    async with viewing(robot, (60, 20)) as at:
        for key in ("?", "t"):
            await at.press(key)
            await at.until(lambda: [t for t in at.app.screen.query("#text") if t.size.height])
            text = at.app.screen.query_one("#text")
            lines = str(text.render()).split("\n")
            assert text.size.height == len(lines)
            assert text.size.width >= max(map(len, lines))
            await at.press("n")
            await at.sees("LEFT")


async def test_it_drives_after_a_yes_until_space_escape_or_the_end(robot: MockDriver) -> None:
    async with viewing(robot) as at:
        for answer in ("n", "enter", "w"):
            await at.press("t", answer, "w", "w")
            assert at.app.controls.hand is None
            await at.sees("t drive")
        assert robot.read().state is IDLE
        await begin_to_drive(at)
        await at.drives(until="asked +0.16")
        await at.press("space")
        await at.sees("IDLE: Stopped")
        await at.hears("stopped")
        await at.drives()
        await at.press("escape")
        await at.hears("the keys no longer drive")
        await at.sees("IDLE: Stopped")
        await begin_to_drive(at)
    # Quitting stops the wheels first.
    assert at.app.controls.hand is None
    wait_until(lambda: robot.simulator.get("stands_still"))
    assert robot.read().state is IDLE


async def test_an_estop_latches_on_every_screen_and_a_clear_ends_it(robot: MockDriver) -> None:
    async with viewing(robot) as at:
        for screen in ("", "p", "t", "?"):
            if screen:
                await at.press(screen)
            await at.press("e")
            wait_until(lambda: robot.read().state is ESTOPPED)
            await at.press("escape")
            await at.sees("ESTOPPED: Emergency stop")
            await at.sees("Look first at")
            await at.press("c")
            await at.sees("IDLE: Stopped")
        await at.hears("ESTOPPED cleared")


# --- parameters ----------------------------------------------------------------------------------


async def test_a_value_is_on_trial_until_it_is_undone_reverted_or_saved(robot: MockDriver) -> None:
    async with viewing(robot) as at:
        await open_parameters(at)
        at.app.screen.query_one("#table").move_cursor(row=5)  # type: ignore[attr-defined]
        for value, complaint in (("99", "at most 10"), ("-", "give a number")):
            await at.press("enter", *value, "enter")
            await at.hears(complaint)
            assert not at.app.controls.tuning.is_active
        await tune(at, "max_velocity_mps", "0.3")
        assert at.value_of("max_velocity_mps") == "0.3 on trial, was 0.4"
        assert robot.geometry.max_velocity_mps == pytest.approx(0.3)
        await tune(at, "max_duty", "0.7")
        await at.press("u")
        await at.until(lambda: at.value_of("max_duty") == "1")
        assert robot.geometry.max_velocity_mps == pytest.approx(0.3)
        await at.press("r")
        await at.until(lambda: at.value_of("max_velocity_mps") == "0.4")
        assert not at.app.controls.tuning.is_active
        for _ in range(5):  # the values are known from the first time
            await at.press("escape")
            await at.sees("LEFT")
            await open_parameters(at)
        await tune(at, "max_velocity_mps", "0.3")
        await at.press("s")
        await at.hears("saved: max_velocity_mps")
        await at.until(lambda: at.value_of("max_velocity_mps") == "0.3")
        await tune(at, "max_duty", "0.7")
    assert robot.parameters["max_velocity_mps"] == pytest.approx(0.3)
    # Quitting has reverted what was still on trial.
    assert robot.parameters["max_duty"] == 1


async def test_values_that_the_file_sets_are_not_saved(robot: MockDriver) -> None:
    def refuse(name: str) -> None:
        raise InvalidArgument(f"the file sets {name}")

    async with viewing(robot, check_save=refuse) as at:
        await open_parameters(at)
        await tune(at, "max_velocity_mps", "0.3")
        await at.press("s")
        await at.hears("the file sets max_velocity_mps")
        assert at.app.controls.tuning.is_active


async def test_a_lost_link_reverts_the_trial_and_the_view_goes_on(robot: MockDriver) -> None:
    async with viewing(robot) as at:
        await open_parameters(at)
        await tune(at, "max_duty", "0.7")
        await at.press("escape")
        await begin_to_drive(at)
        robot.unplug()
        await at.sees("OUT OF REACH")
        await at.hears(LOST)
        await at.press("w", "space", "e", "c", "r")
        robot.plug()
        await at.sees("IDLE: Stopped")
        await at.hears("the link is back")
        await open_parameters(at)
        await at.until(lambda: at.value_of("max_duty") == "1")


# --- recording -----------------------------------------------------------------------------------


async def test_it_records_until_the_key_comes_again_or_the_disk_is_full(
    robot: MockDriver, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with viewing(robot) as at:
        await at.press("r")
        await at.sees("recording wheelwire-")
        await at.press("r")
        await at.hears("recorded: ")
        await at.until(lambda: "recording" not in at.screen.split("\n", 1)[0])
        (file,) = folder.iterdir()
        assert list(records(file))
        await at.press("r")
        await at.hears("recording to ")
        monkeypatch.setattr("wheelwire.log.recorder.os.write", no_space)
        await at.hears("No space left on device")
        await at.sees("IDLE: Stopped")


# --- beside a program that holds the port --------------------------------------------------------


@pytest.fixture
def holder() -> Iterator[SerialDriver]:
    with Simulator() as simulator, SerialDriver(simulator.port) as holder:
        yield holder


async def test_attached_it_looks_stops_and_estops_and_ends_with_the_holder(
    holder: SerialDriver,
) -> None:
    attached = open_or_attach("serial", {"port": holder.info.port})
    assert isinstance(attached, AttachedDriver)
    refusal = f"not from this view: {attached.holder.name}, holds the port"
    with attached:
        async with viewing(attached) as at:
            await at.sees("only looks and stops")

            def is_shown() -> bool:
                holder.set_velocity(0.1, 0.0, ttl=0.9)
                return at.shows("asked +0.10") and at.shows("DRIVING")

            await at.until(is_shown)
            await at.press("t")
            await at.hears(refusal)
            await at.press("r")
            assert at.app.controls.hand is None
            assert not at.app.controls.recording
            await at.press("space")
            await at.hears("stopped; the next setpoint of")
            await open_parameters(at)
            await at.press("enter", "1", "enter")
            assert not at.app.controls.tuning.is_active
            await at.press("escape", "e")
            await at.sees("ESTOPPED: Emergency stop")
            at.app.model.events.clear()  # what was just said is not said again
            await at.press("c")
            await at.hears(refusal)
            await at.sees("ESTOPPED: Emergency stop")
            await at.press("p")
            holder.close()
            await at.until(lambda: not at.app.is_running)
    assert isinstance(at.app.failure, LinkClosed)


# --- recordings ----------------------------------------------------------------------------------


async def test_a_recording_is_shown_with_its_stops_and_stays_at_its_end(folder: Path) -> None:
    file = folder / "day.mcap"
    with open_driver("mock", record=file) as robot:
        for _ in range(20):
            robot.set_velocity(0.2, 0.0, ttl=0.9)
            time.sleep(0.1)
        robot.estop()
        wait_until(lambda: robot.read().state is ESTOPPED)
    with open_driver("replay", file=file) as day:
        async with viewing(day, recording=file) as at:
            await at.sees("a recording")
            await at.hears("DRIVING")
            await at.hears("The emergency stop was requested over this link")
            await at.sees("ENDED: the recording has ended")
            for key in ("space", "e", "c", "t", "r"):
                await at.press(key)
            await at.hears("not from this view: this is a recording")
            assert at.app.is_running
    assert at.app.failure is None
