"""Which program has driven a robot."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from wheelwire.link.sharing_folder import (
    DIRECTORY_VARIABLE,
    KEPT,
    LONGEST_COMMAND,
    SharingFolder,
    driver_of,
    note_driver,
    sharing_folder,
    this_program,
)

BOARD = "240ac4123456"


@pytest.fixture
def directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SharingFolder:
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(tmp_path / "taps"))
    return sharing_folder(make=True)


def test_the_program_of_a_session_is_found_by_it(directory: SharingFolder) -> None:
    assert driver_of(BOARD, 7) is None
    note_driver(directory, BOARD, 7)
    found = driver_of(BOARD, 7)
    assert found == this_program()
    assert found.pid == os.getpid()
    assert found.is_running
    assert 0 < len(found.command) <= LONGEST_COMMAND
    assert driver_of(BOARD, 8) is None
    assert driver_of("000000000000", 7) is None


def test_the_file_does_not_grow(directory: SharingFolder) -> None:
    for session in range(1, 3 * KEPT):
        note_driver(directory, BOARD, session)
        note_driver(directory, BOARD, session)
    known = [session for session in range(1, 3 * KEPT) if driver_of(BOARD, session)]
    assert known == list(range(2 * KEPT, 3 * KEPT))
    assert [path.name for path in directory.path.iterdir()] == [f"{BOARD}.programs"]


@pytest.mark.parametrize("content", ["", "{", "[1]", '[[7, ["a"]]]', "null"])
def test_what_somebody_else_has_written_is_no_program(
    directory: SharingFolder, content: str
) -> None:
    (directory.path / f"{BOARD}.programs").write_text(content)
    assert driver_of(BOARD, 7) is None
    note_driver(directory, BOARD, 7)
    assert driver_of(BOARD, 7) is not None
