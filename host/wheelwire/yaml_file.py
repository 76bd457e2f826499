"""YAML files in which no key occurs twice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from .errors import ConfigurationError


def load_yaml(source: Path) -> object:
    """The content of a YAML file, in which no key occurs twice.

    Raises:
        ConfigurationError: It cannot be read, or is not YAML.
    """
    try:
        return yaml.load(source.read_text("utf-8"), _UniqueKeys)  # noqa: S506 - it is a SafeLoader
    except FileNotFoundError as error:
        raise ConfigurationError(f"{source}: there is no such file") from error
    except OSError as error:
        raise ConfigurationError(f"{source}: {error.strerror}") from error
    except (ValueError, yaml.YAMLError) as error:
        # A ValueError comes of bytes that are no text, and of a date that does not exist.
        raise ConfigurationError(f"{source}: {' '.join(str(error).split())}") from error


class _UniqueKeys(yaml.SafeLoader):
    """YAML requires unique keys, but PyYAML silently takes the last of several."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Raises ConstructorError, a YAMLError, if a key occurs twice."""
        # First: the base class adds the keys of `<<`, which may be given again, to the node's own.
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue  # no key of any of our files: the base class or the reader refuses it
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    problem=f"{key.value} is given twice: remove one of them",
                    problem_mark=key.start_mark,
                )
            seen.add(key.value)
        return super().construct_mapping(node, deep=deep)
