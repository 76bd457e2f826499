"""Many cases of one check in one test, which reports every case that fails."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any

import pytest

Test = Callable[..., None]


def each(
    names: str | tuple[str, ...], cases: Iterable[Any], *, ids: Callable[[Any], object] = repr
) -> Callable[[Test], Test]:
    """Like `pytest.mark.parametrize`, without the cost of a test for each case.

    The cases share the test's fixtures, so this is for checks of data. `ids` names a case in the
    report.
    """
    keys = names.replace(" ", "").split(",") if isinstance(names, str) else list(names)
    rows = [case if len(keys) > 1 else (case,) for case in cases]

    def decorate(test: Test) -> Test:
        parameters = inspect.signature(test).parameters
        passed_on = ("subtests",) if "subtests" in parameters else ()

        @functools.wraps(test)
        def run(subtests: pytest.Subtests, **fixtures: Any) -> None:
            fixtures.update(dict.fromkeys(passed_on, subtests))
            for row in rows:
                with subtests.test(", ".join(str(ids(value)) for value in row)):
                    test(**dict(zip(keys, row, strict=True)), **fixtures)

        kinds = ["subtests", *(name for name in parameters if name not in (*keys, "subtests"))]
        run.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY) for name in kinds]
        )
        return run

    return decorate
