"""`wheelwire help PAGE[/SECTION]`: the documentation's pages, which ship with the package.

`wheelwire help COMMAND` is that command's `--help`.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.models import CommandInfo, TyperInfo

from wheelwire.errors import meant
from wheelwire_protocol import native

from .output import console, print_lines
from .registry import Heading, command

_CHECKOUT = Path(__file__).parents[3]
_SHIPPED = Path(__file__).parents[1] / "pages"
_HEADING = re.compile(r"^(#+) (.+)$", re.MULTILINE)
_FENCED = re.compile(r"^( *)```.*?^\1```$", re.MULTILINE | re.DOTALL)
_COMMENT = re.compile(r"^ *<!--.*?-->\n+", re.MULTILINE | re.DOTALL)
_OF_THE_SITE = ("index", "api")
"""Text that makes sense only in a browser."""

PAGE_OF = {
    "BoardMismatch": "boards",
    "CommissioningFailed": "first-hour",
    "ConfigurationError": "robot-file",
    "DeviceRefused": "troubleshooting/refuses",
    "DeviceSilent": "troubleshooting/port",
    "DriverUnavailable": "drivers",
    "FlashFailed": "tutorial/4-flash",
    "ForeignDevice": "troubleshooting/port",
    "LinkLost": "troubleshooting/link",
    "PortUnavailable": "troubleshooting/port",
    "ProtocolMismatch": "versions",
    "RecordingError": "recording",
    "RequestTimeout": "troubleshooting/link",
    "RobotNotNamed": "command-line/robot",
    "SensorMissing": "sensors",
    "SensorStale": "sensors/states",
    "WrongBoard": "boards",
}
"""Class of an error -> the page, and section, that explains it at length."""


@command("help", Heading.WITHOUT_ROBOT, 4)
def help_command(
    context: typer.Context,
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[PAGE | COMMAND]",
            help="Such as troubleshooting, or troubleshooting/port: a section of it; or a command.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Show a page of the documentation, or a command's options, or list the pages."""
    root = context.find_root().command
    if words and not (len(words) == 1 and words[0] in pages()) and _is_command(root, words):
        root.main([*words, "--help"], prog_name="wheelwire", standalone_mode=False)
    elif words and len(words) > 1:
        raise typer.BadParameter(f"no command is called {' '.join(words)!r}")
    else:
        help_page(words[0] if words else None, getattr(root, "commands", ()))


def help_page(page: str | None, commands: Iterable[str] = ()) -> None:
    """Print a page, or the list of them; `commands` may be meant by a name that is no page's."""
    found = pages()
    if page is None:
        width = max(map(len, found))
        print_lines(*(f"{name:{width}}  {_title(file)}" for name, file in found.items()))
        return
    name, section = _find(page, found, commands)
    text = _COMMENT.sub("", found[name].read_text("utf-8"))
    if section:
        text = _section(name, text, section)
    if console.is_terminal:
        from rich.markdown import Markdown  # here, because it is slow to import

        console.print(Markdown(text))
    else:
        print(text, end="")  # noqa: T201 - plain, for a pipe


def _is_command(command: Any, words: Sequence[str]) -> bool:
    """Whether these words name a command below this one."""
    for word in words:
        command = getattr(command, "commands", {}).get(word)
    return command is not None


def pages() -> dict[str, Path]:
    """The pages by name, in the order of their names."""
    folder = _CHECKOUT / "docs" if native.is_checkout() else _SHIPPED
    found = {
        file.relative_to(folder).with_suffix("").as_posix().removesuffix("/README"): file
        for file in folder.rglob("*.md")
        if file.parent.name not in ("adr", "project")
    }
    protocol = _CHECKOUT / "protocol" if native.is_checkout() else _SHIPPED / "project"
    found |= {"messages": protocol / "MESSAGES.md", "protocol": protocol / "SPEC.md"}
    return {name: found[name] for name in sorted(found) if name not in _OF_THE_SITE}


def _find(address: str, found: dict[str, Path], commands: Iterable[str]) -> tuple[str, str]:
    """Page and section; an address may also be a path with an anchor, as messages have it."""
    parts = address.removeprefix("docs/").replace(".md", "").replace("#", "/").split("/")
    # Some pages are in a folder, so the longest name that is a page counts.
    for length in range(len(parts), 0, -1):
        if (name := "/".join(parts[:length])) in found:
            return name, "/".join(parts[length:])
    near = meant(address, [*found, *commands], cutoff=0.4)
    hint = f"; did you mean {near}?" if near else ""
    raise typer.BadParameter(f"no page is called {address!r}{hint} `wheelwire help` lists them")


def more_about(kind: str) -> str:
    """The command that says more about an error of this class, or nothing."""
    return f"wheelwire help {PAGE_OF[kind]}" if kind in PAGE_OF else ""


def lead_to_pages(app: typer.Typer, page_of: Mapping[str, str]) -> None:
    """Let the help of each command fit any width, and end with the page that explains it.

    Args:
        app: With all commands.
        page_of: First word of a command -> its page, or nothing.
    """
    app.info.epilog = "More: wheelwire help"
    for info in app.registered_commands:
        _lead(info, page_of[str(info.name)])
    for group in app.registered_groups:
        _lead(group, page_of[str(group.name)])
        if group.typer_instance:
            for info in group.typer_instance.registered_commands:
                _lead(info, page_of[str(group.name)])


def _lead(info: CommandInfo | TyperInfo, page: str) -> None:
    if page:
        info.epilog = f"More: wheelwire help {page}"
    if isinstance(info, CommandInfo) and not info.help:
        # Typer would keep the line breaks of the source beside those of the terminal.
        paragraphs = (inspect.getdoc(info.callback) or "").split("\n\n")
        info.help = "\n\n".join(" ".join(one.split()) for one in paragraphs)


def _title(file: Path) -> str:
    found = _HEADING.search(file.read_text("utf-8"))
    return found[2] if found else ""


def _section(page: str, text: str, section: str) -> str:
    """The section whose heading has the words of `section`, up to the next heading of its level."""
    # A comment in a block of commands is no heading.
    blanked = _FENCED.sub(lambda block: re.sub(r"#", " ", block[0]), text)
    headings = list(_HEADING.finditer(blanked))
    anchors = [re.sub(r"[^\w -]", "", found[2].lower()).replace(" ", "-") for found in headings]
    words = set(section.lower().split("-"))
    exact = [n for n, anchor in enumerate(anchors) if anchor == section.lower()]
    near = [n for n, anchor in enumerate(anchors) if words <= set(anchor.split("-"))]
    if not (chosen := exact or near):
        known = ", ".join(anchors[1:]) or "none"
        raise typer.BadParameter(f"{page} has no section {section!r}; it has {known}")
    start = headings[chosen[0]]
    ends = (found.start() for found in headings[chosen[0] + 1 :] if len(found[1]) <= len(start[1]))
    return text[start.start() : next(ends, len(text))].rstrip() + "\n"
