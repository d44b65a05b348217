"""The page itself: its parts, which lie beside this module, put together as one file."""

import json
from collections.abc import Mapping
from importlib import resources
from typing import Any

#: Scripts in the order in which they run; the first is the plotting library (MIT, see its licence).
SCRIPTS = (
    *("uPlot.iife.min.js", "columns.js", "chunks.js", "decimate.js", "paint.js", "space.js"),
    *("curves.js", "player.js", "main.js", "controls.js"),
)
STYLES = ("uPlot.min.css", "style.css")


def page(meta: Mapping[str, Any], block: str) -> str:
    """The text of ``report.html`` with its facts ``meta`` and the block of its curves."""
    facts = json.dumps(dict(meta), sort_keys=True, ensure_ascii=True).replace("<", "\\u003c")
    return (
        part("template.html")
        .replace("/*STYLE*/", "\n".join(map(part, STYLES)))
        .replace("/*LICENCE*/", part("uPlot.LICENSE.txt").strip())
        .replace("/*FACTS*/", facts)
        .replace("/*CURVES*/", block)
        .replace("/*SCRIPTS*/", "\n".join(f"<script>\n{part(name)}</script>" for name in SCRIPTS))
    )


def part(name: str) -> str:
    """The text of one part."""
    return (resources.files(__package__) / "page" / name).read_text(encoding="utf-8")
