"""The text of each part of the screen."""

import math

import pytest

from support.looks import look, wave
from wheelwire.link.statistics import LinkStatistics
from wheelwire.tools.view import panels
from wheelwire.tools.view.canvas import BLANK, Canvas
from wheelwire.tools.view.model import WINDOW_S, Look, Model, Status
from wheelwire_protocol.codes import Fault, SupervisorState

SIZES = [(80, 24), (60, 20), (200, 60), (30, 2)]


@pytest.fixture
def model() -> Model:
    model = Model("/dev/ttyUSB0", 0.0)
    for found in wave(25.0):
        model.take(found)
    return model


def drawn(canvas: Canvas) -> list[str]:
    return ["".join(chr(BLANK + bits) for bits in row) for row in canvas.rows]


def test_a_canvas_has_eight_dots_in_a_cell() -> None:
    canvas = Canvas(2, 1)
    canvas.set(0, 0)
    canvas.set(3, 3)
    for outside in ((-1, 0), (4, 0), (0, -1), (0, 4)):
        canvas.set(*outside)
    assert drawn(canvas) == ["⠁⢀"]
    canvas.column(1, 3, 0)
    assert drawn(canvas) == ["⢹⢀"]


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_no_panel_is_larger_than_its_room(model: Model, width: int, height: int) -> None:
    for side in (panels.LEFT, panels.RIGHT):
        lines = panels.wheel(model, side, width, height).plain.split("\n")
        assert len(lines) == height
        assert max(map(len, lines)) <= width
    model.say("a text " * 30)
    for text in (panels.events(model, width, height), panels.state(model, width, height)):
        assert len(text.plain.split("\n")) <= height
        assert max(map(len, text.plain.split("\n"))) <= width


def test_a_plot_has_its_newest_point_at_the_right_and_its_peak_at_the_top() -> None:
    looks = [look(now_s, now_s / 20) for now_s in range(21)]
    curve = panels.LEFT.speed
    rows = [row.plain for row in panels.plot(looks, 20.0, [curve], 26, 4, full=1.0)]
    assert rows[0].startswith(" +1.0 ")
    assert rows[-1].startswith(" +0.0 ")
    assert rows[0][-1] != " "
    assert rows[-1][-1] == " "


def test_what_is_asked_is_dotted_and_what_is_measured_is_a_line(model: Model) -> None:
    side = panels.LEFT
    (asked,) = panels.plot(model.looks, model.now_s, [side.asked_speed], 80, 1)
    (measured,) = panels.plot(model.looks, model.now_s, [side.speed], 80, 1)
    count = [sum(f"{ord(char):b}".count("1") for char in row.plain) for row in (asked, measured)]
    assert count[0] < count[1]


def test_a_loss_is_a_gap_in_the_plot(model: Model) -> None:
    for tenths in range(100):
        model.take(Look(25.0 + tenths / 10, model.sample, None, "unplugged"))
    rows = panels.plot(model.looks, model.now_s, [panels.LEFT.speed], 46, 3)
    assert all(row.plain[-18:].strip() == "" for row in rows)
    assert any(row.plain[6:20].strip() for row in rows)


@pytest.mark.parametrize("mps", [0.04, 0.3, 1.7, 25.0])
def test_the_scale_holds_every_speed(mps: float) -> None:
    looks = [look(1.0, mps), look(2.0, -mps)]
    rows = panels.plot(looks, 2.0, [panels.LEFT.speed], 30, 3)
    high, low = float(rows[0].plain[:6]), float(rows[-1].plain[:6])
    assert high >= mps
    assert low == -high


def test_state_and_faults_are_in_words_with_the_reason(model: Model) -> None:
    model.take(look(26.0, 0.0, state=SupervisorState.FAULT, faults=Fault.LEFT_NOT_COUNTING))
    text = " ".join(panels.state(model, 80, 5).plain.split())
    assert text.startswith("FAULT: ")
    assert Fault.LEFT_NOT_COUNTING.doc[:40] in text


def test_a_loss_comes_first_and_in_words(model: Model) -> None:
    model.take(Look(26.0, model.sample, None, "unplugged"))
    lines = panels.state(model, 80, 3).plain.split("\n")
    assert lines[0] == "OUT OF REACH: unplugged"
    assert lines[2].startswith("before: DRIVING")


def test_text_that_does_not_fit_ends_with_an_ellipsis(model: Model) -> None:
    model.take(Look(26.0, model.sample, None, "because " * 40))
    assert panels.state(model, 60, 3).plain.endswith("…")


def test_the_link_is_in_numbers_and_unknown_ones_are_blank(model: Model) -> None:
    model.status = Status(LinkStatistics(state_rate_hz=100.2, frames_lost=3))
    text = panels.link(model, 200).plain
    assert "100 Hz" in text
    assert "3 frames" in text
    assert "clock ±   -   " in text
    assert "supply 12.1 V" in text
    assert "nan" not in text


def test_a_title_keeps_the_end_of_a_long_name() -> None:
    model = Model("/dev/serial/by-id/usb-Silicon_Labs_CP2102_USB_to_UART_Bridge-if00", 0.0)
    text = panels.title(model, ["recording day.mcap"], 60).plain
    assert len(text) == 60
    assert text.startswith("…")
    assert text.endswith("Bridge-if00  recording day.mcap")


def test_a_curve_keeps_its_shape_while_it_moves() -> None:
    """Drawn a column later it is the same, one column further to the left."""
    looks = [look(now / 20, math.sin(now / 20)) for now in range(400)]
    column_s = WINDOW_S / 40
    first, second = (
        panels.plot(looks, 20.0 + shift * 2 * column_s, [panels.LEFT.speed], 26, 4)
        for shift in (0, 1)
    )
    for before, after in zip(first, second, strict=True):
        assert before.plain[7:] == after.plain[6:-1]


def test_the_newest_event_is_cut_at_its_end_and_older_ones_are_whole(model: Model) -> None:
    model.say("older " * 20)
    model.say("newest " * 20)
    assert panels.events(model, 60, 2).plain.count("\n") == 1
    assert "newest" in panels.events(model, 60, 1).plain
    assert panels.events(model, 60, 1).plain.endswith("…")
    whole = panels.events(model, 60, 3).plain
    assert "newest" in whole
    assert "older" not in whole
    assert "older" in panels.events(model, 60, 6).plain
