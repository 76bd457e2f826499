"""What an interrupted set-up leaves on this computer."""

from __future__ import annotations

from pathlib import Path

import pytest

from wheelwire.errors import OutputFailed
from wheelwire.tools.setup.setup import Progress


def test_it_is_kept_by_board_until_it_is_finished(tmp_path: Path) -> None:
    found = {"wiring": {"motors_swapped": 1.0}}
    Progress("ab12", tmp_path / "new").save(found)
    assert Progress("ab12", tmp_path / "new").load() == found
    assert Progress("cd34", tmp_path / "new").load() == {}
    Progress("ab12", tmp_path / "new").forget()
    Progress("ab12", tmp_path / "new").forget()
    assert Progress("ab12", tmp_path / "new").load() == {}


@pytest.mark.parametrize("text", ["", "[]", '{"wiring": 1}', '{"wiring": {"a": "b"}}'])
def test_a_file_that_is_not_ours_is_no_progress(tmp_path: Path, text: str) -> None:
    (tmp_path / "setup-ab12.json").write_text(text)
    assert Progress("ab12", tmp_path).load() == {}


def test_an_unwritable_folder_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputFailed, match="cannot write"):
        Progress("ab12", tmp_path / "file").save({})


def test_it_is_in_the_folder_of_this_users_programs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    Progress("ab12").save({"sizes": {"wheel_radius": 0.03}})
    assert (tmp_path / "wheelwire" / "setup-ab12.json").exists()
