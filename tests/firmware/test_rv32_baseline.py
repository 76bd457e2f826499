"""The limit on the core's growth, without its compiler."""

import json

import pytest

from support import rv32_baseline
from support.rv32_baseline import growth, too_much

BEFORE = {"step, max": 2000, "step, median": 2000, "code_bytes": 20_000}


@pytest.mark.parametrize(
    ("figure", "caught"), [(1000, False), (2000, False), (2099, False), (2100, True), (4000, True)]
)
def test_five_percent_is_too_much(figure: int, caught: bool) -> None:
    """Of each figure by itself; sizes have an upper bound instead."""
    now = BEFORE | {"step, max": figure, "step, median": 1000, "code_bytes": 40_000}
    assert list(too_much(growth(now, BEFORE))) == ["step, max"] * caught


def test_the_committed_baseline_is_whole() -> None:
    baseline = rv32_baseline.load()
    assert baseline.release
    assert baseline.compiler
    assert all(figure > 0 for figure in baseline.figures.values())
    assert json.loads(rv32_baseline.FILE.read_text("utf-8")) == baseline._asdict()


@pytest.mark.parametrize(
    ("arguments", "reported"),
    [
        ([], "required: release"),
        (["--help"], "such as 0.1.0"),
        (["next"], "'next' is no release's number, such as 0.1.0"),
        (["0.1.0", "0.2.0"], "unrecognized arguments: 0.2.0"),
    ],
)
def test_a_wrong_command_line_says_what_is_wanted_and_writes_nothing(
    arguments: list[str],
    reported: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    written: list[str] = []
    monkeypatch.setattr(rv32_baseline, "write", written.append)
    with pytest.raises(SystemExit):
        rv32_baseline.main(arguments)
    assert reported in "".join(capsys.readouterr())
    assert not written
