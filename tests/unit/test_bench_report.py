"""`make bench`, with benchmarks that take no time."""

from pathlib import Path

import pytest

import report

GOOD = "print('## good')"
BAD = "print('## half'); raise SystemExit(3)"


@pytest.fixture
def output(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a run of one bad benchmark between two good ones."""
    scripts = {"first": GOOD, "broken": BAD, "last": GOOD}
    for name, text in scripts.items():
        (tmp_path / f"{name}.py").write_text(text)
    folder = tmp_path / "output"
    monkeypatch.setattr(report, "SCRIPTS", [tmp_path / f"{name}.py" for name in scripts])
    monkeypatch.setattr(report, "FOLDER", folder)
    return folder


def test_a_failure_is_named_at_the_end_and_stops_nothing(
    output: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert report.main() == 1
    printed = capsys.readouterr()
    assert printed.err == "failed: broken\n"
    assert printed.out.count("## good\n") == 2
    assert "broken failed with exit code 3" in printed.out
    assert (output / "report.md").read_text() == printed.out


def test_the_heading_names_the_machine() -> None:
    heading = report.machine()
    for fact in ("processor", "cores", "system", "Python", "wheelwire", "load", "numpy"):
        assert fact in heading


def test_every_benchmark_is_there() -> None:
    assert [script.name for script in report.SCRIPTS if not script.exists()] == []
