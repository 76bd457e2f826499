"""`make bench` and `make fuzz` where pip reaches no index."""

import os
import sys
from pathlib import Path

import pytest

from support.processes import captured

TOOL = Path(__file__).parents[2] / "tools" / "install_extra.py"


@pytest.mark.whole
def test_a_package_that_cannot_be_installed_is_named_in_one_line(tmp_path: Path) -> None:
    nowhere = {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(tmp_path), "PIP_CONFIG_FILE": os.devnull}
    result = captured(
        sys.executable, str(TOOL), "fuzz", "no-such-package-here>=1", env={**os.environ, **nowhere}
    )
    assert result.returncode == 1
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("make fuzz needs ")
    assert line.endswith(", which pip cannot install here")
