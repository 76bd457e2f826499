"""Reading a YAML file, and saying what is wrong in it: file, line, key, value, what to write."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from ...arguments import at_home, is_number
from ...errors import ConfigurationError, InvalidArgument, meant, shown, with_point

LARGEST_BYTES = 1_000_000
"""All files of Wheelwire are far smaller; a log or a recording, given by mistake, is larger."""

# A GPIO travels as a signed byte. The core's rules decide whether the chip has it.
_LAST_PIN = 127

_KINDS: tuple[tuple[str, set[str], str], ...] = (
    (
        "robot",
        {"driver", "driver_type"},
        "a robot's file, to be given as ROBOT: where a command takes both, give ROBOT first, then "
        "FILE",
    ),
    (
        "board",
        {"chip", "stage"},
        "a board's file: store it with `wheelwire board write [ROBOT] FILE`, or name it in a "
        "robot's file by `board: FILE`",
    ),
    (
        "parameters",
        {"board_id", "firmware"},
        "a file of parameters, for `wheelwire params import [ROBOT] FILE`",
    ),
    (
        "profile",
        {"to_device", "to_host", "incidents"},
        "the profile of a bad line, for `wheelwire sim --faults FILE`",
    ),
    ("plant", {"variables"}, "a plant, for `wheelwire sim --plant FILE`"),
    ("answers", {"raised", "first", "second"}, "answers, for `wheelwire setup --answers FILE`"),
)
"""Kinds of files, the keys that only one kind has, and what the file is for."""

_TYPES = {
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    str: "a text; put a text that looks like a number in quotes",
}
"""The types that a dataclass of `Section.fill` may have, and what a person writes for them."""

_Code = TypeVar("_Code")
_Shape = TypeVar("_Shape")


@contextmanager
def reading(source: Path, kind: str) -> Iterator[object]:
    """The content of a YAML file; an error in the block becomes one that begins with file and line.

    Args:
        source: The file.
        kind: One of robot, board, parameters, profile, plant, answers. A file that is clearly of
            another kind raises an error, which says what that file is for.

    Raises:
        InvalidArgument: The file is a device.
        ConfigurationError: The file cannot be read, is not YAML or of another kind, or the block
            raised an error that begins with the key: `section.name = value: what to do`.
    """
    from . import yaml_text  # here: drivers import this package, and few of them read files

    text = _text_of(source)
    try:
        content, lines = yaml_text.parse(text)
    except ConfigurationError as error:
        raise ConfigurationError(f"{source}{error}") from error
    try:
        _refuse_other_kinds(content, kind)
        yield content
    except (ConfigurationError, InvalidArgument) as error:
        key = re.match(r"[\w.\[\]-]+", str(error))
        line = _line_of(key.group(), lines) if key else 0
        where = f"{source}, line {line}" if line else f"{source}"
        raise ConfigurationError(f"{where}: {error}") from error


def file_named(name: str | Path, folder: Path, kind: str) -> Path:
    """The built-in file of this name, else the file at this path; `kind` is for the message."""
    # The built-in ones first: their names mean the same in every folder.
    known = names_in(folder)
    if str(name) in known:
        return folder / f"{name}.yaml"
    if (file := at_home(Path(name))).exists():
        return file
    near = meant(name, known)
    hint = f"; did you mean {near}?" if near else ""
    raise ConfigurationError(
        f"{name}: there is no such file, and the built-in {kind}s are {', '.join(known)}{hint}"
    )


def names_in(folder: Path) -> list[str]:
    """The names of the files in a folder."""
    return sorted(path.stem for path in folder.glob("*.yaml"))


class Section:
    """A mapping of a file: names are checked at once, each value when it is asked for.

    Args:
        content: The section as YAML gives it.
        known: The names that the section may have.
        name: Name of the section; empty for the file itself, which must not be empty.
        elsewhere: Other sections of the file and their names, one of which may be meant.
    """

    def __init__(
        self,
        content: object,
        known: Collection[str],
        name: str = "",
        elsewhere: Mapping[str, Collection[str]] | None = None,
    ) -> None:
        self._prefix = f"{name}." if name else ""
        if not isinstance(content, Mapping):
            was = f"{name} = {shown(content)}" if name else f"the file holds {shown(content)}"
            was = "the file is empty" if content is None and not name else was
            raise ConfigurationError(f"{was}: it must be names with values, as in `name: value`")
        # YAML also has numbers and booleans as keys: as texts they are unknown names.
        self.values = {str(key): value for key, value in content.items()}
        known = [str(key) for key in known]
        for key in self.values:
            if key not in known:
                raise self.refusal(key, f"unknown key; {self._suggestion(key, known, elsewhere)}")

    def get(self, name: str, default: object = MISSING) -> Any:
        """The value, of any type; without a default the file has to have one."""
        if name not in self.values and default is MISSING:
            raise ConfigurationError(f"{self._prefix}{name} is missing: add it")
        return self.values.get(name, default)

    def code(self, name: str, codes: Mapping[str, _Code], default: object = MISSING) -> _Code:
        """The code whose name in `codes` is the value."""
        value = self.get(name, default)
        # The type first: a list or a mapping cannot be looked up.
        if not isinstance(value, str) or value not in codes:
            near = meant(value, codes)
            hint = f"; did you mean {near}?" if near else ""
            raise self.refusal(name, f"choose one of {', '.join(codes)}{hint}")
        return codes[value]

    def whole(self, name: str, high: int, default: object = MISSING, low: int = 0) -> int:
        """A whole number from `low` to `high`."""
        value = self.get(name, default)
        # Not isinstance: `yes` in YAML is True, an int, and must not mean 1.
        if type(value) is not int or not low <= value <= high:
            raise self.refusal(name, f"it must be a whole number, {low} to {high}")
        return value

    def above_zero(self, name: str, default: object = MISSING) -> float:
        """A number above 0."""
        value = self.get(name, default)
        if not is_number(value) or value <= 0:
            raise self.refusal(name, "it must be a number above 0")
        return float(value)

    def pin(self, name: str) -> int | None:
        """A GPIO; None without one: the core's rules decide which ones a board needs."""
        value = self.get(name, None)
        if value is None:
            return None
        if type(value) is not int or not 0 <= value <= _LAST_PIN:
            raise self.refusal(name, "it must be the number of a GPIO")
        return value

    def text(self, name: str) -> str | None:
        """A text; None without one."""
        if self.values.get(name) is not None:
            self._check_type(name, str)
        return self.values.get(name)

    def fill(self, shape: type[_Shape]) -> _Shape:
        """A dataclass whose fields are the names; a `__post_init__` checks the types itself."""
        hints = {} if hasattr(shape, "__post_init__") else get_type_hints(shape)
        for each in fields(shape):  # type: ignore[arg-type]
            if each.name in self.values:
                self._check_type(each.name, hints.get(each.name))
            elif each.default is MISSING and each.default_factory is MISSING:
                self.get(each.name)
        try:
            return shape(**self.values)
        except (ConfigurationError, InvalidArgument) as error:
            raise ConfigurationError(f"{self._prefix}{error}") from error

    def refusal(self, name: str, rule: str) -> ConfigurationError:
        """The error about a value, which may be missing."""
        value = self.values.get(name)
        return ConfigurationError(
            f"{self._prefix}{name} = {shown(value)}: {rule}{with_point(value)}"
        )

    def _check_type(self, name: str, hint: Any) -> None:
        kind, types = type(self.values[name]), get_args(hint) or (hint,)
        # Not isinstance: True is an int, too.
        if hint is not None and kind not in types and not (kind is int and float in types):
            expected = next(text for each, text in _TYPES.items() if each in types)
            raise self.refusal(name, f"it must be {expected}")

    def _suggestion(
        self, name: str, known: Collection[str], elsewhere: Mapping[str, Collection[str]] | None
    ) -> str:
        """The key that may be meant: the same name in another section, else a similar one here."""
        # Often the key is right and only its section is missing.
        places = [f"{each}.{name}" for each, names in (elsewhere or {}).items() if name in names]
        near = [self._prefix + one for one in [meant(name, known)] if one]
        if names := " or ".join(places or near):
            return f"did you mean {names}?"
        if name.isdigit():  # of `{wheel_radius: 0,03}`
            return "did you mean a number with a decimal point, such as 0.03?"
        return f"the keys are {', '.join(known)}"


