"""Every kind of file is read by one reader, and its errors have one form."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from support.cases import each
from wheelwire.errors import ConfigurationError, InvalidArgument
from wheelwire.tools.files.bad_line import load_profile
from wheelwire.tools.files.board import load_board
from wheelwire.tools.files.parameters import load_parameter_file
from wheelwire.tools.files.plant import load_plant
from wheelwire.tools.files.reading import LARGEST_BYTES
from wheelwire.tools.files.robot import load_config
from wheelwire.tools.setup.questions import AnswersFile

LOADERS: dict[str, Callable[[Path], object]] = {
    "robot": load_config,
    "board": load_board,
    "parameters": load_parameter_file,
    "profile": load_profile,
    "plant": load_plant,
    "answers": AnswersFile,
}
REFUSED = {
    kind: yaml.safe_load((Path(__file__).parent / "refused" / f"{kind}.yaml").read_text("utf-8"))
    for kind in LOADERS
}
CASES = [(kind, case) for kind, content in REFUSED.items() for case in content["refused"]]
every_kind = pytest.mark.parametrize("kind", LOADERS)


def refusal(kind: str, path: Path) -> str:
    with pytest.raises(ConfigurationError) as raised:
        LOADERS[kind](path)
    return str(raised.value)


@each(("kind", "case"), CASES)
def test_a_wrong_file_is_refused_by_file_line_key_and_value(
    kind: str, case: dict[str, Any], tmp_path: Path
) -> None:
    text = REFUSED[kind].get("sound", "") + case["file"]
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    said = refusal(kind, file)
    line = case.get("line", len(text.splitlines()))
    assert said.startswith(f"{file}: " if line is None else f"{file}, line {line}: ")
    assert case["says"] in said
    assert "\n" not in said


@every_kind
def test_a_key_that_is_there_twice_has_both_lines(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("title: a\ntitle: b\n")
    assert "line 2: title is given twice (first in line 1)" in refusal(kind, file)


@every_kind
def test_a_foreign_file_is_refused(kind: str, tmp_path: Path) -> None:
    pipe, large, latin = tmp_path / "pipe.yaml", tmp_path / "large.yaml", tmp_path / "latin.yaml"
    os.mkfifo(pipe)
    large.write_bytes(b"#" * (LARGEST_BYTES + 1))
    latin.write_bytes(b"title: M\xfcll\n")
    assert "no such file" in refusal(kind, tmp_path / "none.yaml")
    assert "directory" in refusal(kind, tmp_path)
    with pytest.raises(InvalidArgument, match=r"pipe\.yaml is a device, not a file"):
        LOADERS[kind](pipe)
    assert "large.yaml: the file is larger than 1000 kB" in refusal(kind, large)
    assert "latin.yaml, line 1: this is not UTF-8 text" in refusal(kind, latin)


def test_a_parameter_may_have_its_unit_in_a_robots_file_too(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text("driver: mock\nparameters: {wheel_radius: 0.04 m, left_motor_inverted: true}\n")
    assert load_config(file).parameters == {"wheel_radius": 0.04, "left_motor_inverted": 1.0}
    file.write_text("driver: mock\nparameters: {wheel_radius: 40 mm}\n")
    assert "line 2: parameters.wheel_radius = '40 mm': give it in m" in refusal("robot", file)


def test_an_option_may_be_left_empty(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text("driver: mock\nserial: {connect_timeout: 3, stream_rate_hz:}\n")
    assert load_config(file).serial.connect_timeout == 3


def bomb(kind: str) -> str:
    levels = [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 12)]
    if kind == "mappings":
        levels = [
            f"a{n}: &a{n} {{{', '.join(f'k{i}: *a{n - 1}' for i in range(9))}}}"
            for n in range(1, 12)
        ]
    if kind == "itself":
        return "a: &a [*a]\n"
    return "\n".join(["a0: &a0 [x]", *levels, ""])


@every_kind
@pytest.mark.timeout(10)
@pytest.mark.parametrize("shape", ["lists", "mappings", "itself"])
def test_aliases_that_multiply_are_refused_at_once(kind: str, shape: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(bomb(shape))
    began_s = time.process_time()
    assert "aliases (*name) multiply" in refusal(kind, file)
    assert time.process_time() - began_s < 1.0


def test_an_alias_that_is_used_a_few_times_is_read(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("driver: mock\nparameters: {wheel_radius: &r 0.3, wheel_separation: *r}\n")
    assert load_config(file).parameters == {"wheel_radius": 0.3, "wheel_separation": 0.3}
