"""`wheelwire doctor`: its output, its exit code, and the pages that it points to."""

from __future__ import annotations

import ast
import json
from pathlib import Path

from support.command import run

ROOT = Path(__file__).parents[4]
EXIT_FOUND = 30


def test_each_finding_has_its_section() -> None:
    names = {
        node.args[0].value
        for file in (
            *(ROOT / "host/wheelwire/tools/doctor").glob("*.py"),
            ROOT / "host/wheelwire/cli/doctor.py",
        )
        for node in ast.walk(ast.parse(file.read_text("utf-8")))
        if isinstance(node, ast.Call)
        and getattr(node.func, "id", "") == "Finding"
        and isinstance(node.args[0], ast.Constant)
    }
    page = (ROOT / "docs/doctor.md").read_text("utf-8")
    assert len(names) > 25
    assert names == {line[3:] for line in page.splitlines() if line.startswith("## ")}


def test_a_robot_out_of_reach_is_a_finding() -> None:
    result = run("doctor", "/dev/no-such-port", "--json")
    assert result.returncode == EXIT_FOUND, result.stderr
    found = json.loads(result.stdout)[-1]
    assert found["name"] == "no-answer"
    assert "/dev/no-such-port" in found["problem"]
    assert found["page"] == "docs/doctor.md#no-answer"


def test_a_sound_robot_adds_nothing() -> None:
    alone, with_robot = run("doctor", "--json"), run("doctor", "mock", "--json")
    assert with_robot.returncode == alone.returncode, with_robot.stderr
    assert json.loads(with_robot.stdout) == json.loads(alone.stdout)
