"""The site's settings: `make docs` writes it to build/docs, without a network.

The pages are read on a file server of Git as well, so they are plain Markdown, and link to files as
such a server shows them. `as_on_the_site` changes what the site has elsewhere, and
`explain_words` leads from a word of the glossary to its meaning.
"""

from __future__ import annotations

import os
import posixpath
import re
from pathlib import Path
from typing import Any, NamedTuple

from docutils import nodes
from furo.navigation import get_navigation_tree
from sphinx.addnodes import desc

import wheelwire

DOCS = Path(__file__).parent
ROOT = DOCS.parent

project = "Wheelwire"
release = version = wheelwire.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_external_toc",
]
external_toc_path = "_toc.yml"
exclude_patterns = ["conf.py"]
html_theme = "furo"
html_title = f"Wheelwire {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_favicon = "static/favicon.svg"
html_search_scorer = str(DOCS / "static" / "scorer.js")
highlight_language = "sh"
"""Of blocks that name none: they are commands."""
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False

myst_heading_anchors = 6
myst_enable_extensions = ["attrs_block", "attrs_inline"]

autodoc_member_order = "groupwise"
autodoc_typehints = "signature"
default_role = "code"
napoleon_numpy_docstring = False
napoleon_use_ivar = True
add_module_names = False

PAGES = {
    "protocol/SPEC.md": "project/protocol",
    "protocol/MESSAGES.md": "project/messages",
    "CONTRIBUTING.md": "project/contributing",
    "SECURITY.md": "project/security",
    "CHANGELOG.md": "project/changelog",
    "README.md": "index",
}
"""Files outside of docs/ that have a page, and which."""
OUTSIDE = {page: file for file, page in PAGES.items() if page != "index"}
"""Pages whose text is such a file; the first page has its own."""
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s#:]+)(#[^)\s]*)?\)")


def as_on_the_site(app: Any, page: str, source: list[str]) -> None:
    """The text of a page, with each link leading to where the site has its target."""
    path = Path(app.env.doc2path(page))
    if path.suffix != ".md":
        return
    shown = path
    if page in OUTSIDE:
        shown = ROOT / OUTSIDE[page]
        app.env.note_dependency(str(shown))
        source[0] = shown.read_text("utf-8")

    def lead(found: re.Match[str]) -> str:
        mark, text, target, anchor = found[1], found[2], found[3], found[4] or ""
        there = Path(os.path.normpath(shown.parent / target))
        file = there.relative_to(ROOT).as_posix() if there.is_relative_to(ROOT) else target
        if file in PAGES:
            there = DOCS / f"{PAGES[file]}.md"
        elif there.is_dir():
            # A folder of the source code is not part of the site: its name says where it is.
            return f"{text} (`{file}/`)" if text.strip("`") != f"{file}/" else text
        return f"{mark}[{text}]({os.path.relpath(there, path.parent)}{anchor})"

    source[0] = LINK.sub(lead, source[0])


class Term(NamedTuple):
    """An entry of the glossary."""

    words: re.Pattern[str]
    meaning: str
    section: str


def glossary(text: str) -> list[Term]:
    """The terms of docs/glossary.md, the longest first.

    Names in code explain themselves; a word that means this only of one thing often does not.
    """
    found = []
    section = ""
    for line in text.replace("\n  ", " ").splitlines():
        if line.startswith("## "):
            section = line[3:].lower().replace(" ", "-")
        elif line.startswith("- ") and section:
            names, meaning = line[2:].replace("**", "").split(": ", 1)
            meaning = re.sub(r"\[([^]]*)\]\([^)]*\)|[`*]", r"\1", meaning)
            for name in re.sub(r" \(.*\)", "", names).split(", "):
                if "`" not in name and not meaning.startswith("("):
                    # An abbreviation is one in capitals alone.
                    first = name if name.isupper() else f"(?i:{name[0]}){name[1:]}"
                    words = re.compile(rf"(?<![\w-])(?<!motor ){first}s?(?![\w-])")
                    found.append((len(name), Term(words, meaning, section)))
    return [term for _, term in sorted(found, key=lambda pair: -pair[0])]


TERMS = glossary((DOCS / "glossary.md").read_text("utf-8"))


def explain_words(app: Any, tree: Any, page: str) -> None:
    """Lead from the first use of each of the glossary's words on a page to its meaning."""
    if page in ("glossary", "index") or page.startswith(("project/", "adr/")):
        return
    home = app.builder.get_relative_uri(page, "glossary")
    for term in TERMS:
        # ROS has messages and frames of its own.
        if page.startswith("ros") and term.section == "link":
            continue
        for text in list(tree.findall(nodes.Text)):
            if is_prose(text) and (match := term.words.search(text)):
                link = nodes.reference(
                    "",
                    match[0],
                    internal=True,
                    refuri=f"{home}#{term.section}",
                    reftitle=term.meaning,
                    classes=["word"],
                )
                before, after = text[: match.start()], text[match.end() :]
                text.parent.replace(text, [nodes.Text(before), link, nodes.Text(after)])
                break


def is_prose(text: Any) -> bool:
    """Whether it is part of a paragraph, and neither code nor already a link."""
    node, paragraph = text.parent, False
    while node is not None:
        if isinstance(node, (nodes.reference, nodes.literal, nodes.title, nodes.thead, desc)):
            return False
        paragraph = paragraph or isinstance(node, nodes.paragraph)
        node = node.parent
    return paragraph


def open_pictures(app: Any, tree: Any, page: str) -> None:
    """Make each picture a link to its file, which a browser shows as large as one likes."""
    if app.builder.format != "html":
        return
    for image in list(tree.findall(nodes.image)):
        if image["uri"] not in app.env.images or isinstance(image.parent, nodes.reference):
            continue
        file = f"{app.builder.imagedir}/{app.env.images[image['uri']][1]}"
        folder = posixpath.dirname(app.builder.get_target_uri(page)) or "."
        link = nodes.reference(
            "", "", internal=True, refuri=posixpath.relpath(file, folder), classes=["picture"]
        )
        image.parent.replace(image, link)
        link.append(image)


def fold_sidebar(
    _app: Any, _page: str, _template: str, context: dict[str, Any], _tree: Any
) -> None:
    """Show what is below a page in the sidebar only on that page and beside it."""
    links = context["toctree"](collapse=True, titles_only=True, maxdepth=-1, includehidden=True)
    context["furo_navigation_tree"] = get_navigation_tree(links)


def setup(app: Any) -> None:
    """For Sphinx."""
    app.connect("source-read", as_on_the_site)
    app.connect("doctree-resolved", explain_words)
    app.connect("doctree-resolved", open_pictures)
    app.connect("html-page-context", fold_sidebar, priority=900)  # after the theme
