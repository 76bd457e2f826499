"""Which sensor stopped a robot, by what the device reported of its inputs."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import pytest

import wheelwire
from support.sensor_messages import AHEAD_US, Stream, info, inputs
from wheelwire.board import DigitalInput, Pull
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import DeviceRefused
from wheelwire.link.sample_stream import Measurement
from wheelwire.link.session import Session
from wheelwire.link.traffic import Record, TrafficReader
from wheelwire.log.why.causes import CAUSES, latched_causes, sensor_causes, sentence_of
from wheelwire.log.why.diagnosis import Diagnosis
from wheelwire.log.why.explanation import explain
from wheelwire.log.why.history import History
from wheelwire.tools.files.board import load_board
from wheelwire_protocol.codes import BatteryLevel, Fault, PeripheralKind, Place, Reflex, RefusalCode
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.types import Inputs

BATTERY, BUMPER, CLIFF = 0b0010, 0b0100, 0b1000


@pytest.mark.parametrize(
    ("message", "found"),
    [
        (inputs(0, triggered=CLIFF, reflexes=Reflex.STOP), {"cliff.front": "cliff_seen"}),
        (inputs(0, triggered=BUMPER, reflexes=Reflex.NO_FORWARD), {}),
        (inputs(0, reflexes=Reflex.STOP, level=BatteryLevel.STOP), {"battery": "battery_at_stop"}),
        (inputs(0, stale=BATTERY, reflexes=Reflex.STOP), {"battery": "sensor_stale"}),
        # It is measured only, and stops nothing.
        (inputs(0, stale=BATTERY), {}),
        (
            inputs(0, triggered=CLIFF, stale=BATTERY, reflexes=Reflex.STOP),
            {"battery": "sensor_stale", "cliff.front": "cliff_seen"},
        ),
    ],
)
def test_the_inputs_tell_which_sensor_it_is(message: Inputs, found: dict[str, str]) -> None:
    known = Stream()
    known.inputs(message)
    measured = known.stream.sensed[-1].what
    assert sensor_causes(measured) == found  # type: ignore[arg-type]


def test_a_stage_that_has_tripped() -> None:
    known = Stream()
    known.stream.take_info(info(3, kind=PeripheralKind.STAGE_FAULT)._replace(place=0))
    known.inputs(inputs(0, triggered=CLIFF, reflexes=Reflex.STOP))
    stopped = known.stream.stopped
    assert stopped is not None
    assert sensor_causes(stopped) == {"stage_fault": "stage_tripped"}


def test_a_sentence_names_the_sensor() -> None:
    assert sentence_of(("cliff_seen",), "cliff.front") == "cliff.front saw no floor."
    assert sentence_of(("cliff_seen",)) == "A sensor saw no floor."


def test_a_flag_alone_names_no_sensor() -> None:
    (alone,) = latched_causes(Fault.EXTERNAL)
    assert alone == (Fault.EXTERNAL, ("external_fault",), "")
    (known,) = latched_causes(Fault.EXTERNAL, {"cliff.front": "cliff_seen"})
    assert known == (Fault.EXTERNAL, ("cliff_seen",), "cliff.front")


def test_an_error_names_the_sensor_also_when_it_is_free_again() -> None:
    known = Stream()
    known.inputs(inputs(1_000_000, triggered=CLIFF, reflexes=Reflex.STOP))
    known.inputs(inputs(2_000_000))
    error = DeviceRefused(RefusalCode.FAULT, "the setpoint", Fault.EXTERNAL)
    explain(error, None, lambda: known.stream)
    assert error.why == "cliff.front saw no floor."
    assert error.look_at == CAUSES["cliff_seen"].look_at
    explain(error, None, None)
    assert error.why == "An input of the board stopped the robot."


def test_a_stop_has_the_sensors_that_acted_at_that_time() -> None:
    known, history = Stream(), History()

    def at(message: Inputs) -> None:
        known.inputs(message)
        history.note_sensors(known.stream, message.t_us - AHEAD_US)

    at(inputs(2_000_000))
    assert history.stopping_sensors(1_000_000) == {}
    at(inputs(3_000_000, triggered=CLIFF, reflexes=Reflex.STOP))
    assert history.stopping_sensors(2_000_000) == {"cliff.front": "cliff_seen"}
    at(inputs(4_000_000))
    # Free again 1 s later: it explains a stop before that, and none after it.
    assert history.stopping_sensors(2_500_000) == {"cliff.front": "cliff_seen"}
    assert history.stopping_sensors(3_500_000) == {}


class LateInputs:
    """Holds the inputs back on their way to the host, by `delay_us` once it is not 0."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.delay_us = 0
        self._held: deque[tuple[int, bytes]] = deque()
        receive = Session.receive

        def receive_late(
            session: Session, data: bytes, now_us: int, *, every_state: bool = False
        ) -> list[Measurement]:
            return receive(session, self._passed(data, now_us), now_us, every_state=every_state)

        patch.setattr(Session, "receive", receive_late)

    def _passed(self, data: bytes, now_us: int) -> bytes:
        passed = b""
        for frame in data.split(b"\0"):
            whole = b"\0" + frame + b"\0"
            if any(isinstance(message, Inputs) for message in Decoder().feed(whole)):
                self._held.append((now_us + self.delay_us, whole))
            elif frame:
                passed += whole
        while self._held and self._held[0][0] <= now_us:
            passed += self._held.popleft()[1]
        return passed


def stopped_by_a_cliff(delay_ms: int) -> list[Record]:
    """What crosses a link while a cliff stops the robot, whose inputs come so much later."""
    cliff = DigitalInput(PeripheralKind.CLIFF, Place.FRONT, 36, pull=Pull.EXTERNAL)
    reader = TrafficReader()
    with (
        pytest.MonkeyPatch.context() as patch,
        wheelwire.open_driver("mock", realtime=False) as robot,
    ):
        late = LateInputs(patch)
        assert isinstance(robot, MockDriver)
        robot.board.take_up(replace(load_board("l298n"), peripherals=(cliff,)))
        robot.sensors.start()
        robot._link.listen_to_traffic(reader)
        robot.set_velocity(0.0, 0.0)  # the board has taken a restart
        for _ in range(100):
            robot.set_velocity(0.1, 0.0, ttl=0.5)
            robot.advance(0.01)
        late.delay_us = 1000 * delay_ms
        robot.simulator.set("cliff.front", 1)
        robot.advance(1.5)
        return reader.take()


@pytest.mark.parametrize("delay_ms", [0, 200, 900])
def test_inputs_that_come_late_name_the_sensor(delay_ms: int) -> None:
    (stop,) = Diagnosis().feed_all(stopped_by_a_cliff(delay_ms))
    assert (stop.cause, stop.sentence) == ("cliff_seen", "cliff.front saw no floor.")


def test_a_sensor_that_is_never_named_is_reported_all_the_same() -> None:
    records = stopped_by_a_cliff(10_000)
    (live,) = Diagnosis().feed_all(records)
    diagnosis = Diagnosis()
    half = [record for record in records if record.host_us < live.host_us + 500_000]
    assert diagnosis.feed_all(half) == []
    (cut,) = diagnosis.end(complete=True)
    # By the device's own report, which has its kind.
    assert live.cause == cut.cause == "cliff_seen"
    assert live.sentence == cut.sentence == "Cliff saw no floor."
