"""The benchmarks are run by hand only: here they are at least imported, as `make bench` does."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from support.bare_host import ECHO
from support.processes import captured

SCRIPTS = sorted((Path(__file__).parents[2] / "bench").glob("*.py"))
OURS = ("bench", "peers", "support", "wheelwire", "wheelwire_protocol", "wheelwire_ros")
IMPORT = "import runpy, sys; runpy.run_path(sys.argv[1], run_name='imported')"


@pytest.mark.whole
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_each_finds_what_it_imports(script: Path) -> None:
    # As the interpreter does for a script, and not for -c: its folder comes first.
    environment = f"import sys; sys.path[0] = {str(script.parent)!r}; {IMPORT}"
    result = captured(sys.executable, "-c", environment, script, cwd="/")
    missing = re.search(r"ModuleNotFoundError: No module named '(\w+)", result.stderr)
    if missing and missing[1] not in OURS:
        pytest.skip(f"{missing[1]} is missing: make bench installs it")
    assert result.returncode == 0, result.stderr


def test_the_peer_in_c_is_where_it_is_looked_for() -> None:
    assert ECHO.is_file()
