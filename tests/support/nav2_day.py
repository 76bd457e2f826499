"""A day of Nav2 by proxy: what Nav2 would command, what happens to a robot, and a judge of both.

A controller with goals that succeed, abort, are canceled or die, Nav2's smoother and collision
monitor (`support.nav2`), and robot_localization's filter (`support.ros_filter`), in real time. At
random the cable comes off, the device is reset, somebody presses an e-stop or a bumper, the lidar
falls silent, or somebody sets parameters.
"""

from __future__ import annotations

import math
import random
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from tf2_msgs.msg import TFMessage

from support.nav2 import CollisionMonitor, Command, Controller, Smoother, shipped
from support.ros import Graph, open_graph
from support.ros_filter import FilterNode
from support.ros_process import RobotNode
from support.ros_rig import NODE, State, stamp_s, values
from wheelwire.simulation.simulator import Simulator, TrueState

TRUTH_HZ = 50.0
LOST_S = 3.0
FILTER_OFF_M = 0.1
ODOM_OFF_M, ODOM_OFF_SHARE = 0.02, 0.01
"""Of a robot on a floor without slip: a few ticks, and a share of the way."""
GAP_S = 0.9
"""A pause that arms: the longer one of rearm_gap_s and ttl_max_s, less a busy computer's part."""
LATE_S = 0.2
"""How long a command may take on a busy computer."""
SILENT_S = 3.0
TURNS_MPS = 0.05
WAIT_S = 60.0
BUMPER = "a bumper's release"
HALF_TRACK_M = 0.1
GEOMETRY: dict[str, Any] = {
    "wheel_radius": 0.05,
    "wheel_separation": 0.3,
    "counts_per_revolution": 720,
}


Place = tuple[float, float, float]


def way(begin: Place, end: Place) -> tuple[float, float]:
    """From one place to another, forward and to the left of the first one's heading."""
    x_m, y_m = end[0] - begin[0], end[1] - begin[1]
    cos, sin = math.cos(begin[2]), math.sin(begin[2])
    return x_m * cos + y_m * sin, y_m * cos - x_m * sin


