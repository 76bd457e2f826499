"""A ROS graph on loopback: a client in this process, robots' nodes in processes of their own."""

from __future__ import annotations

import itertools
import os
import socket
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)
    import lark  # noqa: F401 - rclpy imports it at first use, and it imports what is deprecated

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.parameter import Parameter as RosParameter

from support.waiting import wait_until

TIMEOUT_S = 90.0
"""On a busy computer, starting a node takes half a minute."""
ASK_AGAIN_S = 5.0
STATE_PERIOD_S = 0.02
MESSAGES_KEPT = 10_000
ENVIRONMENT = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "FASTRTPS_DEFAULT_PROFILES_FILE": str(Path(__file__).with_name("ros_discovery.xml")),
}
"""Environment of all processes on the graph."""
DOMAINS = 100
_domains = itertools.count(os.getpid())


def wait(condition: Callable[[], Any], what: str) -> None:
    """Wait until the condition holds."""
    wait_until(condition, TIMEOUT_S, what)


def take_domain() -> tuple[int, socket.socket]:
    """A domain that no process of this computer uses, and the socket that reserves it.

    RTPS gives domain D the UDP ports from 7400 + 250 D on, and its participant number i the port
    10 + 2 i of these; the last port belongs to a participant that no graph of ours reaches.
    """
    for _ in range(DOMAINS):
        domain = 1 + next(_domains) % DOMAINS
        first_port = 7400 + 250 * domain
        reservation = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            reservation.bind(("127.0.0.1", first_port + 249))
            for participant in range(8):
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                    probe.bind(("127.0.0.1", first_port + 10 + 2 * participant))
        except OSError:
            reservation.close()
        else:
            return domain, reservation
    raise AssertionError(f"every one of the {DOMAINS} ROS domains is in use")


