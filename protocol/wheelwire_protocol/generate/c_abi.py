"""A C header of this project as ctypes: structures, callbacks, enumerations and signatures.

It reads the plain style of these headers, and refuses what it does not know: ctypes takes what is
not declared for an int, so a pointer would lose its upper half. ruff sets the blank lines.
"""

from __future__ import annotations

import re
from pathlib import Path

from .text import banner, lines

_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_CONSTANT = re.compile(r"#define (\w+) (\d+)$", re.MULTILINE)
_NOT_C = re.compile(r"^#.*$|^extern \"C\" \{$|^\}$", re.MULTILINE)
"""Directives, and what makes a header one of C++ as well."""
_DECLARATION = re.compile(r"\s*([^;{]+(?:\{[^}]*\}[^;]*)?);")
_OPAQUE = re.compile(r"typedef struct (\w+) \1")
_STRUCTURE = re.compile(r"typedef struct (\w+) \{(.*)\} \1")
_ENUMERATION = re.compile(r"enum (\w+) \{(.*)\}")
_CALLBACK = re.compile(r"typedef (.+) \(\*(\w+)\)\((.*)\)")
_FUNCTION = re.compile(r"\w+_EXPORT (.+?) ?(\w+)\((.*)\)")
_NAME = re.compile(r"[a-z]\w*")
_VARIABLE = re.compile(r"(const )?(\w+)(\**)( \w+(?:\[(\d+)\])?)?")

_NUMBERS = {
    **{f"{u}int{n}_t": f"ctypes.c_{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64)},
    "size_t": "ctypes.c_size_t",
    "int": "ctypes.c_int",
    "float": "ctypes.c_float",
    "double": "ctypes.c_double",
    "char": "ctypes.c_char",
    "void": "None",
}


class _Writer:
    """Makes the lines of a module, one declaration after the other."""

    def __init__(self, prefix: str) -> None:
        self.lines: list[str] = []
        self.signatures: list[str] = []
        self._prefix = prefix
        self._types: dict[str, str] = {}
        """The header's own types, by their C names: a class, or a pointer to an unknown type."""

    def take(self, declaration: str) -> None:
        """Take any declaration.

        Raises:
            ValueError: The declaration is of an unknown kind.
        """
        for pattern, take in (
            (_OPAQUE, self._take_opaque),
            (_STRUCTURE, self._take_structure),
            (_ENUMERATION, self._take_enumeration),
            (_CALLBACK, self._take_callback),
            (_FUNCTION, self._take_function),
        ):
            if found := pattern.fullmatch(declaration):
                take(*found.groups())
                return
        raise ValueError(f"{declaration}: this declaration is not known here")

    def _take_opaque(self, name: str) -> None:
        self._types[name] = "ctypes.c_void_p"

    def _take_structure(self, name: str, body: str) -> None:
        self._types[name] = self._class_of(name)
        fields = [
            f'("{_NAME.findall(field)[-1]}", {self._type_of(field, of_field=True)})'
            for field in body.split(";")[:-1]
        ]
        self.lines += [
            f"class {self._types[name]}(ctypes.Structure):",
            f'    """`{name}`."""',
            f"    _fields_ = {_tuple(fields)}",
        ]

    def _take_enumeration(self, name: str, body: str) -> None:
        members = [member.strip() for member in body.split(",")]
        # They begin as its name does, or as all names of the header.
        starts = (f"{name.rpartition('_')[0]}_".upper(), f"{self._prefix}_".upper())
        start = next(one for one in starts if all(member.startswith(one) for member in members))
        self.lines += [
            f"class {self._class_of(name)}(enum.IntEnum):",
            f'    """`{name}`."""',
            *(f"    {member.removeprefix(start)}" for member in members),
        ]

    def _take_callback(self, result: str, name: str, parameters: str) -> None:
        types = [self._type_of(one, of_callback=True) for one in parameters.split(",")]
        self._types[name] = self._class_of(name)
        self.lines += [
            f"{self._types[name]} = ctypes.CFUNCTYPE({', '.join([self._type_of(result), *types])})",
            f'"""`{name}`."""',
            "",
            "",
        ]

    def _take_function(self, result: str, name: str, parameters: str) -> None:
        types = [] if parameters == "void" else map(self._type_of, parameters.split(","))
        self.signatures.append(f'    "{name}": ({self._type_of(result)}, {_tuple(list(types))}),')

    def _class_of(self, name: str) -> str:
        return "".join(map(str.capitalize, name.removeprefix(f"{self._prefix}_").split("_")))

    def _type_of(self, variable: str, *, of_field: bool = False, of_callback: bool = False) -> str:
        found = _VARIABLE.fullmatch(variable.strip())
        if found is None:
            raise ValueError(f"{variable}: this type is not known here")
        constant, name, stars, _, length = found.groups()
        depth = len(stars)
        # Bytes that are only read may be passed as such. Not the bytes that a callback gets: as a
        # string they would end at the first zero.
        if depth and name in ("char", "uint8_t") and constant and not of_callback:
            return "ctypes.c_char_p"
        if depth and name in ("void", "char", "uint8_t"):
            kind, depth = "ctypes.c_void_p", depth - 1
        else:
            kind = _NUMBERS.get(name) or self._types[name]
            # What only the library looks into is a pointer already.
            depth -= kind == "ctypes.c_void_p"
        kind = "ctypes.POINTER(" * depth + kind + ")" * depth
        return f"{kind} * {length}" if of_field and length else kind


def _tuple(items: list[str]) -> str:
    return f"({', '.join(items)}{',' * (len(items) == 1)})"


def generate(path: Path, prefix: str) -> str:
    """The text of a Python module with what the header at `path` declares.

    Args:
        path: The header.
        prefix: What its names begin with, which those in Python leave out.

    Raises:
        ValueError: It declares something that is not known here.
    """
    text = _COMMENT.sub("", path.read_text("utf-8"))
    declarations = _NOT_C.sub("", text)
    if left := _DECLARATION.sub("", declarations).strip():
        raise ValueError(f"{left}: this declaration is not known here")
    writer = _Writer(prefix)
    for found in _DECLARATION.finditer(declarations):
        writer.take(" ".join(found[1].split()))
    start = f"{prefix}_".upper()
    names = (f"{name.removeprefix(start)} = {value}" for name, value in _CONSTANT.findall(text))
    return f'''\
"""What `{path.name}` declares, for ctypes.

{banner("ctypes declarations", path.name)}
"""

from __future__ import annotations

import ctypes
import enum
from typing import Any

{lines(names)}


{lines(writer.lines)}


SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {{
{lines(writer.signatures)}
}}
"""Of each function the types of its result and arguments."""
'''
