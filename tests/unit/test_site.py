"""What the site does with a page: docs/conf.py."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

CONF = Path(__file__).parents[2] / "docs" / "conf.py"
APP = SimpleNamespace(builder=SimpleNamespace(get_relative_uri=lambda _page, to: f"{to}.html"))
WORDS = """
## Stopping

- **stop**: end
  the drive
- **e-stop**: a stop that is [latched](x.md)
- `ttl`: time
- **latch**: (of counters) to read
- **EN**: the enable input
"""


@pytest.fixture(scope="module")
def conf() -> Any:
    pytest.importorskip("sphinx", reason="`make docs` brings Sphinx")
    spec = importlib.util.spec_from_file_location("site_conf", CONF)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_glossary_has_words_for_prose(conf: Any) -> None:
    terms = conf.glossary(WORDS)
    assert [term.meaning for term in terms] == [
        "a stop that is latched",
        "end the drive",
        "the enable input",
    ]
    assert {term.section for term in terms} == {"stopping"}
    found = [bool(terms[-1].words.search(text)) for text in ("pull EN low", "en route", "ENA")]
    assert found == [True, False, False]
    assert len(conf.TERMS) > 50


def test_the_first_use_of_a_word_leads_to_its_meaning(
    conf: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from docutils import nodes

    monkeypatch.setattr(conf, "TERMS", conf.glossary(WORDS))
    tree = nodes.section(
        "",
        nodes.title("", "Stops"),
        nodes.paragraph("", "", nodes.literal("", "stop"), nodes.Text(" E-stops end a stop. Then")),
        nodes.paragraph("", "An e-stop, a stop."),
    )
    conf.explain_words(APP, tree, "page")
    links = [
        (link.astext(), link["refuri"], link["reftitle"]) for link in tree.findall(nodes.reference)
    ]
    assert links == [
        ("E-stops", "glossary.html#stopping", "a stop that is latched"),
        ("stop", "glossary.html#stopping", "end the drive"),
    ]
    assert tree.children[1].astext() == "stop E-stops end a stop. Then"


def test_a_picture_leads_to_its_file(conf: Any) -> None:
    from docutils import nodes

    builder = SimpleNamespace(
        format="html", imagedir="_images", get_target_uri=lambda page: f"{page}.html"
    )
    env = SimpleNamespace(images={"tutorial/a.svg": ({"tutorial/x"}, "a1.svg")})
    image = nodes.image(uri="tutorial/a.svg")
    tree = nodes.section("", nodes.paragraph("", "", image))
    conf.open_pictures(SimpleNamespace(builder=builder, env=env), tree, "tutorial/x")
    (link,) = tree.findall(nodes.reference)
    assert link["refuri"] == "../_images/a1.svg"
    assert link.children == [image]
    conf.open_pictures(SimpleNamespace(builder=builder, env=env), tree, "tutorial/x")
    assert len(list(tree.findall(nodes.reference))) == 1


def test_the_sidebar_has_at_most_forty_links() -> None:
    toc = yaml.safe_load((CONF.parent / "_toc.yml").read_text("utf-8"))
    entries = [entry for group in toc["subtrees"] for entry in group["entries"]]
    # On a page that has others below it, these are shown, too.
    tutorial = entries[0]["entries"]
    pages = sum(
        len(list(CONF.parent.glob(f"{entry.get('file') or entry['glob']}.md")))
        for entry in tutorial
    )
    assert len(entries) + pages <= 40
    assert pages >= 10


PICTURES = sorted(CONF.parent.rglob("*.svg"))


@pytest.mark.parametrize("file", PICTURES, ids=lambda file: file.name)
def test_a_drawing_has_colours_for_the_dark(file: Path) -> None:
    text = file.read_text("utf-8")
    papers = re.findall(r'<rect class="paper"[^>]*>', text)
    # A terminal is dark, and the icon has no ground.
    assert len(papers) == (file.name not in ("monitor.svg", "favicon.svg"))
    assert not papers or "prefers-color-scheme: dark) { .paper { fill: #131416 }" in text


@pytest.mark.parametrize("file", PICTURES, ids=lambda file: file.name)
def test_labels_of_a_drawing_can_be_read_on_a_phone(file: Path) -> None:
    text = file.read_text("utf-8")
    css = (CONF.parent / "static" / "site.css").read_text("utf-8")
    narrow, wide_px = re.findall(r"a\.picture img:not\((.*?)\) {\s*width: (\d+)px;", css)[0]
    scrolls = not any(f"/{part}" in f"/{file.name}" for part in re.findall(r'"/(.*?)"', narrow))
    sizes = [float(size) for size in re.findall(r"font-size[=:] ?\"?([\d.]+)", text)]
    width = float(re.findall(r'viewBox="\S+ \S+ ([\d.]+)', text)[0])
    # A phone of 390 px leaves 358 to the text.
    shown_px = float(wide_px) if scrolls else 358.0
    assert min(sizes, default=width) * shown_px / width >= 9


def test_the_search_ranks_no_page_that_is_not_there() -> None:
    text = (CONF.parent / "static" / "scorer.js").read_text("utf-8")
    groups = re.findall(r"const (?:FIRST|LAST) =\s*/\^\((.*?)\)/", text)
    assert len(groups) == 2
    for group in groups:
        for name in group.split("|"):
            wanted = name.replace("\\/", "/").rstrip("$")
            found = CONF.parent / (wanted if wanted.endswith("/") else f"{wanted}.md")
            assert found.exists(), wanted
