"""The package's page: what an index shows of a wheel."""

from __future__ import annotations

import email
import re
from pathlib import Path

import pytest

backend = pytest.importorskip("scikit_build_core.build")

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def metadata(tmp_path_factory: pytest.TempPathFactory) -> email.message.Message:
    folder = tmp_path_factory.mktemp("metadata")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        name = backend.prepare_metadata_for_build_wheel(str(folder))
    return email.message_from_string((folder / name / "METADATA").read_text("utf-8"))


def test_no_link_or_picture_leads_nowhere(metadata: email.message.Message) -> None:
    page = str(metadata.get_payload())
    assert "pip install" in page
    assert not re.findall(r"\]\((?!https?:)", page)
    assert "](docs/" in (ROOT / "README.md").read_text("utf-8"), "a checkout's README keeps them"
