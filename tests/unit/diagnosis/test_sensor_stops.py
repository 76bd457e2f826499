"""Which sensor stopped a robot, by what the device reported of its inputs."""

from __future__ import annotations

import pytest

from support.sensor_messages import AHEAD_US, Stream, info, inputs
from wheelwire.diagnosis.causes import CAUSES, latched_causes, sensor_causes, sentence_of
from wheelwire.diagnosis.explanation import explain
from wheelwire.diagnosis.history import History
from wheelwire.errors import DeviceRefused
from wheelwire_protocol.codes import Fault, RefusalCode
from wheelwire_protocol.sensors import BatteryLevel, PeripheralKind, Reflex
from wheelwire_protocol.types import Inputs

BATTERY, BUMPER, CLIFF = 0b0010, 0b0100, 0b1000


@pytest.mark.parametrize(
    ("message", "found"),
    [
        (inputs(0, triggered=CLIFF, reflexes=Reflex.STOP), {"cliff.front": "cliff_seen"}),
        (inputs(0, triggered=BUMPER, reflexes=Reflex.NO_FORWARD), {}),
        (
            inputs(0, reflexes=Reflex.STOP, level=BatteryLevel.STOP),
            {"battery": "battery_at_stop"},
        ),
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


def test_a_flag_alone_names_none() -> None:
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
