"""YAML text: no key occurs twice, each key has its line, and errors say what to do."""

from __future__ import annotations

import re
from typing import Any

import yaml

from ...errors import ConfigurationError, shown

LARGEST = 100_000
"""Most values in a file, where each alias counts as the values that it repeats."""
_TIMESTAMP = "tag:yaml.org,2002:timestamp"

_CURES = (
    (r"'\\t'", "indent with spaces, not with a tab"),
    (r"mapping values are not allowed", "one colon too many, or a wrong indentation"),
    (r"could not find expected ':'", "write `name: value`, with a colon and a space"),
    (
        r"expected ',' or '[\]}]'|expected the node content",
        "a comma or a closing bracket is missing",
    ),
    (r"while scanning a quoted scalar|unexpected end of stream", "a closing quote is missing"),
    (r"escape character", "inside double quotes write \\\\ for a backslash"),
    (
        r"undefined alias|found duplicate anchor",
        "an alias (*name) needs its anchor (&name) before it",
    ),
    (r"constructor for the tag|tag handle", "leave out the tag (!...)"),
    (r"single document|document start", "keep only one document: remove the line `---`"),
    (r"cannot start any token", "put a text with such a character in quotes"),
    (r"unhashable|mapping node", "a key has to be a word"),
    (r"expected <block end>", "the lines of one section need the same indentation"),
)
"""Patterns of the messages of PyYAML's parser, and what to do about each."""


def parse(text: str) -> tuple[object, dict[str, int]]:
    """The content, and the line of each key by its dotted name.

    Raises:
        ConfigurationError: The text is not YAML. The message begins with the line, if known.
    """
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            return None, {}
        if _size(node, {}) > LARGEST:
            raise ConfigurationError(
                f": its aliases (*name) multiply to more than {LARGEST} values: write them out"
            )
        lines: dict[str, int] = {}
        _note_lines(node, "", lines)
        return loader.construct_document(node), lines
    except yaml.YAMLError as error:
        raise ConfigurationError(_syntax(error, text)) from error
    except (ValueError, TypeError) as error:  # for example, an invalid number
        raise ConfigurationError(f": {' '.join(str(error).split())}") from error
    except RecursionError:
        raise ConfigurationError(": the lines are nested too deeply") from None


def dump(content: object) -> str:
    """The text of a file with this content; the innermost mappings stand in one line."""
    return yaml.safe_dump(content, sort_keys=False, default_flow_style=None)


def _syntax(error: yaml.YAMLError, text: str) -> str:
    """The line, its text and the cure, in place of the parser's words."""
    if isinstance(error, _Duplicate):
        return f", line {error.line}: {error}"
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if mark is None:  # a reader's error has a position instead of a mark
        position = getattr(error, "position", 0)
        line = text.count("\n", 0, position) + 1
        return f", line {line}: remove the invalid character, or give another file"
    # The parser notices a missing quote or bracket only at the end of the file.
    rows = text.splitlines()
    row = min(mark.line, len(rows) - 1)
    while row > 0 and not rows[row].strip():
        row -= 1
    said = f"{getattr(error, 'context', '')} {getattr(error, 'problem', '')}"
    cures = (cure for pattern, cure in _CURES if re.search(pattern, said))
    cure = next(cures, "write `name: value`, and indent sections with spaces")
    return f", line {row + 1}: {shown(rows[row].strip())}: {cure}"


def _size(node: yaml.Node, known: dict[int, int]) -> int:
    """How many values a node has, each alias counted again; bounded, to stay quick."""
    if id(node) in known:
        return known[id(node)]
    known[id(node)] = LARGEST + 1  # of an alias within its own anchor, which never ends
    size = 1
    if isinstance(node, yaml.CollectionNode):
        for entry in node.value:
            for each in entry if isinstance(entry, tuple) else (entry,):
                size = min(size + _size(each, known), LARGEST + 1)
    known[id(node)] = size
    return size


def _note_lines(node: yaml.Node, prefix: str, lines: dict[str, int]) -> None:
    # The name, the beginning and the value of each entry.
    entries: list[tuple[str, yaml.Node, yaml.Node]] = []
    if isinstance(node, yaml.MappingNode):
        stem = f"{prefix}." if prefix else ""
        scalars = [pair for pair in node.value if isinstance(pair[0], yaml.ScalarNode)]
        entries = [(f"{stem}{key.value}", key, value) for key, value in scalars]
    elif isinstance(node, yaml.SequenceNode):
        entries = [(f"{prefix}[{index}]", each, each) for index, each in enumerate(node.value)]
    for name, begin, value in entries:
        if name not in lines:  # an alias leads here again
            lines[name] = begin.start_mark.line + 1
            _note_lines(value, name, lines)


class _Duplicate(yaml.YAMLError):
    """A key occurs twice."""

    def __init__(self, key: str, first: int, line: int) -> None:
        super().__init__(f"{key} is given twice (first in line {first}): remove one of them")
        self.line = line


class _Loader(yaml.SafeLoader):
    """YAML requires unique keys, but PyYAML silently takes the last of several."""

    # Dates stay texts: no file of Wheelwire has one, and the error about a wrong date has no line.
    yaml_implicit_resolvers: dict[str, list[tuple[str, Any]]] = {  # noqa: RUF012 - PyYAML's own
        first: [(tag, pattern) for tag, pattern in resolvers if tag != _TIMESTAMP]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Raises YAMLError if a key occurs twice."""
        # First: the base class adds the keys of `<<`, which may be given again, to the node's own.
        seen: dict[str, int] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue  # the base class or the reader refuses such a key
            line = key.start_mark.line + 1
            if key.value in seen:
                raise _Duplicate(key.value, seen[key.value], line)
            seen[key.value] = line
        return super().construct_mapping(node, deep=deep)
