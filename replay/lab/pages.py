"""Pages: the lab's HTML: shell, style and the scripts a page needs, all in one answer, nothing from a network."""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files

#: Title and scripts of each page beyond the common ones.
PAGES = {
    "catalogue": ("Runs", ("stamp", "catalogue")),
    "panel": ("Rig", ("panel",)),
    "investigate": ("Closed loop", ("curves", "investigate")),
    "run": ("Run", ("stamp", "curves", "run")),
    "compare": ("Side by side", ("curves", "compare")),
    "specimen": ("Specimen", ("stamp", "curves", "specimen")),
    "job": ("Work", ("job",)),
}


@cache
def page(name: str) -> str:
    """The HTML of a page."""
    title, scripts = PAGES[name]
    report, web = files("straw.replay.report"), files("straw.replay.lab").joinpath("web")

    def part(where: str, path: str) -> str:
        return (report if where == "report" else web).joinpath(path).read_text(encoding="utf-8")

    filled = {
        "title": title,
        "page": name,
        "style": part("report", "vendor/uPlot.min.css") + part("report", "page.css") + part("web", "lab.css"),
        "body": part("web", f"{name}.html"),
        "uplot": part("report", "vendor/uPlot.iife.min.js") if "curves" in scripts or name == "panel" else "",
        "script": "\n".join(
            [part("report", "base.js"), part("report", "vent.js"), part("web", "common.js")]
            + [part("web", f"{script}.js") for script in scripts]
        ),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda place: filled[place[1]], part("web", "shell.html"))


@cache
def vent_key() -> str:
    """A script for pages shown inside the lab's: the VENT keys, passed on to the page around."""
    script = files("straw.replay.report").joinpath("vent.js").read_text(encoding="utf-8")
    return f'<script>{script}onVentKey(() => parent.postMessage("vent", "*"));</script>'
