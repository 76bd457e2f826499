"""package.xml and setup.py against each other, the distribution, and what is imported."""

from __future__ import annotations

import ast
import runpy
import sys
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch
from xml.etree import ElementTree as ET

import pytest

import wheelwire

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[3]
PACKAGE = ROOT / "ros_node"
NAME = "wheelwire_ros"
OURS = {"wheelwire", "wheelwire_protocol", NAME}
FROM_PIP = {"setuptools"}
ROSDEP_KEYS = {"numpy": "python3-numpy", "pytest": "python3-pytest", "yaml": "python3-yaml"}
OF_THE_TESTS = {"support", "tomli", "tomllib"}
TESTS = ("tests/ros", "tests/unit/ros_package")


@pytest.fixture
def manifest() -> ET.Element:
    return ET.parse(PACKAGE / "package.xml").getroot()  # noqa: S314 - our own file


@pytest.fixture
def setup(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What setup.py hands to setuptools."""
    handed: dict[str, Any] = {}
    setuptools = ModuleType("setuptools")
    setuptools.setup = lambda **options: handed.update(options)  # type: ignore[attr-defined]
    monkeypatch.chdir(PACKAGE)
    with patch.dict(sys.modules, {"setuptools": setuptools}):
        runpy.run_path("setup.py")
    return handed


def test_one_version(manifest: ET.Element, setup: dict[str, Any]) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert manifest.findtext("version") == setup["version"] == project["version"]
    assert setup["install_requires"] == [f"wheelwire=={project['version']}"]
    assert wheelwire.__version__ == project["version"]


def test_ament_finds_the_package(setup: dict[str, Any]) -> None:
    installed = dict(setup["data_files"])
    marker = f"resource/{NAME}"
    assert installed["share/ament_index/resource_index/packages"] == [marker]
    assert (PACKAGE / marker).is_file()
    assert installed[f"share/{NAME}"] == ["package.xml"]
    assert setup["packages"] == [NAME]


@pytest.mark.parametrize("folder", ["launch", "config", "urdf", "udev"])
def test_whole_folders_are_installed(setup: dict[str, Any], folder: str) -> None:
    installed = dict(setup["data_files"])[f"share/{NAME}/{folder}"]
    files = [p for p in (PACKAGE / folder).iterdir() if p.is_file()]
    assert files
    assert sorted(installed) == sorted(str(path.relative_to(PACKAGE)) for path in files)


def test_the_executable_exists(setup: dict[str, Any]) -> None:
    (script,) = setup["entry_points"]["console_scripts"]
    assert script == f"hardware_robot = {NAME}.__main__:main"
    functions = _tree(PACKAGE / NAME / "__main__.py").body
    assert "main" in {f.name for f in functions if isinstance(f, ast.FunctionDef)}


def test_the_manifest_names_what_is_imported(manifest: ET.Element) -> None:
    declared = {element.text for element in manifest.findall("exec_depend")}
    sources = [*(PACKAGE / NAME).glob("*.py"), *(PACKAGE / "launch").glob("*.py")]
    imported = _needed(sources)
    assert imported <= declared
    assert {"rclpy", "python3-numpy"} <= imported


def test_the_manifest_names_what_the_tests_import(manifest: ET.Element) -> None:
    of_the_node = {element.text for element in manifest.findall("exec_depend")}
    declared = {element.text for element in manifest.findall("test_depend")}
    imported = _needed(file for folder in TESTS for file in (ROOT / folder).glob("*.py"))
    assert imported - of_the_node == declared


def test_the_addresses_are_the_distributions(manifest: ET.Element) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    addresses = {url.text for url in manifest.findall("url")}
    assert addresses == set(project.get("urls", {}).values())


def test_its_changes_are_where_ros_looks_for_them(manifest: ET.Element) -> None:
    lines = (PACKAGE / "CHANGELOG.rst").read_text("utf-8").splitlines()
    assert lines[1] == f"Changelog for package {NAME}"
    assert lines[0] == lines[2] == "^" * len(lines[1])
    releases = [title for title, rule in pairwise(lines) if rule and set(rule) == {"-"}]
    assert releases[0] == "Forthcoming"
    assert manifest.findtext("version") in releases


def test_a_robot_without_that_lidar_needs_nothing_of_it(manifest: ET.Element) -> None:
    named = {element.text for element in manifest if element.tag.endswith("depend")}
    assert "rplidar_ros" not in named


def _needed(sources: Iterable[Path]) -> set[str]:
    """The rosdep keys of what is imported, but for this repository and Python itself."""
    imported = {module for source in sources for module in _imports(_tree(source))}
    known = OURS | FROM_PIP | OF_THE_TESTS | sys.stdlib_module_names
    return {ROSDEP_KEYS.get(module, module) for module in imported - known}


def _tree(source: Path) -> ast.Module:
    return ast.parse(source.read_text())


def _imports(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.partition(".")[0]
