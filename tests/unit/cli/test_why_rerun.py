"""`wheelwire why --rerun`: a box is done again, and becomes a test; and every wrong file."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest

from support.cases import each
from support.command import check_error, output, run, run_json
from support.virtual import box_after_a_contact
from wheelwire import errors
from wheelwire.cli.why import BOXES, DIFFERENT, TEST
from wheelwire_protocol.black_box import BOX_SIZE, core_hash

ROOT = Path(__file__).parents[3]
HEAD_WORDS = 64
SEGMENT_WORDS, SEGMENT_HEAD_WORDS = 2032, 8
MAGIC = 0x31425757
SHORT_WORDS = {1: 2, 2: 0, 3: 1, 4: 1, 5: 1, 6: 2, 7: 1}
"""Words of a record's payload, by kind; a longer one says how many it has."""
END = 12


@pytest.fixture(scope="module")
def image() -> bytes:
    return box_after_a_contact()


@pytest.fixture
def box(image: bytes, tmp_path: Path) -> Path:
    file = tmp_path / "stop.box"
    file.write_bytes(image)
    return file


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A folder with what of this repository the exported tests need."""
    root = tmp_path / "check out"
    (root / TEST).parent.mkdir(parents=True)
    shutil.copy(ROOT / TEST, root / TEST)
    return root


def stored(words: list[int]) -> bytes:
    """A box as a device stores it: with its checks."""
    memory = struct.pack(f"<{len(words) - 64}I", *words[64:])
    head = [*words[:11], zlib.crc32(memory)]
    return struct.pack("<13I", *head, zlib.crc32(struct.pack("<12I", *head))) + bytes(204) + memory


def words_of(image: bytes) -> list[int]:
    return list(struct.unpack(f"<{BOX_SIZE // 4}I", image))


def mixed(check: int, word: int) -> int:
    check = (check ^ word) * 0x9E3779B1 & 0xFFFFFFFF
    return check ^ check >> 15


def with_another_end(image: bytes) -> bytes:
    """The box of a core that drove on where this one stopped."""
    words = words_of(image)
    starts = range(HEAD_WORDS, len(words), SEGMENT_WORDS)
    start = max((at for at in starts if words[at] == MAGIC), key=lambda at: words[at + 1])
    check, at = words[start + SEGMENT_HEAD_WORDS - 1], start + SEGMENT_HEAD_WORDS
    while True:
        info = words[at] & 0xFFFF
        kind, argument = info & 15, info >> 4
        size = SHORT_WORDS.get(kind, argument)
        if kind == END:
            words[at + 3] ^= 1
        for word in (info, *words[at + 1 : at + 1 + size]):
            check = mixed(check, word)
        if kind == END:
            words[at] = info | check & 0xFFFF0000
            return stored(words)
        at += size + 1


def refused(
    result: subprocess.CompletedProcess[str], error: type[errors.WheelwireError], text: str
) -> None:
    assert re.search(text, check_error(result, error))


def of_core(image: bytes, core: int) -> bytes:
    words = words_of(image)
    words[4] = core
    return stored(words)


def test_a_box_is_done_again_bit_by_bit(box: Path) -> None:
    said = output("why", "--rerun", str(box))
    assert said.startswith("Identical, bit by bit: duties, transitions and state of 1")
    result = run_json("why", "--rerun", str(box))
    assert result["same"] is True
    assert result["cause"] == "ESTOP"
    assert result["core"] == f"{core_hash():08x}"
    assert result["difference"] is None
    assert result["steps"] == pytest.approx(result["seconds"] * 1000, abs=2)


def test_a_difference_is_named_and_ends_with_its_code(
    image: bytes, tmp_path: Path, checkout: Path
) -> None:
    changed = tmp_path / "changed.box"
    changed.write_bytes(with_another_end(image))
    result = run("why", "--rerun", str(changed))
    assert result.returncode == DIFFERENT, result.stderr
    assert "left_duty_q15 is 0, and was 1." in result.stdout
    result = run("why", "--rerun", str(changed), "--export-test", str(checkout), "--json")
    assert result.returncode == DIFFERENT
    said = json.loads(result.stdout)
    assert said["difference"]["field"] == "left_duty_q15"
    assert said["difference"]["step"] == said["steps"]
    assert Path(said["test"]).read_bytes() == changed.read_bytes()


@pytest.mark.whole
def test_an_export_runs_in_the_checkout(box: Path, checkout: Path) -> None:
    said = run_json("why", "--rerun", str(box), "--export-test", str(checkout))
    test = Path(said["test"])
    assert test.parent == checkout / BOXES
    assert outcome_of(checkout, said["command"]) == 0
    # It can fail: the same box with another count in it.
    test.write_bytes(with_another_end(test.read_bytes()))
    assert outcome_of(checkout, said["command"]) == 1


def outcome_of(root: Path, command: str) -> int:
    """What a command that was printed ends with: its folder is the checkout's."""
    cd, folder, _, *test = shlex.split(command)
    assert (cd, folder) == ("cd", str(root))
    options = "-c", os.devnull, "--rootdir", str(root), "-p", "no:cacheprovider"
    return subprocess.run(
        [sys.executable, *test[1:], *options], cwd=root, check=False, capture_output=True
    ).returncode


