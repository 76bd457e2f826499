"""The benchmarks are run by hand only: here they are at least imported, as `make bench` does."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest

from support.bare_host import ECHO
from support.processes import captured

BENCH = Path(__file__).parents[2] / "bench"
SCRIPTS = sorted(BENCH.glob("*.py"))
OURS = ("bench", "peers", "support", "wheelwire", "wheelwire_protocol", "wheelwire_ros")
IMPORT = """
import json, runpy, sys, traceback
folders, *scripts = sys.argv[1:]
path, failed = [*sys.path], {}
for script in scripts:
    try:
        runpy.run_path(script, run_name="imported")
    except BaseException:
        failed[script] = traceback.format_exc()
    # What it has found, and where, is not there for the next one.
    sys.path[:] = path
    for name, module in [*sys.modules.items()]:
        places = [getattr(module, "__file__", None) or "", *getattr(module, "__path__", ())]
        if any(place.startswith(tuple(folders.split(":"))) for place in places):
            del sys.modules[name]
print(json.dumps(failed))
"""


@pytest.mark.whole
def test_each_finds_what_it_imports() -> None:
    # As the interpreter does for a script, and not for -c: its folder comes first.
    environment = f"import sys; sys.path[0] = {str(BENCH)!r}; {IMPORT}"
    folders = f"{BENCH}:{BENCH.parent / 'tests'}"
    result = captured(sys.executable, "-c", environment, folders, *SCRIPTS, cwd="/")
    assert result.returncode == 0, result.stderr
    missing = set()
    for error in json.loads(result.stdout).values():
        found = re.search(r"ModuleNotFoundError: No module named '(\w+)", error)
        assert found, error
        assert found[1] not in OURS, error
        missing.add(found[1])
    if missing:
        pytest.skip(f"missing: {', '.join(sorted(missing))}: make bench installs them")


def test_the_peer_in_c_is_where_it_is_looked_for() -> None:
    assert ECHO.is_file()
