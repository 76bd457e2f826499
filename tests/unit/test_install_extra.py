"""`make bench` and `make fuzz` where pip reaches no index."""

import os
import sys
from pathlib import Path

import pytest

from support.processes import captured

TOOL = Path(__file__).parents[2] / "tools" / "install_extra.py"


@pytest.mark.whole
@pytest.mark.parametrize("extra", ["bench", "fuzz"])
def test_a_package_that_cannot_be_installed_is_named_in_one_line(
    tmp_path: Path, extra: str
) -> None:
    nowhere = {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(tmp_path), "PIP_CONFIG_FILE": os.devnull}
    result = captured(
        sys.executable, str(TOOL), extra, "no-such-package-here>=1", env={**os.environ, **nowhere}
    )
    assert result.returncode == 1
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"make {extra} needs ")
    assert line.endswith(", which pip cannot install here")
