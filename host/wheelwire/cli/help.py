"""`wheelwire help PAGE[/SECTION]`: the documentation's pages, which ship with the package.

`wheelwire help COMMAND` is that command's `--help`; `wheelwire help WORD` searches both.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

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
_MOST_SECTIONS = 8
"""Of what a search lists."""
_SHORT_HELP = 60
"""Characters of what a command does, in a list."""
_OF_COMMANDS = "cli"
"""The page that has what the commands' help has."""
_FIRST = "troubleshooting"
_INTERNAL = ("architecture", "benchmarks", "causes", "messages", "protocol", "testing")
"""The page that a search lists first, and those that it lists last."""
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


@command("help", Heading.WITHOUT_ROBOT, 4, has_json=False)
def help_command(
    context: typer.Context,
    words: Annotated[
        list[str] | None, typer.Argument(metavar="[PAGE | COMMAND | WORD]", show_default=False)
    ] = None,
) -> None:
    """Show a page or command; list what mentions a word, or all pages.

    Args:
        context: Of the command line.
        words: Such as troubleshooting, its section troubleshooting/port, or brownout.
    """
    root = context.find_root().command
    phrase = " ".join(words or ())
    if words and phrase not in pages() and _is_command(root, words):
        root.main([*words, "--help"], prog_name="wheelwire", standalone_mode=False)
    elif words and not _place(phrase, pages()) and (found := _mentions(root, phrase)):
        print_lines(f"no page or command is called {phrase!r}; these mention it:", *found)
    else:
        names = (path.partition(" ")[2] for path, _ in _all_commands(root, "wheelwire"))
        help_page(phrase or None, [*names, *getattr(root, "commands", ())])


def help_page(page: str | None, commands: Iterable[str] = ()) -> None:
    """Print a page, or the list of them; a name that is not a page may be one of `commands`."""
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


def _mentions(root: Any, words: str) -> list[str]:
    """The commands and sections of pages that mention these words, the most fitting first."""
    words = " ".join(words.split())
    if not words:
        return []
    wanted = re.compile(rf"(?<!\w){re.escape(words)}".replace(r"\ ", r"\s+"), re.IGNORECASE)
    by_command = {
        path: command.get_short_help_str(_SHORT_HELP)
        for path, command in _all_commands(root, "wheelwire")
        if path != "wheelwire help"
        and wanted.search(f"{path.partition(' ')[2]} {_help_text(command)}")
    }
    by_section: dict[str, tuple[int, int]] = {}
    for name, file in pages().items():
        for anchor, text in _sections(_COMMENT.sub("", file.read_text("utf-8"))):
            if name != _OF_COMMANDS and (count := len(wanted.findall(text))):
                address = f"{name}/{anchor}" if anchor else name
                by_section[f"wheelwire help {address}"] = (_rank(name), -count)
    width = max(map(len, by_command), default=0)
    return [
        *(f"{path:{width}}  {short}" for path, short in by_command.items()),
        *sorted(by_section, key=lambda address: by_section[address])[:_MOST_SECTIONS],
    ]


def _rank(page: str) -> int:
    return 0 if page == _FIRST else 2 if page in _INTERNAL else 1


def _all_commands(command: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Each command without subcommands, and how it is called."""
    for name, below in getattr(command, "commands", {}).items():
        yield from _all_commands(below, f"{path} {name}")
    if not hasattr(command, "commands"):
        yield path, command


def _help_text(command: Any) -> str:
    """What `--help` says, without its form."""
    shown = [one for one in command.params if not getattr(one, "hidden", False)]
    options = [word for one in shown for word in (*one.opts, getattr(one, "help", None) or "")]
    return " ".join([command.help or "", *options])


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
    """Page and section."""
    if place := _place(address, found):
        return place
    near = meant(address, [*found, *commands], cutoff=0.4)
    hint = f"; did you mean {near}?" if near else ":"
    raise typer.BadParameter(
        f"no page or command is called {address!r} or mentions it{hint} `wheelwire help` lists them"
    )


def _place(address: str, found: Mapping[str, Path]) -> tuple[str, str] | None:
    """Page and section; an address may also be a path with an anchor, as messages have it."""
    parts = address.removeprefix("docs/").replace(".md", "").replace("#", "/").split("/")
    # Some pages are in a folder, so the longest name that is a page counts.
    for length in range(len(parts), 0, -1):
        if (name := "/".join(parts[:length])) in found:
            return name, "/".join(parts[length:])
    return None


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
        # Otherwise Typer would keep the source's line breaks as well as the terminal's.
        paragraphs = (inspect.getdoc(info.callback) or "").split("\n\n")
        info.help = "\n\n".join(" ".join(one.split()) for one in paragraphs)


def _title(file: Path) -> str:
    found = _HEADING.search(file.read_text("utf-8"))
    return found[2] if found else ""


def _section(page: str, text: str, section: str) -> str:
    """The section whose heading has the words of `section`, up to the next heading of its level."""
    headings = _headings(text)
    words = set(section.lower().split("-"))
    exact = [n for n, heading in enumerate(headings) if heading.anchor == section.lower()]
    near = [n for n, heading in enumerate(headings) if words <= set(heading.anchor.split("-"))]
    if not (chosen := exact or near):
        known = ", ".join(heading.anchor for heading in headings[1:]) or "none"
        raise typer.BadParameter(f"{page} has no section {section!r}; it has {known}")
    start = headings[chosen[0]]
    ends = (found.at for found in headings[chosen[0] + 1 :] if found.level <= start.level)
    return text[start.at : next(ends, len(text))].rstrip() + "\n"


def _sections(text: str) -> Iterator[tuple[str, str]]:
    """The anchor of each heading, and the text up to the next one; the title's is empty."""
    headings = _headings(text)
    ends = [heading.at for heading in headings[1:]] + [len(text)]
    for number, (heading, end) in enumerate(zip(headings, ends, strict=True)):
        yield heading.anchor if number else "", text[heading.at : end]


class _FoundHeading(NamedTuple):
    at: int
    level: int
    anchor: str


def _headings(text: str) -> list[_FoundHeading]:
    """The headings of a page."""
    # A comment in a block of commands is not a heading.
    blanked = _FENCED.sub(lambda block: re.sub(r"#", " ", block[0]), text)
    return [
        _FoundHeading(
            found.start(), len(found[1]), re.sub(r"[^\w -]", "", found[2].lower()).replace(" ", "-")
        )
        for found in _HEADING.finditer(blanked)
    ]
