"""The layout for Foxglove and Lichtblick shows what is in a recording."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg

from wheelwire.log.views import CHANNELS, TRANSFORMS

LAYOUT = json.loads(
    (Path(__file__).parents[3] / "docs" / "foxglove-layout.json").read_text("utf-8")
)
PANELS: dict[str, dict[str, Any]] = LAYOUT["configById"]
CHANNEL_BY_TOPIC = {channel.topic: channel for channel in CHANNELS}


def paths() -> list[str]:
    """The paths of all plots: a topic and a field of its messages."""
    return [path["value"] for panel in PANELS.values() for path in panel.get("paths", ())]


def placed(node: str | dict[str, Any]) -> Iterator[str]:
    """The panels of a part of the screen."""
    if isinstance(node, str):
        yield node
    else:
        yield from placed(node["first"])
        yield from placed(node["second"])


def test_every_panel_has_its_place() -> None:
    assert sorted(placed(LAYOUT["layout"])) == sorted(PANELS)
    page = (Path(__file__).parents[3] / "docs" / "viewers.md").read_text("utf-8")
    for panel in PANELS.values():
        assert f"\n| {panel['foxglovePanelTitle']} | " in page


def test_every_topic_for_viewers_is_shown() -> None:
    topics = {path.partition(".")[0] for path in paths()}
    for panel in PANELS.values():
        topics |= set(panel.get("topics", ()))
        topics |= {panel["topicToRender"]} if "topicToRender" in panel else set()
    # Whatever shows something in 3D takes the transforms by itself.
    assert topics | {TRANSFORMS.topic} == set(CHANNEL_BY_TOPIC)


@pytest.mark.parametrize("path", paths())
def test_a_plots_path_leads_to_a_number(path: str) -> None:
    topic, *names = re.sub(r"\[\d+\]", "", path).split(".")
    channel = CHANNEL_BY_TOPIC[topic]
    types = get_types_from_msg(channel.definition, channel.schema)
    here: Any = (Nodetype.NAME, channel.schema)
    for name in names:
        kind, what = here
        assert kind is Nodetype.NAME
        here = dict(types[what][1])[name]
    kind, what = here
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):  # of which the path takes one
        assert path.endswith("]")
        kind, what = what[0]
    assert kind is Nodetype.BASE
    assert what[0].startswith("float")
