"""A robot's parameters as a file; setting them all, or none."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from wheelwire import errors, parameters
from wheelwire.parameters import (
    ParameterInfo,
    Parameters,
    Trial,
    checked_value,
    definition_of,
    differences,
)
from wheelwire.tools.files.parameters import ParameterFile, load_parameter_file
from wheelwire_protocol.codes import RefusalCode
from wheelwire_protocol.parameters import PARAMETER_BY_NAME, PARAMETERS, Kind, Parameter

Values = dict[str, float]
"""By parameter."""


class MemoryTrial(Trial):
    """A trial on a `Robot`, which reverts the values without a request for each."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._before = dict(robot.held)
        self._is_kept = False

    def keep(self) -> None:
        self._robot.before_keep()
        self._before = dict(self._robot.held)
        self._is_kept = True
        self._robot.after_keep()

    def __enter__(self) -> MemoryTrial:
        self._robot.on_trial = True
        return self

    def __exit__(self, *_: object) -> None:
        self._robot.on_trial = False
        self._robot.reverts += not self._is_kept
        self._robot.held = self._before


class Robot(Parameters):
    """A robot's parameters in memory. `before_set(name, value)` may raise, or lose an answer."""

    def __init__(self) -> None:
        self.held = {p.name: float(p.default) for p in PARAMETERS}
        self.saved: dict[str, float] = {}
        self.order: list[str] = []
        self.saves: list[str | None] = []
        self.before_set: Callable[[str, float], None] = lambda _name, _value: None
        self.before_save: Callable[[str | None], None] = lambda _name: None
        self.after_set: Callable[[str, float], None] = lambda _name, _value: None
        self.before_keep: Callable[[], None] = lambda: None
        self.after_keep: Callable[[], None] = lambda: None
        self.on_trial = False
        self.reverts = 0
        """Trials that ended without `keep`, which stops the wheels."""

    def set(self, name: str, value: float) -> float:
        self.before_set(name, value)
        self.held[name] = parameters._as_held(checked_value(name, value))
        self.order.append(name)
        self.after_set(name, value)
        return self.held[name]

    def list(self) -> tuple[ParameterInfo, ...]:
        return tuple(
            ParameterInfo(
                p.name, self.held[p.name], p.default, p.minimum, p.maximum, p.unit.value, p.kind, ""
            )
            for p in PARAMETERS
        )

    def save(self, name: str | None = None) -> None:
        self.before_save(name)
        self.saves.append(name)
        names = self.held if name is None else [name]
        self.saved.update({each: self.held[each] for each in names})

    def refresh(self, name: str | None = None) -> None:
        raise NotImplementedError

    def trial(self, timeout_s: float = 2.0) -> Trial:  # noqa: ARG002 - as the base class has it
        return MemoryTrial(self)

    def reset(self) -> None:
        raise NotImplementedError

    def _value(self, definition: Parameter) -> float:
        return self.held[definition.name]


def value_of(definition: Parameter) -> st.SearchStrategy[float]:
    if definition.kind is not Kind.REAL:
        return st.integers(int(definition.minimum), int(definition.maximum)).map(float)
    return st.floats(definition.minimum, definition.maximum).map(parameters._as_held)


values = st.fixed_dictionaries({}, optional={p.name: value_of(p) for p in PARAMETERS}).filter(bool)


def written(text: str, tmp_path: Path) -> Path:
    file = tmp_path / "values.yaml"
    file.write_text(text)
    return file


@pytest.fixture
def robot() -> Robot:
    return Robot()


@given(values)
def test_what_is_written_is_read_again(
    tmp_path_factory: pytest.TempPathFactory, wanted: Values
) -> None:
    exported = ParameterFile(wanted, "ESP32", "012345678901", "0.1.0")
    folder = tmp_path_factory.getbasetemp()
    assert load_parameter_file(written(exported.text(), folder)) == exported
    assert load_parameter_file(written(json.dumps(exported.as_mapping()), folder)) == exported


def test_each_line_has_its_unit(robot: Robot) -> None:
    text = ParameterFile.of_robot(robot.list(), None).text()
    for line, parameter in zip(text.splitlines()[-len(PARAMETERS) :], PARAMETERS, strict=True):
        assert line.split()[0] == f"{parameter.name}:"
        assert line.split()[2:] == parameter.unit.value.split()[:1]
    assert "board" not in text
    assert list(yaml.safe_load(text)) == ["parameters"]