def _refuse_other_kinds(content: object, own: str) -> None:
    keys = {str(key) for key in content} if isinstance(content, Mapping) else set()
    found = [(kind, meant) for kind, marks, meant in _KINDS if keys & marks]
    if found and own not in [kind for kind, _ in found]:
        raise ConfigurationError(f"this is {found[0][1]}")


def _text_of(source: Path) -> str:
    # Reading a port would block, or take bytes from the robot.
    if source.exists() and not source.is_file() and not source.is_dir():
        raise InvalidArgument(
            f"{source} is a device, not a file: give a YAML file; where a command takes both, give "
            "ROBOT first, then FILE"
        )
    try:
        with source.open("rb") as file:
            data = file.read(LARGEST_BYTES + 1)
    except FileNotFoundError as error:
        raise ConfigurationError(f"{source}: there is no such file") from error
    except OSError as error:
        raise ConfigurationError(f"{source}: {error.strerror}") from error
    except ValueError as error:  # a name with a NUL in it
        raise ConfigurationError(f"{shown(str(source))}: no file can have this name") from error
    if len(data) > LARGEST_BYTES:
        raise ConfigurationError(
            f"{source}: the file is larger than {LARGEST_BYTES // 1000} kB: give a YAML file"
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigurationError(
            f"{source}, line {line}: this is not UTF-8 text: save the file as UTF-8, or give "
            "another file"
        ) from error


def _line_of(key: str, lines: Mapping[str, int]) -> int:
    """The line of a key, else of the section around it; 0 if the file has neither."""
    while key:
        if key in lines:
            return lines[key]
        key = key.rpartition(".")[0]
    return 0
