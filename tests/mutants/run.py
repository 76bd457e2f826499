"""Try every mutation and tell which no test notices: `make mutants [ONLY=text] [LIST=1]`."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import partial
from pathlib import Path
from queue import SimpleQueue

from rich.console import Console

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.mutants import (
    LEAST_KILLED,
    ROOT,
    Group,
    Mutant,
    MutantError,
    Outcome,
    Verdict,
    Workspace,
    alone,
    load_all,
)

CONSOLE = Console(markup=False, highlight=False, soft_wrap=True)
BUILD = ROOT / "build" / "mutants"

Tried = tuple[Group, Mutant, Verdict]


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("only", nargs="*", help="parts of group/name; default: every mutation")
    parser.add_argument("--list", action="store_true", help="only tell what there is")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    return parser.parse_args()


def select(groups: Sequence[Group], parts: Sequence[str]) -> list[tuple[Group, Mutant]]:
    """The mutations whose group/name contains one of the parts."""
    return [
        (group, mutant)
        for group in groups
        for mutant in group.mutants
        if not parts or any(part in f"{group.name}/{mutant.name}" for part in parts)
    ]


def failures(tried: Sequence[Tried]) -> list[str]:
    """What makes the run fail, a line each."""
    found = []
    for group, mutant, verdict in tried:
        name = f"{group.name}/{mutant.name}"
        if verdict.outcome is Outcome.BROKEN:
            found.append(f"{name} was not tested: {verdict.detail}")
        elif verdict.outcome is Outcome.LIVES and not mutant.lives:
            found.append(f"{name} lives: write a test. {mutant.why}")
        elif verdict.outcome is Outcome.KILLED and mutant.lives:
            found.append(f"{name} is killed: take `lives` out of its data")
        elif verdict.outcome is Outcome.KILLED and verdict.whole and not mutant.whole:
            found.append(
                f"{name} is killed by `make test-all` alone: write a test that `make test` runs, "
                "or say `whole = true`"
            )
        elif verdict.outcome is Outcome.KILLED and mutant.whole and not verdict.whole:
            found.append(f"{name} is killed by `make test`: take `whole` out of its data")
    return found


def summary(tried: Sequence[Tried]) -> tuple[str, bool]:
    """How many are killed, in words, and whether that is enough."""
    killed = sum(verdict.outcome is Outcome.KILLED for _, _, verdict in tried)
    share = killed / len(tried) if tried else 1.0
    return f"{killed} of {len(tried)} killed ({share:.0%})", share >= LEAST_KILLED


def test(workspaces: SimpleQueue[Workspace], group: Group, mutant: Mutant | None) -> Verdict:
    """Test a group, with one mutation if any, in whichever workspace is free."""
    workspace = workspaces.get()
    try:
        return workspace.test(group) if mutant is None else workspace.try_mutant(group, mutant)
    finally:
        workspaces.put(workspace)


def run(chosen: Sequence[tuple[Group, Mutant]], jobs: int) -> list[Tried]:
    """Try each mutation, and tell of it as it ends.

    Raises:
        MutantError: The unchanged tree fails its tests, so that a failure would say nothing.
    """
    workspaces: SimpleQueue[Workspace] = SimpleQueue()
    for number in range(jobs):
        workspace = Workspace(BUILD / str(number))
        workspace.check_imports("wheelwire", "wheelwire_protocol")
        workspaces.put(workspace)
    tried = []
    with ThreadPoolExecutor(jobs) as pool:
        groups = list({group.name: group for group, _ in chosen}.values())
        unchanged = pool.map(partial(test, workspaces, mutant=None), groups)
        for group, verdict in zip(groups, unchanged, strict=True):
            if verdict.outcome is not Outcome.LIVES:
                raise MutantError(f"{group.name}: the unchanged tree fails: {verdict.detail}")
            CONSOLE.print(f"{group.name}: the unchanged tree passes in {verdict.seconds:.0f} s")
        waiting = {pool.submit(test, workspaces, *pair): pair for pair in chosen}
        for future in as_completed(waiting):
            group, mutant = waiting[future]
            tried.append((group, mutant, future.result()))
            CONSOLE.print(line(*tried[-1]))
    return tried


def line(group: Group, mutant: Mutant, verdict: Verdict) -> str:
    """One mutation's result."""
    lives = verdict.outcome is Outcome.LIVES
    detail = (mutant.lives or mutant.why) if lives else verdict.detail
    if verdict.whole:
        detail = f"by `make test-all` alone: {detail}"
    name = f"{group.name}/{mutant.name}"
    return f"{verdict.outcome.value:6} {name:48} {verdict.seconds:4.0f} s  {detail}"


def main() -> int:
    options = arguments()
    chosen = select(load_all(), options.only)
    if options.list:
        for group, mutant in chosen:
            when = " (by `make test-all` alone)" if mutant.whole else ""
            CONSOLE.print(f"{group.name}/{mutant.name}{when}: {mutant.why}")
        return 0
    if not chosen:
        CONSOLE.print(f"no mutation is called {' or '.join(options.only)}; LIST=1 lists them")
        return 2
    begin = time.monotonic()
    try:
        with alone(BUILD):
            tried = run(chosen, options.jobs)
    except MutantError as error:
        CONSOLE.print(str(error))
        return 2
    wrong = failures(tried)
    for text in wrong:
        CONSOLE.print(text)
    killed, enough = summary(tried)
    CONSOLE.print(f"{killed} in {(time.monotonic() - begin) / 60:.1f} min")
    return 0 if not wrong and (enough or options.only) else 1


if __name__ == "__main__":
    sys.exit(main())