@pytest.mark.parametrize(
    ("line", "value"),
    [
        ("wheel_radius: 0.04", 0.04),
        ("wheel_radius: 0.04 m", 0.04),
        ("wheel_radius: 4e-2 m", 0.04),
        ("left_motor_inverted: true", 1.0),
        ("max_duty: 0.5 duty", 0.5),
        ("integral_gain: 12 duty/m", 12.0),
    ],
)
def test_a_value_may_have_its_unit(line: str, value: float, tmp_path: Path) -> None:
    read = load_parameter_file(written(f"parameters: {{{line}}}", tmp_path))
    assert read == ParameterFile({line.split(":")[0]: value})
    assert read.source == "an unknown board"


@given(values)
def test_all_that_differs_is_set_and_only_that(wanted: Values) -> None:
    robot = Robot()
    expected = differences(robot.list(), wanted)
    assert robot.set_all(wanted) == expected
    assert sorted(robot.order) == sorted(d.name for d in expected)
    assert differences(robot.list(), wanted) == ()
    others = [name for name in PARAMETER_BY_NAME if name not in wanted]
    assert all(robot.held[name] == PARAMETER_BY_NAME[name].default for name in others)
    assert robot.saved == {}


WANTED = {"estop_input_enabled": 0.0, "wheel_radius": 0.04, "max_duty": 1.0, "path_gain": 1.5}
"""One of them is the default."""
REFUSED = errors.DeviceRefused(RefusalCode.NOT_STOPPED, "the request")
CONTRADICTION = errors.DeviceRefused(RefusalCode.CONTRADICTION, "the request")
STORE_FAILED = errors.DeviceRefused(RefusalCode.STORE_FAILED, "the request")
LOST = errors.LinkLost("unplugged")


def failing(error: BaseException, when: Callable[..., bool]) -> Callable[..., None]:
    """Raises it in the calls with such arguments."""

    def fail(*arguments: Any) -> None:
        if when(*arguments):
            raise error

    return fail


@pytest.fixture
def before(robot: Robot) -> Values:
    """What the robot held at first."""
    return dict(robot.held)


def test_the_switch_of_the_estop_contact_is_set_last(robot: Robot) -> None:
    robot.set_all(WANTED)
    assert robot.order == ["wheel_radius", "path_gain", "estop_input_enabled"]


@pytest.mark.parametrize("name", [name for name in WANTED if name != "max_duty"])
@pytest.mark.parametrize("answered", [False, True])
@pytest.mark.parametrize("error", [REFUSED, errors.RequestTimeout("no answer"), LOST])
def test_after_a_failure_the_previous_values_are_active(
    robot: Robot, before: Values, name: str, error: errors.WheelwireError, *, answered: bool
) -> None:
    fail = failing(error, lambda *given: given == (name, WANTED[name]))
    if answered:
        robot.before_set = fail
    else:  # it was carried out, and the answer was lost
        robot.after_set = fail
    with pytest.raises(errors.ImportFailed) as raised:
        robot.set_all(WANTED, save=True)
    assert robot.held == before
    assert robot.saves == []
    assert str(raised.value).startswith(f"{name} = {WANTED[name]:g}")
    assert "The previous values are active again." in str(raised.value)
    assert raised.value.__cause__ is error


def test_what_is_refused_while_moving_is_tried_first_and_stops_nothing(robot: Robot) -> None:
    robot.before_set = failing(
        REFUSED, lambda name, value: name == "wheel_radius" and value != robot.held[name]
    )
    with pytest.raises(errors.ImportFailed, match="wheel_radius"):
        robot.set_all({"path_gain": 1.5, "wheel_radius": 0.04, "integral_gain": 12.0})
    assert {"path_gain", "integral_gain"}.isdisjoint(robot.order)
    assert robot.reverts == 0


def test_values_that_were_set_before_a_refused_one_are_set_back_without_a_stop(
    robot: Robot, before: Values
) -> None:
    robot.before_set = failing(REFUSED, lambda *given: given == ("wheel_separation", 0.3))
    with pytest.raises(errors.ImportFailed, match=r"wheel_separation .*active again"):
        robot.set_all({"wheel_radius": 0.04, "wheel_separation": 0.3})
    assert (robot.held, robot.reverts) == (before, 0)


def test_what_can_no_longer_be_set_back_reverts_with_a_stop(robot: Robot, before: Values) -> None:
    """The robot began to drive in between."""
    robot.before_set = failing(
        REFUSED, lambda name, value: name == "wheel_separation" or value == before[name]
    )
    with pytest.raises(errors.ImportFailed, match="wheel_separation"):
        robot.set_all({"wheel_radius": 0.04, "wheel_separation": 0.3})
    assert (robot.held, robot.reverts) == (before, 1)


