"""`wheelwire why`, for a recording and for a robot that no program watched."""

from __future__ import annotations

import json
import subprocess
import time
from pathlib import Path

import pytest

import wheelwire
from support.command import PROGRAM, run, run_json
from support.waiting import wait_until
from wheelwire.errors import DeviceRefused, RecordingError
from wheelwire.log.why.black_box import read_box
from wheelwire.robot.robot import Robot
from wheelwire.simulation.libfwsim import FwSim
from wheelwire.simulation.simulator import Simulator

pytestmark = pytest.mark.timeout(120)


def drive_into_a_wall(robot: Robot, simulator: Simulator | FwSim) -> None:
    """Until the robot refuses, which it does within seconds."""
    begin = time.monotonic()
    while time.monotonic() < begin + 30.0:
        robot.set_velocity(0.2, 0.0, ttl=1.0)
        robot.read()
        if time.monotonic() > begin + 1.0:
            simulator.set("left.blocked", 1)


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive that a blocked wheel ends."""
    file = tmp_path_factory.mktemp("why") / "day.mcap"
    with wheelwire.open_driver("mock", record=file) as robot:
        robot.simulator.set("supply_ohm", 0.4)
        with pytest.raises(DeviceRefused, match="LEFT_NOT_COUNTING"):
            drive_into_a_wall(robot, robot.simulator)
    return file


def test_a_recording_says_what_stopped_the_robot(day: Path) -> None:
    (stop,) = run_json("why", str(day))
    assert stop["cause"] == "wheel_blocked"
    assert stop["sentence"] == "Left wheel was held fast while driven."
    assert any("the supply sagged" in text for text in stop["evidence"])
    assert stop["look_at"] == "what touches the wheel"
    assert stop["time"].startswith(time.strftime("%Y-"))
    text = run("why", str(day)).stdout
    assert "Left wheel was held fast while driven." in text
    assert "Look first at what touches the wheel." in text


def test_it_draws_the_seconds_around_the_stop(day: Path, tmp_path: Path) -> None:
    picture = tmp_path / "why.png"
    assert run("why", str(day), "--plot", str(picture)).returncode == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_robot_says_what_holds_it_now(tmp_path: Path) -> None:
    with Simulator(link=tmp_path / "port") as simulator:
        assert "Nothing holds the robot" in run("why", simulator.port).stdout
        assert run_json("why", simulator.port) == []
        with wheelwire.connect(simulator.port) as robot:
            robot.estop()
        (stop,) = run_json("why", simulator.port)
    # Its black box says more, if a slow machine has stored one by then.
    assert "estop_by_session" in stop["cause"]


def beside(*arguments: str) -> subprocess.Popen[str]:
    """The command, while this test goes on."""
    return subprocess.Popen(
        [*PROGRAM, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def test_a_robot_that_nobody_watched_tells_of_its_stops(tmp_path: Path) -> None:
    folder = tmp_path / "boxes"
    with Simulator(
        link=tmp_path / "port", store=tmp_path / "store", settings={"supply_ohm": 0.4}
    ) as simulator:
        with wheelwire.connect(simulator.port) as robot:
            time.sleep(9.0)  # no box is stored sooner after a start
            with pytest.raises(DeviceRefused, match="LEFT_NOT_COUNTING"):
                drive_into_a_wall(robot, simulator)
            # Where somebody drives, the boxes stay.
            robot.clear_fault()
            refused = beside("why", simulator.port, "--save-boxes", str(folder))
            while refused.poll() is None:
                robot.set_velocity(0.0, 0.0, ttl=1.0)
                time.sleep(0.1)
            assert refused.returncode == RecordingError.exit_code
            assert "stop it to read its black boxes" in refused.communicate()[1]
            simulator.set("left.blocked", 0)
            robot.stop()
            assert robot.has_device
            wait_until(lambda: len(robot.recorder.boxes()) == 1, timeout_s=30.0)
            # Two at once, beside the program that holds the port.
            arguments = "why", simulator.port, "--json", "--save-boxes", str(folder)
            both = [beside(*arguments) for _ in range(2)]
            for process in both:
                (stop,) = json.loads(process.communicate(timeout=60.0)[0])
                assert process.returncode == 0
                assert stop["cause"] == "wheel_blocked"
                assert stop["time"].startswith(time.strftime("%Y-"))
        (file,) = folder.iterdir()
        (stop,) = run_json("why", str(file))
        assert (stop["cause"], stop["time"]) == ("wheel_blocked", None)
        assert read_box(file).head.number == 1
        info = run_json("info", simulator.port)
        assert info["ledger"]["stops"]["FAULT"] == 1
        finding = json.loads(run("doctor", simulator.port, "--json").stdout)[-1]
        assert finding["name"] == "ledger"
        assert "faults 1" in finding["problem"]
