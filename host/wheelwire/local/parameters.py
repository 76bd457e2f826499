"""The firmware's parameters, kept in this process, and in a file if there is one."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable, Mapping
from pathlib import Path

from wheelwire_protocol.codes import RefusalCode
from wheelwire_protocol.parameters import PARAMETERS, Changes, Parameter

from ..errors import ConfigurationError, DeviceRefused, WheelwireError
from ..parameters import ParameterInfo, Parameters, checked_value

LOCAL_DEFAULTS = {
    "control_rate_hz": 200.0,
    "overrun_limit_us": 100_000.0,
    "estop_input_enabled": 0.0,
}
"""Where a thread of a multitasking computer differs from a chip that does nothing else, and a robot
without an e-stop contact from one that has it."""


def default_values(overrides: Mapping[str, float] | None = None) -> dict[str, float]:
    """The values of all parameters for a robot on local pins.

    Raises:
        UnknownParameter: An override names none.
        ParameterOutOfRange: An override is beyond its bounds.
    """
    values = {p.name: float(p.default) for p in PARAMETERS} | LOCAL_DEFAULTS
    for name, value in (overrides or {}).items():
        values[name] = checked_value(name, value)
    return values


class LocalParameters(Parameters):
    """Checked as on the device, and in force at once.

    Args:
        values: At the start, and again after `reset`; see `default_values`.
        apply: Called with all values, before the start and whenever one changed.
        check_stopped: Raises `DeviceRefused` for its argument while the robot drives.
        store: A JSON file that keeps what `save` saved; what it holds precedes `values`.

    Raises:
        ConfigurationError: The store's content is none of ours, or beyond the bounds.
    """

    def __init__(
        self,
        values: Mapping[str, float],
        apply: Callable[[Mapping[str, float]], None],
        check_stopped: Callable[[str], None],
        store: Path | None,
    ) -> None:
        self._lock = threading.Lock()
        self._defaults = dict(values)
        self._values = dict(values)
        self._apply = apply
        self._check_stopped = check_stopped
        self._store = store
        if store is not None and store.exists():
            self._values |= _load(store)
        apply(self._values)

    def list(self) -> tuple[ParameterInfo, ...]:
        """All parameters."""
        return tuple(
            ParameterInfo(
                name=p.name,
                value=self._values[p.name],
                default=self._defaults[p.name],
                minimum=float(p.minimum),
                maximum=float(p.maximum),
                unit=p.unit.value,
                kind=p.kind,
                doc=p.doc,
            )
            for p in PARAMETERS
        )

    def save(self) -> None:
        """Write the values to the store.

        Raises:
            DeviceRefused: While driving, where there is no store, or when it cannot be written;
                it is then as it was.
        """
        self._check_stopped("to save parameters")
        if self._store is None:
            raise _store_failed()
        new = self._store.with_name(self._store.name + ".new")
        try:
            with self._lock:
                new.write_text(json.dumps(self._values, indent=2) + "\n")
            os.replace(new, self._store)  # noqa: PTH105 - atomic: the old content or the new
        except OSError as error:
            raise _store_failed() from error

    def reset(self) -> None:
        """Go back to the values at the start, and empty the store; refused while driving."""
        self._check_stopped("to reset parameters")
        if self._store is not None:
            self._store.unlink(missing_ok=True)
        with self._lock:
            self._values = dict(self._defaults)
            self._apply(self._values)

    def _read(self, definition: Parameter) -> float:
        return self._values[definition.name]

    def _write(self, definition: Parameter, value: float) -> float:
        if definition.changes is not Changes.ALWAYS and value != self._values[definition.name]:
            self._check_stopped(f"{definition.name} = {value:g}")
        with self._lock:
            self._values = {**self._values, definition.name: value}
            self._apply(self._values)
        return value

    def _bounds(self, definition: Parameter) -> tuple[float, float]:
        return float(definition.minimum), float(definition.maximum)


def _store_failed() -> DeviceRefused:
    return DeviceRefused(RefusalCode.STORE_FAILED, "to save parameters")


def _load(store: Path) -> dict[str, float]:
    try:
        saved = json.loads(store.read_text())
        return {name: checked_value(name, value) for name, value in saved.items()}
    except (OSError, ValueError, TypeError, AttributeError, WheelwireError) as error:
        raise ConfigurationError(f"{store}: {error}; mend the file or remove it") from error
