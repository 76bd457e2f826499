"""docs/safety.md: its rules are the explorer's, and what it names exists."""

from __future__ import annotations

import re
import subprocess

import pytest

from support import exploring

PAGE = (exploring.ROOT / "docs" / "safety.md").read_text("utf-8")
FIRMWARE = exploring.ROOT / "firmware" / "esp32"
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in PAGE.splitlines()
    if re.match(r"\| S\d\d ", line)
]


@pytest.mark.skipif(not exploring.PROGRAM.exists(), reason="not built: make cpp-tests")
def test_its_rules_are_the_explorers() -> None:
    result = subprocess.run(
        [exploring.PROGRAM, "--rules"], capture_output=True, text=True, check=True
    )
    rules = [line.replace("\t", " ") for line in result.stdout.splitlines()]
    assert [row[0] for row in ROWS] == rules


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0].split()[0])
def test_what_enforces_and_tests_a_rule_exists(row: list[str]) -> None:
    _, _, _, enforced, tested, _ = row
    for name in re.findall(r"`([\w/]+\.[ch]pp)`", enforced):
        file = FIRMWARE / (name if "/" in name else f"core/{name}")
        assert file.exists(), name
    tests = re.findall(r"`([\w.]+)`", tested)
    assert tests
    folders = ["firmware/esp32/test", "firmware/esp32/test/sim", "tests/firmware", "tests/explore"]
    for name in tests:
        assert any((exploring.ROOT / folder / name).exists() for folder in folders), name


def test_functions_that_it_names_are_in_their_files() -> None:
    for file, names in re.findall(r"`(\w+\.[ch]pp)` \((`\w+`(?:, `\w+`)*)\)", PAGE):
        text = (FIRMWARE / "core" / file).read_text("utf-8")
        for name in re.findall(r"\w+", names):
            assert re.search(rf"\b{name}\(", text), (file, name)


def test_a_rule_beside_the_chip_names_what_exists() -> None:
    rows = [line.split("|") for line in PAGE.splitlines() if line.startswith("| H")]
    assert rows
    host = exploring.ROOT / "host" / "wheelwire"
    for row in rows:
        for file, names in re.findall(r"`([\w/]+\.py)` \((`\w+`(?:, `\w+`)*)\)", row[4]):
            folder = exploring.ROOT if file.startswith("ros_node/") else host
            text = (folder / file).read_text("utf-8")
            for name in re.findall(r"\w+", names):
                assert re.search(rf"def {name}\(", text), (file, name)
        for name in re.findall(r"`([\w.]+)`", row[5]):
            assert list((exploring.ROOT / "tests").glob(f"*/**/{name}")), name
