"""Mutations of the code that the tests must detect: their data, and how one is tried.

A group is a file tests/mutants/*.toml: which tests run, what is built for them, and the mutations,
each a text that occurs once in its file and what it is replaced by. It is tried in a private copy
of the checkout, whose build folder stays.
"""

from __future__ import annotations

import fcntl
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Any

import pytest

from .processes import captured

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
DATA = ROOT / "tests" / "mutants"
CODE = ("host", "protocol", "ros_node")
"""Folders of the checkout that Python imports from."""
SITE = """import sys

sys.meta_path[:] = [f for f in sys.meta_path if "editable" not in type(f).__module__]
"""
"""Run at Python's start: an editable installation would find the checkout before the copy."""
TEST_TIMEOUT_S = 60
RUN_TIMEOUT_S = 600
LEAST_KILLED = 0.95
FAST = "not hypothesis and not whole"
WHOLE = "not hypothesis"
"""Which tests are tried, for pytest's -m."""


class MutantError(Exception):
    """The data or the tree is not usable; the message says what to do."""


@dataclass(frozen=True)
class Mutant:
    """One small change that would harm a robot.

    Attributes:
        name: Of the change, unique among all groups.
        file: Changed, from the checkout's root.
        find: Occurs exactly once in `file`.
        replace: Put in its place.
        why: What a robot would do.
        lives: Why no test can detect it; empty if one does.
        whole: `make test` misses it, `make test-all` detects it.
    """

    name: str
    file: str
    find: str
    replace: str
    why: str
    lives: str = ""
    whole: bool = False

    def apply(self, text: str) -> str:
        """The mutated text of the file.

        Raises:
            MutantError: `find` does not occur exactly once in `text`, or nothing changes.
        """
        count = text.count(self.find)
        if count != 1:
            raise MutantError(
                f"{self.name}: its text occurs {count} times in {self.file}, not once: "
                "follow the change of the code in the mutation's `find`"
            )
        if self.find == self.replace:
            raise MutantError(f"{self.name}: `find` and `replace` are equal")
        return text.replace(self.find, self.replace)


@dataclass(frozen=True)
class Group:
    """Mutations that the same tests must detect.

    Attributes:
        targets: Of firmware/esp32/sim, built before the tests; empty for Python alone.
        tests: For pytest, the likeliest to notice first, as far as `make test` runs them.
            Property tests are left out: what notices a mutation must do so in each run.
        whole: Tests that only `make test-all` runs; they come last.
        command: A program and its arguments instead of tests, which ends with 1 if it notices.
    """

    name: str
    targets: tuple[str, ...]
    tests: tuple[str, ...]
    mutants: tuple[Mutant, ...]
    command: tuple[str, ...] = ()
    whole: tuple[str, ...] = ()

    def stages(self, mutant: Mutant | None = None) -> list[tuple[str, ...]]:
        """The tests of `make test` in the order in which they are run, until one fails.

        Those named after the mutated file come first and alone, for C++ its unit tests: usually
        one of them fails, and the others need not even be imported.
        """
        if mutant is None:
            return [self.tests]
        file = Path(mutant.file)
        name = "cpp_units" if file.suffix in (".cpp", ".hpp") else file.stem
        first = tuple(test for test in self.tests if Path(test).stem == f"test_{name}")
        rest = tuple(test for test in self.tests if test not in first)
        return [stage for stage in (first, rest) if stage]


def load(path: Path) -> Group:
    """Read a group. Raises MutantError when its data is wrong."""
    data: Mapping[str, Any] = tomllib.loads(path.read_text("utf-8"))
    try:
        mutants = tuple(Mutant(**entry) for entry in data.get("mutant", ()))
        command = tuple(data.get("command", ()))
        tests = () if command else tuple(data["tests"])
        whole = tuple(data.get("whole", ()))
        return Group(path.stem, tuple(data["targets"]), tests, mutants, command, whole)
    except (KeyError, TypeError) as error:
        raise MutantError(f"{path}: {error}") from error


def load_all() -> list[Group]:
    """Every group there is, by name."""
    return [load(path) for path in sorted(DATA.glob("*.toml"))]


class Outcome(Enum):
    """What the tests made of a tree."""

    KILLED = "killed"
    LIVES = "LIVES"
    BROKEN = "BROKEN"
    """It does not compile or cannot be imported, or the tests need what is not installed."""


@dataclass(frozen=True)
class Verdict:
    """Outcome of one run of a group's tests."""

    outcome: Outcome
    detail: str
    """The test that failed, or what is wrong."""
    seconds: float = 0.0
    whole: bool = False
    """Every test of `make test` passes; one that only `make test-all` runs fails."""


def judge(return_code: int, output: str) -> Verdict:
    """What pytest's end says."""
    failed = re.search(r"^(?:(?:FAILED|ERROR) (\S+)|BROKEN (.*))", output, re.MULTILINE)
    if return_code == pytest.ExitCode.OK:
        return Verdict(Outcome.LIVES, "every test passes")
    if return_code == pytest.ExitCode.TESTS_FAILED:
        return Verdict(Outcome.KILLED, (failed[1] or failed[2]) if failed else "a test failed")
    if return_code == pytest.ExitCode.NO_TESTS_COLLECTED:
        return Verdict(Outcome.BROKEN, "no test ran: those of the node need `make ros`")
    if return_code < 0:
        return Verdict(Outcome.KILLED, f"the tests crashed: {signal.Signals(-return_code).name}")
    return Verdict(Outcome.BROKEN, output[-2000:])


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Lock the workspaces in `folder`, so that no other run changes them meanwhile.

    Raises:
        MutantError: Another run is there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise MutantError(f"another run is at work in {folder}: wait for its end") from None
        yield


