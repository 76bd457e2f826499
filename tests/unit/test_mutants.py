"""The mutations still fit the tree, and the program that tries them can be believed."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from mutants.run import failures, select, summary
from support.mutants import (
    ROOT,
    Group,
    Mutant,
    MutantError,
    Outcome,
    Verdict,
    Workspace,
    alone,
    judge,
    load,
    load_all,
)

PAGE = ROOT / "docs" / "testing.md"
ALL = [(group, mutant) for group in load_all() for mutant in group.mutants]
SIGN = Mutant("sign", "host/double.py", "2 * x", "-2 * x", "It drives backwards.")
SPARE = Mutant("spare", "host/double.py", "# spare", "# free", "Nothing.")
TYPO = Mutant("typo", "host/double.py", "def double", "def doubled", "Nothing.")


def wrong(group: Group, mutant: Mutant, root: Path = ROOT) -> Iterator[str]:
    """What is wrong with the data of a mutation, a line each."""
    name = f"{group.name}/{mutant.name}"
    try:
        mutant.apply((root / mutant.file).read_text("utf-8"))
    except (MutantError, OSError) as error:
        yield f"{name}: {error}"
    for text in (mutant.why, mutant.lives or "."):
        if not text.endswith("."):
            yield f"{name}: no full stop after {text!r}"
    if not (group.tests or group.command):
        yield f"{name}: no test of its group is named"


def test_each_mutation_applies_and_says_why() -> None:
    assert [line for group, mutant in ALL for line in wrong(group, mutant)] == []


def test_each_wrong_mutation_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("2 * x")
    group = Group("core", (), ("tests/a.py",), ())
    sound = Mutant("sound", "a.py", "2 * x", "-2 * x", "It drives backwards.")
    gone = Mutant("gone", "a.py", "3 * x", "-3 * x", "It drives backwards.")
    mute = Mutant("mute", "a.py", "2 * x", "-2 * x", "It drives backwards")
    lines = [line for mutant in (sound, gone, mute) for line in wrong(group, mutant, tmp_path)]
    assert [line.partition(":")[0] for line in lines] == ["core/gone", "core/mute"]
    assert list(wrong(Group("core", (), (), ()), sound, tmp_path)) == [
        "core/sound: no test of its group is named"
    ]


def test_no_two_mutations_are_one() -> None:
    assert len({mutant.name for _, mutant in ALL}) == len(ALL)
    # Tests and the explorer are asked separately whether they find it.
    changes = {(group.name, mutant.file, mutant.find, mutant.replace) for group, mutant in ALL}
    assert len(changes) == len(ALL)


@pytest.mark.parametrize("group", load_all(), ids=lambda group: group.name)
def test_the_tests_of_a_group_exist(group: Group) -> None:
    tests = (*group.tests, *group.whole)
    programs = [*(test.partition("::")[0] for test in tests), *group.command[:1]]
    assert [file for file in programs if not (ROOT / file).exists()] == []


@pytest.mark.parametrize(("text", "times"), [("3 * x", 0), ("2 * x + 2 * x", 2)])
def test_a_text_that_is_not_there_once_is_refused(text: str, times: int) -> None:
    with pytest.raises(MutantError, match=f"sign: its text occurs {times} times"):
        SIGN.apply(text)


def test_a_mutation_that_changes_nothing_is_refused() -> None:
    with pytest.raises(MutantError, match="equal"):
        Mutant("none", "a.py", "x", "x", "Nothing.").apply("x")


def test_a_misspelt_key_is_named(tmp_path: Path) -> None:
    path = tmp_path / "core.toml"
    path.write_text('targets = []\ntests = []\n[[mutant]]\nname = "a"\nfined = "b"\n')
    with pytest.raises(MutantError, match=r"core\.toml.*fined"):
        load(path)


@pytest.mark.parametrize(
    ("code", "output", "outcome", "detail"),
    [
        (0, "3 passed", Outcome.LIVES, "every test passes"),
        (1, "F\nFAILED tests/a.py::test_b - assert 1 == 2\n", Outcome.KILLED, "tests/a.py::test_b"),
        (1, "E\nERROR tests/a.py::test_c - OSError\n", Outcome.KILLED, "tests/a.py::test_c"),
        (-11, "", Outcome.KILLED, "the tests crashed: SIGSEGV"),
        (2, "ERROR tests/a.py - SyntaxError", Outcome.BROKEN, "ERROR tests/a.py - SyntaxError"),
        (5, "1 skipped", Outcome.BROKEN, "no test ran: those of the node need `make ros`"),
    ],
)
def test_only_a_failed_test_kills(code: int, output: str, outcome: Outcome, detail: str) -> None:
    assert judge(code, output) == Verdict(outcome, detail)


def test_what_fails_a_run() -> None:
    group = Group("core", (), ("tests/a.py",), ())
    explained = Mutant("explained", "a", "b", "c", "Why.", lives="Nobody can see it.")
    killed, lives = Verdict(Outcome.KILLED, ""), Verdict(Outcome.LIVES, "")
    assert failures([(group, SIGN, killed), (group, explained, lives)]) == []
    assert [text.split()[1] for text in failures([(group, SIGN, lives)])] == ["lives:"]
    assert "take `lives` out" in failures([(group, explained, killed)])[0]
    broken = Verdict(Outcome.BROKEN, "it does not compile")
    assert failures([(group, SIGN, broken)]) == ["core/sign was not tested: it does not compile"]
    assert summary([(group, SIGN, killed)] * 19 + [(group, SIGN, lives)]) == (
        "19 of 20 killed (95%)",
        True,
    )
    assert not summary([(group, SIGN, killed)] * 18 + [(group, SIGN, lives)])[1]


def test_what_make_test_misses_is_declared() -> None:
    group = Group("core", (), ("tests/a.py",), (), whole=("tests/b.py",))
    declared = replace(SIGN, whole=True)
    early, late = Verdict(Outcome.KILLED, ""), Verdict(Outcome.KILLED, "", whole=True)
    assert failures([(group, SIGN, early), (group, declared, late)]) == []
    assert "by `make test-all` alone" in failures([(group, SIGN, late)])[0]
    assert "take `whole` out" in failures([(group, declared, early)])[0]


def test_the_page_lists_what_make_test_misses() -> None:
    (text,) = re.findall(
        r"^## What `make test` misses$(.*?)^## ", PAGE.read_text("utf-8"), re.M | re.S
    )
    missed = {f"{group.name}/{mutant.name}" for group, mutant in ALL if mutant.whole}
    assert set(re.findall(r"^\| `(\S+/\S+)` \|", text, re.M)) == missed
    assert len(missed) <= 40


def test_a_name_or_a_group_selects() -> None:
    groups = [Group("core", (), (), (SIGN,)), Group("link", (), (), (SPARE,))]
    assert [m.name for _, m in select(groups, [])] == ["sign", "spare"]
    assert [m.name for _, m in select(groups, ["link/"])] == ["spare"]
    assert [m.name for _, m in select(groups, ["sig"])] == ["sign"]


def test_the_tests_that_concern_the_file_come_first_and_alone() -> None:
    tests = ("tests/test_a.py", "tests/test_double.py", "tests/test_cpp_units.py")
    group = Group("core", (), tests, ())
    assert group.stages() == [tests]
    assert group.stages(SIGN) == [("tests/test_double.py",), (tests[0], tests[2])]
    cpp = Mutant("cpp", "core/a.cpp", "x", "y", "Why.")
    assert group.stages(cpp) == [("tests/test_cpp_units.py",), tests[:2]]
    other = Mutant("other", "host/other.py", "x", "y", "Why.")
    assert group.stages(other) == [tests]
    assert Group("core", (), tests[1:2], ()).stages(SIGN) == [tests[1:2]]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    root = tmp_path / "checkout"
    files = {
        "host/double.py": "def double(x):\n    return 2 * x  # spare\n",
        "tests/test_double.py": "from double import double\n\n\n"
        "def test_double():\n    assert double(2) == 4\n",
        "tests/test_none.py": "def test_none():\n    pass\n",
        "pyproject.toml": "[tool.pytest.ini_options]\nmarkers = ['whole']\n",
    }
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    subprocess.run(["git", "init", "-q", root], check=True)
    return root


def test_python_imports_the_copy_though_the_checkout_is_installed(
    checkout: Path, tmp_path: Path
) -> None:
    workspace = Workspace(tmp_path / "copy", checkout)
    workspace.check_imports("double")
    package = checkout / "host" / "wheelwire"
    with pytest.raises(MutantError, match="does not import the copy"):
        workspace.check_imports("json")
    package.mkdir()
    (package / "__init__.py").write_text("")
    Workspace(tmp_path / "copy", checkout).check_imports("wheelwire")


def test_mutations_are_tried_in_a_copy(checkout: Path, tmp_path: Path) -> None:
    group = Group("link", (), ("tests/test_double.py",), ())
    workspace = Workspace(tmp_path / "copy", checkout)
    killed = workspace.try_mutant(group, SIGN)
    assert (killed.detail, killed.whole) == ("tests/test_double.py::test_double", False)
    assert workspace.try_mutant(group, SPARE).outcome is Outcome.LIVES
    assert workspace.try_mutant(group, TYPO).outcome is Outcome.BROKEN
    assert workspace.test(group).outcome is Outcome.LIVES
    late = Group("link", (), ("tests/test_none.py",), (), whole=("tests/test_double.py",))
    assert workspace.try_mutant(late, SIGN).whole
    assert "2 * x" in (checkout / "host/double.py").read_text()


def test_a_copy_follows_the_checkout_and_keeps_what_is_equal(
    checkout: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "copy"
    Workspace(copy, checkout)
    before = (copy / "host/double.py").stat().st_mtime_ns
    (checkout / "tests/test_double.py").unlink()
    (checkout / "tests/test_other.py").write_text("")
    (copy / "build").mkdir(exist_ok=True)
    (copy / "build/kept.o").write_text("")
    Workspace(copy, checkout)
    assert sorted(path.name for path in (copy / "tests").iterdir()) == [
        "test_none.py",
        "test_other.py",
    ]
    assert (copy / "host/double.py").stat().st_mtime_ns == before
    assert (copy / "build/kept.o").exists()


def test_no_group_finds_the_programs_of_another(checkout: Path, tmp_path: Path) -> None:
    workspace = Workspace(tmp_path / "copy", checkout)
    program = workspace.folder / "build" / "host" / "wheelwire-core-test"
    program.parent.mkdir()
    for name, is_left in (("one", False), ("one", True), ("other", False)):
        program.touch()
        workspace.test(Group(name, (), (), ()))
        assert program.exists() is is_left


def test_two_runs_do_not_share_their_copies(tmp_path: Path) -> None:
    with alone(tmp_path), pytest.raises(MutantError, match="another run"), alone(tmp_path):
        pass
    with alone(tmp_path):
        pass