class Day:
    """One robot's, from `open_day`.

    Attributes:
        violations: What should not have happened, in words.
        counts: How often what happened.
        worst: The largest value of what has a limit.
    """

    def __init__(self, graph: Graph, simulator: Simulator, seed: int) -> None:
        self.violations: list[str] = []
        self.counts: Counter[str] = Counter()
        self.worst: dict[str, float] = {}
        self.commands: deque[tuple[float, Command]] = deque(maxlen=20_000)
        self._graph, self._simulator = graph, simulator
        self._chance = random.Random(seed)
        self._state = State(graph)
        self._stamps: dict[str, float] = {}
        self._odometry: Any = None
        self._heard_s = time.monotonic()
        self._states: deque[TrueState] = deque(maxlen=20_000)
        self._armed_from_s = math.inf
        """Since when a zero command, or a pause, has to come before a motion; inf: never."""
        self._held_by = ""
        self._estopped_s = math.inf
        """Since when nothing may drive."""
        self._anchor_m = 0.0
        self._sees = True
        self._dead_until_s = self._goal_until_s = -math.inf
        self._ends = threading.Event()
        self._lock = threading.Lock()
        self._smoother = Smoother(shipped("velocity_smoother"))
        self._monitor = CollisionMonitor(shipped("collision_monitor"))
        self._controller = Controller()
        for type_, topic in ((Odometry, "odom"), (JointState, "joint_states"), (TFMessage, "/tf")):
            self._listen(type_, topic)
        self.filter = FilterNode(graph)
        self._publisher = graph.publisher(TwistStamped, "cmd_vel")
        self._poses = graph.publisher(PoseWithCovarianceStamped, f"{NODE}/set_pose")
        self._thread = threading.Thread(target=self._drive, name="nav2")

    def _listen(self, type_: Any, topic: str) -> None:
        def take(message: Any) -> None:
            header = message.transforms[0] if topic == "/tf" else message
            now = stamp_s(header)
            if now <= self._stamps.get(topic, 0.0):
                self._violate(f"time ran backward in {topic}: {self._stamps[topic] - now:.3f} s")
            self._stamps[topic] = now
            self.counts[f"messages of {topic}"] += 1
            if topic == "odom":
                self._odometry, self._heard_s = message, time.monotonic()

        self._graph.node.create_subscription(type_, topic, lambda message: take(message), 100)

    def _violate(self, text: str) -> None:
        with self._lock:
            if len(self.violations) < 50:
                self.violations.append(text)

    def _note_worst(self, what: str, value: float, limit: float) -> None:
        self.worst[what] = max(self.worst.get(what, 0.0), value)
        if value > limit:
            self._violate(f"{what}: {value:.3f}, at most {limit:.3f}")

    # --- Nav2 ------------------------------------------------------------------------------------

    def _drive(self) -> None:
        due_s = time.monotonic()
        while not self._ends.is_set():
            due_s = max(due_s + self._smoother.period_s, time.monotonic())
            self._ends.wait(due_s - time.monotonic())
            self._control()
            self._judge()

    def _control(self) -> None:
        now_s = self._graph.now_s()
        chance, controller = self._chance, self._controller
        if now_s > self._goal_until_s:
            controller.end()  # reached, or aborted: both publish a zero
        if self._sees:
            self._monitor.scan(chance.choice((math.inf, math.inf, 2.0, 0.3)), now_s)
        if now_s >= self._dead_until_s:
            command = controller.step(now_s)
            if command is not None:
                self._smoother.command(command)
        smoothed = self._smoother.step(now_s)
        out = None if smoothed is None else self._monitor.command(smoothed, now_s)
        if out is not None:
            message = TwistStamped()
            seconds, rest_s = divmod(out.stamp_s, 1)
            message.header.stamp.sec, message.header.stamp.nanosec = int(seconds), int(rest_s * 1e9)
            message.twist.linear.x, message.twist.angular.z = out[:2]
            self.commands.append((time.monotonic(), out))
            self._publisher.publish(message)

    def goal(self, seconds: float, linear_mps: float | None = None) -> None:
        """Follow a new one; it ends by itself."""
        chance = self._chance
        now_s = self._graph.now_s()
        if linear_mps is None:
            linear_mps = chance.choice((0.3, 0.3, 0.2, 0.1, -0.1))
        self._controller.begin(linear_mps, chance.uniform(-0.8, 0.8))
        self._goal_until_s = now_s + seconds
        self.counts["goals"] += 1

    # --- the judge -------------------------------------------------------------------------------

    def _judge(self) -> None:
        for state in self._simulator.take_states():
            self._states.append(state)
            at_s = state.host_us / 1e6
            if not state.drive_on:
                continue
            if at_s > self._estopped_s:
                self._violate("it is driven during an e-stop")
            elif at_s > self._armed_from_s and self._moves(state):
                if not self._is_armed(at_s):
                    late_s = at_s - self._armed_from_s
                    self._violate(f"it moves {late_s:.2f} s after {self._held_by}, unarmed")
                self._armed_from_s = math.inf
        silent_s = time.monotonic() - self._heard_s
        if silent_s > SILENT_S:
            self._violate(f"odom is silent for {silent_s:.1f} s")
            self._heard_s = time.monotonic()

    @staticmethod
    def _moves(state: TrueState) -> bool:
        return max(abs(state.left_mps), abs(state.right_mps)) > TURNS_MPS

    def _is_armed(self, at_s: float) -> bool:
        """Whether a zero command or a pause came since the hold began to wait for one."""
        before_s = self._armed_from_s
        for sent_s, command in tuple(self.commands):
            if sent_s < self._armed_from_s - LATE_S or sent_s > at_s:
                continue
            if command.is_zero or sent_s - before_s > GAP_S or self._leads_away(command):
                return True
            before_s = max(before_s, sent_s)
        return at_s - before_s > GAP_S

    def _leads_away(self, command: Command) -> bool:
        """From the bumper that held the robot: no wheel turns forward."""
        turning_mps = abs(command.angular_radps) * HALF_TRACK_M
        return self._held_by == BUMPER and command.linear_mps + turning_mps <= 0

    def _newest(self) -> TrueState:
        self._wait(lambda: self._states, "a state of the plant")
        return self._states[-1]

    def _wait(self, condition: Callable[[], Any], what: str) -> bool:
        end_s = time.monotonic() + WAIT_S
        while not condition():
            if time.monotonic() > end_s:
                self._violate(f"{what} did not come")
                return False
            time.sleep(0.02)
        return True

    def _said(self, **wanted: str) -> bool:
        told = values(self._state.told[-1]) if self._state.told else {}
        return all(told.get(name) == value for name, value in wanted.items())

    def wait_moving(self) -> None:
        """Until it moves."""
        self._wait(lambda: self._moves(self._newest()), "a motion")

    def come_to_rest(self) -> None:
        """End the goal, and compare odom with the truth."""
        self._controller.end()
        self._goal_until_s = -math.inf
        still = lambda: self._newest().stands_still and not self._newest().drive_on  # noqa: E731
        if not self._wait(lambda: self._said(odom="measured"), "a sample"):
            return
        for _ in range(2):
            self._wait(still, "standstill")
            time.sleep(0.4)
        place, truth = self._odometry.pose.pose.position, self._newest()
        off_m = math.hypot(place.x - truth.x_m, place.y - truth.y_m)
        way_m = truth.distance_m - self._anchor_m
        self._note_worst(
            "odom's error less its allowance [m]", off_m - ODOM_OFF_SHARE * way_m, ODOM_OFF_M
        )
        self.counts["comparisons with the truth"] += 1
        if way_m > 5.0:
            self._set_true_pose()

    def _set_true_pose(self) -> None:
        truth = self._newest()
        message = PoseWithCovarianceStamped()
        pose = message.pose.pose
        pose.position.x, pose.position.y = truth.x_m, truth.y_m
        half = truth.heading_rad / 2
        pose.orientation.z, pose.orientation.w = math.sin(half), math.cos(half)
        self._poses.publish(message)
        self._anchor_m = truth.distance_m
        self._wait(
            lambda: abs(self._odometry.pose.pose.position.x - truth.x_m) < ODOM_OFF_M, "the pose"
        )

    # --- what happens ----------------------------------------------------------------------------

    def unplug(self, seconds: float | None = None) -> None:
        """The cable comes off for a while."""
        before = self._places()
        self._simulator.unplug()
        lost_s = self._chance.choice((0.5, 1.5, LOST_S)) if seconds is None else seconds
        time.sleep(lost_s)
        if lost_s >= LOST_S:
            ways = [way(*both) for both in zip(before, self._places(), strict=True)]
            error_m = math.dist(*ways)
            self._note_worst("the filter's error in a loss of 3 s [m]", error_m, FILTER_OFF_M)
        self._simulator.plug()
        self._wait(lambda: self._said(odom="measured", link="connected"), "the link")

    def _places(self) -> tuple[Place, Place]:
        """x, y and heading, by the filter and true."""
        get = self._simulator.get
        return self.filter.place, (get("true.x_m"), get("true.y_m"), get("true.heading_rad"))

    def reset(self) -> None:
        """The device restarts."""
        boot_id = self._simulator.reset()
        self._hold("a reset")
        self._wait(lambda: self._newest().boot_id == boot_id, "a start")
        self._wait(lambda: self._said(boot_id=f"{boot_id:08x}", link="connected"), "the link")
        time.sleep(self._chance.uniform(0.0, 2.0))
        self._controller.end()
        self._goal_until_s = -math.inf
        self._wait(lambda: self._newest().stands_still, "standstill")
        time.sleep(0.5)
        self._set_true_pose()

    def estop(self) -> None:
        """Somebody calls the service, and clears it while a planner may go on."""
        if self._graph.call(SetBool, f"{NODE}/estop", data=True).success:
            self._estopped_s = time.monotonic()
        self._clear(self._chance.uniform(0.5, 2.0))

    def press(self) -> None:
        """Somebody presses the e-stop's button."""
        self._simulator.set("estop_open", 1)
        self._wait(lambda: self._said(state="ESTOPPED"), "the e-stop")
        self._estopped_s = time.monotonic()
        time.sleep(self._chance.uniform(0.2, 1.0))
        self._simulator.set("estop_open", 0)
        self._clear(0.3)

    def _hold(self, what: str) -> None:
        """From now on a motion has to be armed."""
        self._held_by, self._armed_from_s = what, time.monotonic()

    def _clear(self, seconds: float) -> None:
        time.sleep(seconds)
        # The planner goes on, as Nav2's does until its progress checker gives up.
        self.goal(self._chance.uniform(1.5, 4.0), 0.3)
        time.sleep(0.3)
        self._estopped_s = math.inf
        self._hold("a clear")
        if not self._graph.call(SetBool, f"{NODE}/estop", data=False).success:
            self._violate("the e-stop is not cleared")
        time.sleep(1.0)

    def bump(self) -> None:
        """It drives against something, which goes away."""
        self.goal(6.0, 0.2)
        time.sleep(0.5)
        self._simulator.set("bumper.front_left", 1)
        time.sleep(self._chance.uniform(0.7, 1.5))
        self._hold(BUMPER)
        self._simulator.set("bumper.front_left", 0)
        time.sleep(1.0)
        self._controller.end()

    def set_geometry(self) -> None:
        """Somebody sets what may only change at rest, one by one or together."""
        before = {name: self._graph.parameter(NODE, name) for name in GEOMETRY}
        messages = [
            Parameter(name, value=value).to_parameter_msg() for name, value in GEOMETRY.items()
        ]
        began_s = time.monotonic()
        if self._chance.random() < 0.5:
            results = self._graph.set_parameters(NODE, messages)
        else:
            service = f"{NODE}/set_parameters_atomically"
            answer = self._graph.call(SetParametersAtomically, service, parameters=messages)
            results = [answer.result]
        ended_s = time.monotonic()
        during = [
            max(abs(state.left_mps), abs(state.right_mps))
            for state in tuple(self._states)
            if began_s <= state.host_us / 1e6 <= ended_s
        ]
        accepted = sum(result.successful for result in results)
        self.counts["geometry accepted" if accepted else "geometry refused"] += 1
        if accepted and during and min(during) > TURNS_MPS:
            self._violate("the geometry changed while the wheels turned")
        if accepted:
            self._controller.end()
            self._goal_until_s = -math.inf
            for name, value in before.items():
                self._wait(partial(self._sets, name, value), f"{name} of before")
            self._set_true_pose()  # with the wrong geometry it may have driven a little

    def _sets(self, name: str, value: float) -> bool:
        return bool(self._graph.set_parameter(NODE, name, value).successful)

    def set_gain(self) -> None:
        """Somebody tunes while it drives."""
        gain = self._chance.uniform(0.9, 1.1)
        if not self._sets("proportional_gain", gain):
            self._violate("a gain was refused")

    def lose_scan(self) -> None:
        """The lidar is silent for longer than source_timeout."""
        self._sees = False
        time.sleep(1.5)
        self._sees = True

    def die(self) -> None:
        """The planner hangs without a zero."""
        self._dead_until_s = self._graph.now_s() + 1.5
        time.sleep(1.5)

    def run(self, seconds: float) -> None:
        """Let it all happen at random for so long."""
        happenings = (
            *(self.unplug, self.reset, self.estop, self.press, self.bump),
            *(self.set_geometry, self.set_geometry, self.set_gain, self.lose_scan, self.die),
        )
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            for happening in self._chance.sample(happenings, len(happenings)):
                if time.monotonic() >= end_s:
                    break
                self.goal(self._chance.uniform(3.0, 8.0))
                time.sleep(self._chance.uniform(0.5, 3.0))
                self.counts[happening.__name__] += 1
                happening()
                if self._chance.random() < 0.4:
                    self.come_to_rest()
        self.come_to_rest()
        self.counts["metres"] = round(self._newest().distance_m)

    def table(self) -> str:
        """What happened, as rows of a page."""
        rows = [f"| {name} | {count} |" for name, count in sorted(self.counts.items())]
        rows += [f"| {name} | {value:.3f} |" for name, value in sorted(self.worst.items())]
        return "\n".join(["| what | |", "| -- | -- |", *rows])

    def __enter__(self) -> Day:
        self._thread.start()
        self._wait(lambda: self._odometry is not None and self._states, "odom")
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._thread.join()


@contextmanager
def open_day(folder: Path, seed: int, code: str | None = None, **parameters: Any) -> Iterator[Day]:
    """A simulated robot, its node, and a day that has begun; `code` as for `RobotNode`."""
    with (
        open_graph() as graph,
        Simulator(link=folder / f"port{seed}", truth_hz=TRUTH_HZ) as simulator,
        RobotNode(graph, code, port=simulator.port, use_stamped_vel=True, **parameters),
    ):
        graph.wait_active()
        with Day(graph, simulator, seed) as day:
            yield day


if __name__ == "__main__":
    import sys
    import tempfile

    with (
        tempfile.TemporaryDirectory() as a_folder,
        open_day(Path(a_folder), int(sys.argv[2])) as a_day,
    ):
        a_day.run(float(sys.argv[1]))
        sys.stdout.write("\n".join([a_day.table(), *(a_day.violations or ["no violation"]), ""]))