def test_one_value_needs_no_trial(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Robot, "trial", None)
    robot.set_all({"wheel_radius": 0.04, "max_duty": 1.0})
    assert robot.order == ["wheel_radius"]


def test_an_interrupt_restores_too(robot: Robot, before: Values) -> None:
    interrupts = iter([True])
    robot.before_set = failing(
        KeyboardInterrupt(),
        lambda name, _: (
            name == "path_gain"
            and robot.held["wheel_radius"] != before["wheel_radius"]
            and next(interrupts, False)
        ),
    )
    with pytest.raises(KeyboardInterrupt):
        robot.set_all(WANTED)
    assert robot.held == before


def test_restoring_waits_for_the_link(robot: Robot, before: Values) -> None:
    losses = iter([True] * 4)
    robot.before_set = failing(
        LOST, lambda name, _: name == "estop_input_enabled" and next(losses, False)
    )
    with pytest.raises(errors.ImportFailed, match="active again"):
        robot.set_all(WANTED)
    assert robot.held == before


def test_values_that_could_not_be_restored_are_named(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parameters, "RESTORE_TIMEOUT_S", 0.0)
    robot.before_set = failing(LOST, lambda *_: not robot.on_trial)
    with pytest.raises(
        errors.ImportFailed,
        match=r"not be restored: estop_input_enabled, path_gain, wheel_radius\. Reset the robot",
    ):
        robot.set_all(WANTED)


@pytest.mark.parametrize("moment", ["before_keep", "after_keep"])
def test_values_that_contradict_each_other_change_nothing(
    robot: Robot, before: Values, moment: str
) -> None:
    """Also where the answer was lost, and the device has kept them after all."""
    setattr(robot, moment, failing(CONTRADICTION, lambda: True))
    with pytest.raises(errors.ImportFailed, match=r"^the values were not set: .*active again"):
        robot.set_all(WANTED)
    assert robot.held == before


def test_what_is_taken_only_after_others_is_restored_too(robot: Robot, before: Values) -> None:
    robot.before_set = failing(
        CONTRADICTION,
        lambda name, value: (
            not robot.on_trial
            and (name, value) == ("path_gain", before[name])
            and robot.held["wheel_radius"] != before["wheel_radius"]
        ),
    )
    robot.before_save = failing(STORE_FAILED, lambda _: True)
    with pytest.raises(errors.ImportFailed, match="active again"):
        robot.set_all(WANTED, save=True)
    assert robot.held == before


def test_a_robot_that_was_reset_meanwhile_is_noticed(robot: Robot) -> None:

    def reset(name: str, value: float) -> None:
        if (name, value) == ("path_gain", 1.5):
            robot.held["wheel_radius"] = 0.033

    robot.after_set = reset
    with pytest.raises(errors.ImportFailed, match=r"wheel_radius = 0\.033 again; was it reset"):
        robot.set_all(WANTED)
    assert robot.held["path_gain"] == definition_of("path_gain").default


def test_all_values_of_the_file_are_saved_and_no_other(robot: Robot) -> None:
    robot.held["integral_gain"] = 12.0  # only tried
    robot.set_all(WANTED, save=True)
    assert robot.saved == WANTED
    full = {p.name: float(p.default) for p in PARAMETERS}
    robot.set_all(full, save=True)
    assert robot.saves[-1] is None  # at once
    assert robot.saved == robot.held == full


def test_a_save_that_fails_restores_and_says_what_was_saved(robot: Robot, before: Values) -> None:
    robot.before_save = failing(STORE_FAILED, lambda name: name == "max_duty")
    with pytest.raises(errors.ImportFailed, match="the values were not saved: ") as raised:
        robot.set_all(WANTED, save=True)
    assert robot.held == before
    assert str(raised.value).endswith("Saved before that: estop_input_enabled, wheel_radius.")


@pytest.mark.parametrize(
    ("wanted", "error"),
    [
        ({"wheel_radius": 0.04, "nonsense": 1.0}, errors.UnknownParameter),
        ({"wheel_radius": 0.04, "max_duty": 2.0}, errors.ParameterOutOfRange),
        ({"wheel_radius": 0.04, "max_duty": 1e300}, errors.ParameterOutOfRange),
    ],
)
def test_nothing_is_set_if_any_value_is_wrong(
    robot: Robot, wanted: Values, error: type[errors.WheelwireError]
) -> None:
    with pytest.raises(error):
        robot.set_all(wanted)
    assert robot.order == []
