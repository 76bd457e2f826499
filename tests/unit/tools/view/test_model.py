"""What a view knows of a robot."""

import pytest

from support.looks import look, wave
from wheelwire.log.why.diagnosis import Stop
from wheelwire.tools.view.model import EVENTS, REPEATED_S, WINDOW_S, Look, Model, Status
from wheelwire_protocol.codes import Fault, SupervisorState

ESTOPPED, FAULT, IDLE = SupervisorState.ESTOPPED, SupervisorState.FAULT, SupervisorState.IDLE
STOP = Stop(0, "contact_open", "The contact opened", (), "the button")


def texts(model: Model) -> list[str]:
    return [event.text for event in model.events]


@pytest.fixture
def model() -> Model:
    model = Model("robot", 1_000_000.0)
    model.take(look(0.0))
    return model


def test_it_holds_the_last_20_s_and_no_more(model: Model) -> None:
    for found in wave(60.0):
        model.take(found)
    assert model.looks[-1].now_s == pytest.approx(60.0, abs=0.1)
    assert model.looks[0].now_s == pytest.approx(60.0 - WINDOW_S, abs=0.1)
    assert len(model.looks) == pytest.approx(WINDOW_S / 0.05, abs=2)


def test_a_change_of_state_is_an_event_with_its_time(model: Model) -> None:
    model.take(look(7.0, 0.0, state=ESTOPPED))
    assert texts(model) == ["DRIVING", "ESTOPPED"]
    assert model.events[-1].unix_s == 1_000_007.0
    assert model.is_latched


def test_a_fault_is_an_event_once(model: Model) -> None:
    for now_s in (1.0, 2.0, 3.0):
        model.take(look(now_s, 0.0, state=FAULT, faults=Fault.LEFT_REVERSED))
    assert texts(model).count(f"LEFT_REVERSED: {Fault.LEFT_REVERSED.doc}") == 1


def test_a_loss_leaves_a_gap_and_the_state_before_it(model: Model) -> None:
    model.take(Look(1.0, model.sample, None, "unplugged"))
    assert model.trouble == "unplugged"
    assert model.looks[-1].sample is None
    assert model.state is SupervisorState.DRIVING
    model.take(look(2.0))
    assert not model.trouble
    assert texts(model)[-2:] == ["out of reach: unplugged", "the link is back"]


def test_a_restart_is_an_event(model: Model) -> None:
    model.take(look(1.0, 0.0, state=IDLE, boot_id=2))
    assert texts(model)[-2:] == ["the robot was restarted", "IDLE"]


def test_the_reason_of_a_stop_stays_until_the_robot_drives(model: Model) -> None:
    model.take(look(1.0, 0.0, state=ESTOPPED))
    model.take_stop(STOP)
    model.take(look(5.0, 0.0, state=ESTOPPED))
    assert model.why == ("The contact opened.", "the button")
    model.take(look(6.0))
    assert model.why == ("", "")
    model.take(look(7.0, 0.0, state=IDLE))
    assert model.why == ("", "")


def test_a_clear_ends_the_reason_and_a_restart_does_not(model: Model) -> None:
    model.take(look(1.0, 0.0, state=ESTOPPED))
    model.take_stop(STOP)
    model.take(look(2.0, 0.0, state=IDLE, boot_id=2))
    assert model.stop is STOP
    model.take(look(3.0, 0.0, state=ESTOPPED, boot_id=2))
    model.take(look(4.0, 0.0, state=IDLE, boot_id=2))
    assert model.stop is None


def test_a_stop_that_nobody_saw_is_explained_by_the_state(model: Model) -> None:
    model.take(look(1.0, 0.0, state=ESTOPPED))
    model.status = Status(standing=(STOP,))
    assert model.why == ("The contact opened.", "the button")


def test_a_repeated_request_is_one_event(model: Model) -> None:
    for now_s in (1.0, 1.2, 1.4):
        model.take(look(now_s))
        model.say("no")
    model.take(look(1.4 + 2 * REPEATED_S))
    model.say("no")
    assert texts(model).count("no") == 2


def test_events_of_a_long_day_do_not_pile_up(model: Model) -> None:
    for number in range(2 * EVENTS):
        model.say(str(number))
    assert texts(model) == [str(number) for number in range(EVENTS, 2 * EVENTS)]