def test_an_export_needs_no_path_within_a_checkout(
    box: Path, checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(checkout / "tests")
    assert (checkout / BOXES) == Path(
        run_json("why", "--rerun", str(box), "--export-test")["test"]
    ).parent
    monkeypatch.chdir(box.parent)
    refused(run("why", "--rerun", str(box), "--export-test"), errors.InvalidArgument, "no checkout")


def test_a_named_file_is_written_anywhere(box: Path, tmp_path: Path) -> None:
    said = output("why", "--rerun", str(box), "--export-test", str(tmp_path / "mine.box"))
    assert (tmp_path / "mine.box").read_bytes() == box.read_bytes()
    assert f"wheelwire why --rerun {tmp_path / 'mine.box'}" in said


def test_an_existing_file_is_not_overwritten(box: Path, tmp_path: Path, checkout: Path) -> None:
    arguments = "why", "--rerun", str(box), "--export-test"
    run_json(*arguments, str(checkout))
    refused(run(*arguments, str(checkout)), errors.OutputFailed, "has this box already: run cd")
    other = tmp_path / "other.box"
    other.write_text("mine")
    refused(run(*arguments, str(other)), errors.OutputFailed, "exists and is another one")
    assert other.read_text() == "mine"


def test_no_folder_to_write_to_is_named(box: Path, tmp_path: Path) -> None:
    arguments = "why", "--rerun", str(box), "--export-test"
    result = run(*arguments, str(tmp_path / "none" / "mine.box"))
    refused(result, errors.OutputFailed, "cannot write")
    refused(run(*arguments, str(tmp_path / "none")), errors.InvalidArgument, "name a folder")


@each(
    ("change", "text"),
    [
        (lambda _: b"", "is no black box"),
        (lambda _: b"x" * BOX_SIZE, "is no black box"),
        (lambda _: bytes(BOX_SIZE + 1), "is no black box"),
        (lambda image: image[:5000] + bytes([image[5000] ^ 1]) + image[5001:], "damaged"),
        (lambda image: stored([*words_of(image)[:64], *[0] * (BOX_SIZE // 4 - 64)]), "is empty"),
        (lambda image: of_core(image, 0xC0FFEE), f"core 00c0ffee .*this is {core_hash():08x}"),
    ],
)
def test_another_file_than_a_box_of_this_core_is_refused_and_not_exported(
    change: Callable[[bytes], bytes], text: str, box: Path, image: bytes, checkout: Path
) -> None:
    box.write_bytes(change(image))
    result = run("why", "--rerun", str(box), "--export-test", str(checkout))
    refused(result, errors.RecordingError, text)
    assert not (checkout / BOXES).exists()


def test_a_box_of_another_core_still_says_why_the_robot_stopped(image: bytes, box: Path) -> None:
    box.write_bytes(of_core(image, 0xC0FFEE))
    (stop,) = run_json("why", str(box))
    assert stop["cause"] == "contact_open"


def test_wrong_usage_is_named(box: Path, tmp_path: Path) -> None:
    for arguments, text in (
        (["--rerun", str(tmp_path / "none.box")], None),
        (["--rerun", "day.mcap"], "is a recording"),
        (["--rerun", str(box), "/dev/ttyUSB0"], "has no use for /dev/ttyUSB0"),
        (["--rerun", str(box), "--plot", "why.png"], "--plot draws a recording"),
        (["--export-test"], "--rerun FILE --export-test"),
    ):
        kind = errors.RecordingError if text is None else errors.InvalidArgument
        refused(run("why", *arguments), kind, text or "cannot read")
