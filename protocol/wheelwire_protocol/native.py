"""The firmware's core as a library, loaded from an installed wheel or a checkout's build.

`core` wraps its robot; `decoder` and `bulk` use its decoder. Importing this module loads nothing.
The first use loads the library, and raises `NativeMissingError` if this release's library is
missing.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from . import core_abi as abi
from .core_abi import ABI
from .types import SCHEMA_HASH

ENVIRONMENT = "WHEELWIRE_CORE"
LIBRARY = f"libwheelwire_core.{'dylib' if sys.platform == 'darwin' else 'so'}"
_PACKAGE = Path(__file__).parent
# The repository's root, if this is a checkout. For an installed package it is any directory.
_CHECKOUT = _PACKAGE.parents[1]

Result = TypeVar("Result")


class NativeMissingError(Exception):
    """The core's library is missing or of another release. The message says what to do."""


def locate(name: str, package: Path) -> Path:
    """The path of a native part: in a checkout's build, else in the installed package.

    In a checkout only its build counts: an installed copy could silently be outdated.
    """
    return (_CHECKOUT / "build" / "host" if is_checkout() else package) / name


def is_checkout() -> bool:
    """Whether this is a checkout, which builds its own native parts."""
    return (_CHECKOUT / "firmware").is_dir()


def remedy() -> str:
    """What to do about a missing native part, for error messages."""
    if is_checkout():
        return "build it with `make sim`"
    return (
        "install a wheel of wheelwire for this computer, or install a C++20 compiler and run "
        "`pip install --force-reinstall --no-binary wheelwire wheelwire`"
    )


def library_path() -> Path:
    """$WHEELWIRE_CORE if it is set, else what `locate` finds."""
    named = os.environ.get(ENVIRONMENT)
    return Path(named) if named else locate(LIBRARY, _PACKAGE)


def is_present() -> bool:
    """Whether `load` would find a library of this release."""
    try:
        load()
    except NativeMissingError:
        return False
    return True


@cache
def load() -> ctypes.PyDLL:
    """Load the library, once per process.

    Its calls keep the interpreter's lock: they take microseconds, while getting the lock back from
    a busy thread takes up to `sys.getswitchinterval()`. For long calls use `load_unlocked`.

    Raises:
        NativeMissingError: It is missing or of another release.
    """
    path = library_path()
    try:
        library = ctypes.PyDLL(str(path))
    except OSError as error:
        reason = error if path.exists() else f"{path} does not exist"
        raise NativeMissingError(
            f"the firmware's core cannot be loaded: {reason}; {_remedy()}"
        ) from None
    try:
        # The functions are not declared yet, so ctypes takes the hash for a signed int.
        release = library.wheelwire_abi(), library.wheelwire_schema_hash() & 0xFFFFFFFF
    except AttributeError:
        # A library without these functions is of another release as well.
        release = (0, 0)
    # Before `declare`, which would fail on a function that the other release does not have.
    if release != (ABI, SCHEMA_HASH):
        raise NativeMissingError(f"{path} is of another release; {_remedy()}")
    declare(library, abi.SIGNATURES)
    return library


@cache
def load_unlocked() -> ctypes.CDLL:
    """As `load`, but other threads run during its calls."""
    # Load the same file again: the handle's class decides whether a call keeps the lock.
    library = ctypes.CDLL(load()._name)
    declare(library, abi.SIGNATURES)
    return library


def declare(library: ctypes.CDLL, signatures: Mapping[str, tuple[Any, tuple[Any, ...]]]) -> None:
    """Declare functions: by name, the types of the result and of the arguments.

    ctypes treats as an int what is not declared; a pointer would lose its upper half.
    """
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments


def typed(kind: Callable[..., Result], raw: object, **known: Any) -> Result:
    """What a C structure or a message holds: the fields of `kind`, by their names and types.

    Args:
        kind: A class whose annotated fields are its arguments.
        raw: Where the fields are from; its texts are bytes.
        known: Fields that are not in it, or not in this form.

    Raises:
        ValueError: It has a code of a later release.
    """
    for name, convert in _fields(kind):
        if name not in known:
            known[name] = convert(getattr(raw, name))
    return kind(**known)


@cache
def _fields(kind: Callable[..., Any]) -> tuple[tuple[str, Any], ...]:
    """Each field's name, and what makes its value."""
    types = get_type_hints(kind)
    return tuple((name, bytes.decode if one is str else one) for name, one in types.items())


def _remedy() -> str:
    if os.environ.get(ENVIRONMENT):
        return f"unset ${ENVIRONMENT}, or set it to the library of this release"
    return remedy()