@dataclass
class Workspace:
    """A private copy of a checkout, updated each time it is created.

    Args:
        folder: Holds the copy, and its build folder between runs.
        root: The checkout.
    """

    folder: Path
    root: Path = ROOT
    timeout_s: float = RUN_TIMEOUT_S
    _environment: dict[str, str] = field(init=False)
    _group: str = field(init=False, default="")
    """Whose programs the build folder has."""

    def __post_init__(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        kept = {n: value for n, value in os.environ.items() if not n.startswith("WHEELWIRE_")}
        site = self.folder / "build" / "site"
        site.mkdir(parents=True, exist_ok=True)
        (site / "sitecustomize.py").write_text(SITE, "utf-8")
        paths = [site, *(self.folder / name for name in CODE)]
        self._environment = kept | {
            "PYTHONPATH": os.pathsep.join(map(str, paths)),
            # A mutation may keep a file's size, and its time within a second.
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        self._update()

    def check_imports(self, *packages: str) -> None:
        """Raise MutantError unless Python finds the copy's packages, not others."""
        found = f"print(*({', '.join(f'{name}.__file__' for name in packages)},), sep='\\n')"
        command = [sys.executable, "-c", f"import {', '.join(packages)}; {found}"]
        result = captured(*command, cwd=self.folder, env=self._environment)
        files = result.stdout.splitlines()
        if not files or not all(Path(name).is_relative_to(self.folder) for name in files):
            raise MutantError(
                f"Python does not import the copy in {self.folder}: {files or result.stderr}"
            )

    def build(self, targets: Sequence[str]) -> str:
        """Build targets of the host build; returns the compiler's complaints, if any."""
        folder = self.folder / "build" / "host"
        source = self.folder / "firmware" / "esp32" / "sim"
        # A mutation may leave something unused, which a warning would tell instead of a test.
        options = ["-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_CXX_FLAGS=-w"]
        options.append("-DCMAKE_UNITY_BUILD=OFF")  # a mutation changes one source
        commands = [["cmake", "--build", str(folder), "--target", *targets, "--parallel", "1"]]
        if not (folder / "build.ninja").exists():
            commands.insert(0, ["cmake", "-S", str(source), "-B", str(folder), *options])
        for command in commands if targets else []:
            result = captured(*command)
            if result.returncode != 0:
                return result.stdout + result.stderr
        return ""

    def test(self, group: Group, mutant: Mutant | None = None) -> Verdict:
        """Build and test the tree as it is; the order of the tests is that for `mutant`."""
        begin = time.monotonic()
        self._remove_programs_before(group)
        complaints = self.build(group.targets)
        if complaints:
            return Verdict(Outcome.BROKEN, complaints[-2000:])
        if group.command:
            verdict = self._run([sys.executable, *group.command])
        else:
            verdict = self._run_stages(group, mutant)
        return replace(verdict, seconds=time.monotonic() - begin)

    def _run_stages(self, group: Group, mutant: Mutant | None) -> Verdict:
        for tests in group.stages(mutant):
            verdict = self._run_tests(tests, FAST)
            if verdict.outcome is not Outcome.LIVES:
                return verdict
        if not group.whole:
            return verdict
        verdict = self._run_tests(group.whole, WHOLE)
        return replace(verdict, whole=verdict.outcome is Outcome.KILLED)

    def _run_tests(self, tests: Sequence[str], kind: str) -> Verdict:
        options = ["-x", "-q", "-rfE", "--tb=no", "--no-header", "-p", "no:cacheprovider"]
        command = [sys.executable, "-m", "pytest", *options, f"--timeout={TEST_TIMEOUT_S}"]
        command += ["-m", kind, *tests]
        return self._run(command)

    def _run(self, command: Sequence[str]) -> Verdict:
        with subprocess.Popen(
            command,
            cwd=self.folder,
            env=self._environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        ) as process:
            try:
                output, _ = process.communicate(timeout=self.timeout_s)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                return Verdict(Outcome.KILLED, f"no end within {self.timeout_s:g} s")
        return judge(process.returncode, output)

    def try_mutant(self, group: Group, mutant: Mutant) -> Verdict:
        """Test the tree with one mutation in it."""
        with self.planted(mutant):
            return self.test(group, mutant)

    @contextmanager
    def planted(self, mutant: Mutant) -> Iterator[None]:
        """The tree has a mutation; it is as before afterwards."""
        path = self.folder / mutant.file
        text = path.read_text("utf-8")
        path.write_text(mutant.apply(text), "utf-8")
        try:
            yield
        finally:
            path.write_text(text, "utf-8")

    def _remove_programs_before(self, group: Group) -> None:
        """Another group, or a run that was killed, left those of its last mutation.

        A test of this group that runs one which the group does not build would judge that mutation.
        """
        if self._group != group.name:
            self._group = group.name
            built = self.folder / "build" / "host"
            for path in (*built.glob("wheelwire-*"), *built.glob("lib*.so")):
                path.unlink()

    def _update(self) -> None:
        """Bring the copy to the state of the checkout, files not committed yet included."""
        command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        listed = subprocess.run(command, cwd=self.root, capture_output=True, text=True, check=True)
        names = {name for name in listed.stdout.split("\0") if name and (self.root / name).exists()}
        for name in names:
            source, target = self.root / name, self.folder / name
            data = source.read_bytes()
            # What is equal keeps its time, or everything would be compiled again.
            if not target.exists() or target.read_bytes() != data:
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(data)
                target.chmod(source.stat().st_mode)
        for folder in {name.partition("/")[0] for name in names}:
            for path in (self.folder / folder).rglob("*"):
                if path.is_file() and str(path.relative_to(self.folder)) not in names:
                    path.unlink()