class Graph:
    """A ROS graph on its own domain, with a client node that spins in a thread."""

    def __init__(self) -> None:
        self.domain, self._reservation = take_domain()
        os.environ.update(ENVIRONMENT)
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=self.domain)
        self.node = rclpy.create_node("client", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, name="client")
        self._thread.start()

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return
        except RuntimeError:  # rclpy's, where `close` came between two of its steps
            if self._context.ok():
                raise

    def close(self) -> None:
        """Leave the domain."""
        rclpy.shutdown(context=self._context)
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self._reservation.close()

    def listen(self, type_: Any, topic: str, depth: int = 100) -> deque[Any]:
        """The published messages, in order of arrival."""
        messages: deque[Any] = deque(maxlen=MESSAGES_KEPT)
        self.node.create_subscription(type_, topic, lambda m: messages.append(m), depth)
        return messages

    def first(self, type_: Any, topic: str) -> Any:
        """The first message that arrives."""
        messages = self.listen(type_, topic)
        wait(lambda: messages, topic)
        return messages[0]

    def publisher(self, type_: Any, topic: str) -> Any:
        """A publisher that has found its subscriber, which may still have to find the publisher."""
        publisher = self.node.create_publisher(type_, topic, 1)
        wait(lambda: publisher.get_subscription_count() > 0, f"a subscriber of {topic}")
        return publisher

    def now_s(self) -> float:
        """By the clock of this computer, as the node's stamps."""
        return float(self.node.get_clock().now().nanoseconds / 1e9)

    def destroy(self, entity: Any) -> None:
        """Remove a publisher or a subscription, in the thread that may be waiting for it."""
        node = self.node
        is_publisher = entity in list(node.publishers)
        destroy = node.destroy_publisher if is_publisher else node.destroy_subscription
        wait(self._executor.create_task(destroy, entity).done, "the end of a topic")

    def call(self, type_: Any, name: str, **fields: Any) -> Any:
        """A service's answer."""
        with self.client(type_, name) as client:
            future = client.call_async(type_.Request(**fields))
            wait(future.done, f"the answer of {name}")
            return future.result()

    @contextmanager
    def client(self, type_: Any, name: str) -> Iterator[Any]:
        """A client of a service, whose node has found it: an answer to any other is dropped."""
        with self._new_client(type_, name) as client:
            self.wait_found(name.rpartition("/")[0])
            yield client

    def wait_found(self, node: str) -> None:
        """Wait until a node has found each publisher and client that was made before.

        It finds them in the order in which they were made: when it answers a later one, it knows
        the earlier ones.
        """
        self._ask(GetParameters, f"{node}/get_parameters")

    def _ask(self, type_: Any, name: str, **fields: Any) -> Any:
        """As `call`, for a question that changes nothing: it is asked again if it must be."""
        with self._new_client(type_, name) as client:
            return self._answer(client, type_.Request(**fields))

    def _answer(self, client: Any, request: Any) -> Any:
        futures = []
        again_s = 0.0

        def is_answered() -> bool:
            nonlocal again_s
            if time.monotonic() >= again_s:
                futures.append(client.call_async(request))
                again_s = time.monotonic() + ASK_AGAIN_S
            return any(future.done() for future in futures)

        wait(is_answered, f"the answer of {client.srv_name}")
        return next(future.result() for future in futures if future.done())

    @contextmanager
    def _new_client(self, type_: Any, name: str) -> Iterator[Any]:
        client = self.node.create_client(type_, name)
        wait(client.service_is_ready, name)
        try:
            yield client
        finally:
            self.node.destroy_client(client)

    def set_parameter(self, node: str, name: str, value: Any) -> Any:
        """The result."""
        parameter = RosParameter(name, value=value).to_parameter_msg()
        return self.set_parameters(node, [parameter])[0]

    def set_parameters(self, node: str, parameters: list[Parameter]) -> Any:
        """The results, each by itself."""
        answer = self.call(SetParameters, f"{node}/set_parameters", parameters=parameters)
        return answer.results

    def parameter(self, node: str, name: str) -> Any:
        """A parameter's value; None if it is not set."""
        answer = self._ask(GetParameters, f"{node}/get_parameters", names=[name])
        return RosParameter.from_parameter_msg(Parameter(name=name, value=answer.values[0])).value

    def dump(self, node: str) -> dict[str, Any]:
        """Every listed parameter with its value, as `ros2 param dump` reads them."""
        listed = self._ask(ListParameters, f"{node}/list_parameters").result.names
        values = self._ask(GetParameters, f"{node}/get_parameters", names=listed).values
        return {
            name: RosParameter.from_parameter_msg(Parameter(name=name, value=value)).value
            for name, value in zip(listed, values, strict=True)
        }

    def describe(self, node: str, name: str) -> Any:
        """A parameter's descriptor."""
        answer = self._ask(DescribeParameters, f"{node}/describe_parameters", names=[name])
        return answer.descriptors[0]

    def state(self, node: str) -> str:
        """The state of the node's lifecycle."""
        return str(self._ask(GetState, f"{node}/get_state").current_state.label)

    def change_state(self, node: str, transition: int) -> bool:
        """Whether it succeeded."""
        request = Transition(id=transition)
        return bool(self.call(ChangeState, f"{node}/change_state", transition=request).success)

    def wait_state(self, node: str, state: str) -> None:
        """Wait for a state of the lifecycle; a log line may come before its transition ends."""
        with self._new_client(GetState, f"{node}/get_state") as client:

            def is_in_state() -> bool:
                time.sleep(STATE_PERIOD_S)
                answer = self._answer(client, GetState.Request())
                return bool(answer.current_state.label == state)

            wait(is_in_state, f"{node} {state}")

    def wait_active(self, node: str = "/hardware_robot") -> None:
        """Wait until the node obeys commands."""
        self.wait_state(node, "active")


class Diagnostics:
    """The current status of a robot in /diagnostics."""

    def __init__(self, graph: Graph, robot: str = "hardware_robot") -> None:
        self._robot = robot
        self._messages = graph.listen(DiagnosticArray, "/diagnostics")

    def wait(
        self, subject: str, condition: Callable[[Any, dict[str, str]], bool]
    ) -> dict[str, str]:
        """Wait for a new status that fulfils a condition; returns its values."""
        found: dict[str, str] = {}
        self._messages.clear()

        def look() -> bool:
            while self._messages:
                for status in self._messages.popleft().status:
                    values = {pair.key: pair.value for pair in status.values}
                    if status.name == f"{self._robot}: {subject}" and condition(status, values):
                        found.update(values)
                        return True
            return False

        wait(look, f"a condition of {subject} in /diagnostics")
        return found


class Repeater:
    """Publishes a message repeatedly from a thread, like a program that drives."""

    def __init__(self, publisher: Any, make: Callable[[], Any], rate_hz: float = 50) -> None:
        self._publisher = publisher
        self._make = make
        self._period_s = 1 / rate_hz
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="repeater")

    def _run(self) -> None:
        while not self._end.wait(self._period_s):
            self._publisher.publish(self._make())

    def __enter__(self) -> Repeater:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()


def open_graph() -> closing[Graph]:
    """A client on a domain of its own."""
    return closing(Graph())
