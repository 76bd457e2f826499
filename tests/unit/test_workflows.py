"""The workflows: what they run, on what, what they may, and whose code they take in."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / ".github" / "workflows"
FILES = sorted(FOLDER.glob("*.yml"))
PINNED = re.compile(r"[\w.-]+/[\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+")
OWN = re.compile(r"\./\.github/workflows/[\w-]+\.yml")


def workflow(name: str) -> dict[Any, Any]:
    loaded = yaml.safe_load((FOLDER / f"{name}.yml").read_text("utf-8"))
    assert isinstance(loaded, dict)
    return loaded


def triggers(name: str) -> dict[str, Any]:
    """YAML 1.1 reads `on` as a truth value."""
    found = workflow(name)[True]
    assert isinstance(found, dict)
    return found


def needed(jobs: dict[str, Any], name: str) -> set[str]:
    """All jobs that end before this one begins."""
    direct = jobs[name].get("needs", [])
    direct = {direct} if isinstance(direct, str) else set(direct)
    return direct.union(*(needed(jobs, other) for other in direct))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_others_code_is_pinned_by_its_commit_and_names_its_release(path: Path) -> None:
    used = re.findall(r"^\s*(?:- )?uses: (.*)$", path.read_text("utf-8"), re.MULTILINE)
    assert used
    assert [line for line in used if not (PINNED.fullmatch(line) or OWN.fullmatch(line))] == []


def test_one_release_of_an_action_everywhere() -> None:
    text = "".join(path.read_text("utf-8") for path in FILES)
    used = set(re.findall(r"uses: ([\w.-]+/[\w./-]+)@(\S+ # \S+)", text))
    assert len(used) == len({action for action, _ in used})


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_workflow_may_read_and_a_job_says_what_it_may_besides(path: Path) -> None:
    loaded = workflow(path.stem)
    assert loaded["permissions"] == {"contents": "read"}
    writing = {
        name: job["permissions"] for name, job in loaded["jobs"].items() if "permissions" in job
    }
    if path.stem == "release":
        assert writing == {
            "release": {"contents": "write", "id-token": "write", "attestations": "write"},
            "pypi": {"id-token": "write"},
        }
    else:
        assert writing == {}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_no_step_keeps_the_token_of_the_checkout(path: Path) -> None:
    for job in workflow(path.stem)["jobs"].values():
        for step in job.get("steps", []):
            if "actions/checkout@" in step.get("uses", ""):
                assert step["with"]["persist-credentials"] is False


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_no_expression_is_pasted_into_a_script_from_outside(path: Path) -> None:
    """Only the matrix, which is the file's own; a branch's name may be a shell command."""
    for job in workflow(path.stem)["jobs"].values():
        for step in job.get("steps", []):
            assert re.findall(r"\$\{\{(?! matrix\.)[^}]*\}\}", step.get("run", "")) == []


def test_pushes_and_pull_requests_are_checked_and_tested() -> None:
    assert triggers("ci")["push"] == {"branches": ["main"]}
    assert {"pull_request", "workflow_call"} <= set(triggers("ci"))
    commands = "\n".join(
        step.get("run", "") for job in workflow("ci")["jobs"].values() for step in job["steps"]
    )
    for target in ("lint", "type", "gen-check", "test"):
        assert re.search(rf"^make .*\b{target}\b", commands, re.MULTILINE)


def test_both_processors_and_every_supported_python_are_tested() -> None:
    matrix = workflow("ci")["jobs"]["test"]["strategy"]["matrix"]
    assert matrix["python"] == ["3.10", "3.11", "3.12", "3.13"]
    assert any(runner.endswith("-arm") for runner in matrix["runner"])
    assert any(not runner.endswith("-arm") for runner in matrix["runner"])


def test_the_node_is_built_as_its_users_do_and_tested_on_both_releases() -> None:
    job = workflow("ci")["jobs"]["ros"]
    assert job["strategy"]["matrix"]["ros"] == ["jazzy", "kilted"]
    commands = [step.get("run", "") for step in job["steps"]]
    for target in ("colcon", "ros-test"):
        assert f"make {target} ROS=${{{{ matrix.ros }}}}" in commands


def test_nothing_is_released_before_the_tests_pass() -> None:
    jobs = workflow("release")["jobs"]
    assert jobs["test"]["uses"] == "./.github/workflows/ci.yml"
    publishing = [name for name, job in jobs.items() if "contents" in job.get("permissions", {})]
    assert publishing == ["release"]
    assert needed(jobs, "release") == set(jobs) - {"release", "pypi"}
    assert jobs["pypi"]["needs"] == "release"


def test_what_is_released_is_attested_first() -> None:
    steps = workflow("release")["jobs"]["release"]["steps"]
    attested = [
        number for number, step in enumerate(steps) if "actions/attest@" in step.get("uses", "")
    ]
    published = [number for number, step in enumerate(steps) if "gh release" in step.get("run", "")]
    assert len(attested) == len(published) == 1
    assert attested < published
    assert steps[attested[0]]["with"]["subject-path"] == "images/*"
    assert steps[published[0]]["run"].rstrip().endswith("images/*")


def test_what_decodes_a_core_dump_is_released_with_its_image() -> None:
    jobs = workflow("release")["jobs"]
    firmware = jobs["firmware"]
    assert firmware["env"]["IMAGE"] == "wheelwire-${{ matrix.chip }}.bin"
    assert firmware["env"]["SYMBOLS"] == "wheelwire-${{ matrix.chip }}.elf"
    build = "\n".join(step.get("run", "") for step in firmware["steps"])
    assert re.search(r'^cp .+/wheelwire\.elf .+/"\$SYMBOLS"$', build, re.MULTILINE)
    uploaded = [
        step["with"]["path"].split()
        for step in firmware["steps"]
        if "actions/upload-artifact@" in step.get("uses", "")
    ]
    assert len(uploaded) == 1
    assert " env.SYMBOLS " in " ".join(uploaded[0])
    sums = [step["run"] for step in jobs["release"]["steps"] if "sha256sum" in step.get("run", "")]
    assert len(sums) == 1
    assert {"*.bin", "*.elf"} <= set(sums[0].split())


def test_every_job_ends() -> None:
    for path in FILES:
        for name, job in workflow(path.stem)["jobs"].items():
            assert "uses" in job or job.get("timeout-minutes", 0) > 0, f"{path.name}: {name}"


def test_make_knows_what_the_weekly_run_asks_for() -> None:
    makefile = (ROOT / "Makefile").read_text("utf-8")
    for target in workflow("weekly")["jobs"]["proof"]["strategy"]["matrix"]["target"]:
        assert re.search(rf"^{target.split()[0]}:", makefile, re.MULTILINE)


def test_a_bot_looks_after_the_actions_and_the_packages() -> None:
    updates = yaml.safe_load((ROOT / ".github" / "dependabot.yml").read_text("utf-8"))["updates"]
    assert {update["package-ecosystem"] for update in updates} == {"github-actions", "pip"}
    assert all(update["schedule"]["interval"] == "weekly" for update in updates)
