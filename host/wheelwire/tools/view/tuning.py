"""Parameters on trial: changed while the robot drives, undone, reverted or saved.

Each method asks the robot and waits: one thread at a time may call them.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from wheelwire_protocol.codes import RefusalCode

from ...errors import DeviceRefused, InvalidCommand, WheelwireError
from ...parameters import ParameterInfo, Parameters, Trial, check_value, definition_of, number_text

LOST = "the trial was lost with the link: the robot has its previous values again"


class Tuning:
    """The values of one robot, and those on trial.

    Args:
        parameters: Parameters of the robot.
        check_save: Raises an InvalidArgument for a parameter that would not stay saved.

    Attributes:
        infos: All parameters, as last read.
        values: The active ones.
        changed: By name, the value of before the trial.
        unsaved: Names of active values that could not be saved.
    """

    def __init__(self, parameters: Parameters, check_save: Callable[[str], None]) -> None:
        self.infos: dict[str, ParameterInfo] = {}
        self.values: dict[str, float] = {}
        self.changed: dict[str, float] = {}
        self.unsaved: list[str] = []
        self._parameters = parameters
        self._check_save = check_save
        self._trial: Trial | None = None
        self._steps: list[tuple[str, float]] = []
        """Names, each with its value before."""

    @property
    def is_active(self) -> bool:
        """Whether a trial runs."""
        return self._trial is not None

    def read(self) -> str:
        """Read all parameters."""
        infos = {info.name: info for info in self._parameters.list()}
        # In this order: the screen may read these at any time, and shows their values.
        self.values = {name: info.value for name, info in infos.items()}
        self.infos = infos
        return ""

    def set(self, name: str, text: str) -> str:
        """Try a value: it is active at once; the first one begins the trial."""
        definition, info = definition_of(name), self.infos[name]
        try:
            value = float(text.strip().replace(",", "."))
        except ValueError:
            raise InvalidCommand(f"{name} = {text!r}: give a number") from None
        value = check_value(definition, value, (info.minimum, info.maximum))
        before = self.values[name]
        self._try(name, value)
        self._steps.append((name, before))
        self.changed.setdefault(name, before)
        return f"{name} = {number_text(self.values[name])} on trial, was {number_text(before)}"

    def undo(self) -> str:
        """Undo the newest change."""
        if not self._steps:
            raise InvalidCommand("nothing was changed: there is nothing to undo")
        name, before = self._steps[-1]
        self._try(name, before)
        self._steps.pop()
        if all(name != step for step, _ in self._steps):
            del self.changed[name]
        return f"{name} = {number_text(before)} again"

    def revert(self) -> str:
        """End the trial: the wheels stop, and the values of before it are active again."""
        if self._trial is None:
            raise InvalidCommand("nothing is on trial: there is nothing to revert")
        self._leave()
        self.read()
        return "reverted: the values from before the trial are active"

    def save(self) -> str:
        """Save the values on trial, and end it. Only while the robot stands."""
        names = list(dict.fromkeys([*self.unsaved, *self.changed]))
        if not names:
            raise InvalidCommand("nothing was changed: there is nothing to save")
        for name in names:
            self._check_save(name)
        if self._trial is not None:
            try:
                self._trial.keep()
            except WheelwireError:
                self.abandon()
                raise
            self.changed = {}  # or leaving would undo them
            self._leave()
        self.unsaved = names
        for name in names:
            self._parameters.save(name)
            self.unsaved = self.unsaved[1:]
        return f"saved: {', '.join(names)}"

    def lose(self) -> str:
        """The link was lost, and the trial with it: the robot reverts by itself."""
        self.abandon()
        return LOST

    def abandon(self) -> None:
        """As `revert`, without reading the values; a robot out of reach reverts by itself."""
        with suppress(WheelwireError):
            self._leave()

    def _leave(self) -> None:
        trial, self._trial = self._trial, None
        self.values = self.values | self.changed
        self.changed, self._steps = {}, []
        if trial is not None:
            trial.__exit__(None, None, None)

    def _try(self, name: str, value: float) -> None:
        if self._trial is None:
            trial = self._parameters.trial()
            trial.__enter__()
            self._trial = trial
        try:
            self.values[name] = self._parameters.set(name, value)
        except WheelwireError as error:
            if isinstance(error, DeviceRefused) and error.code == RefusalCode.NO_TRIAL:
                raise InvalidCommand(self.lose()) from error
            if not self._steps:
                if isinstance(error, DeviceRefused):
                    with suppress(WheelwireError):  # nothing changed, and to revert would stop
                        self._trial.keep()
                self.abandon()
            raise
