"""Builds the report: template, style, script and data in one HTML file that needs no network."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from straw.replay.compare.comparison import Comparison
from straw.replay.output import finite
from straw.replay.report.data import data_of
from straw.replay.report.words import sentence

#: Parts of the script, in the order of their dependencies.
SCRIPTS = ("base", "straw", "plane", "charts", "film", "player", "table", "main")


def page(
    comparisons: list[Comparison],
    roles: Mapping[str, str] | None = None,
    more: Mapping[str, Mapping[str, Any]] | None = None,
) -> str:
    """The HTML text of the report on one or more compared runs.

    ``roles``: what a run was for by its SHA-256 ("fitted", "held out"); ``more``: further entries of a run's data.
    """
    roles, more = roles or {}, more or {}
    many = len(comparisons)
    title = comparisons[0].run.run_id if many == 1 else f"{many} runs of {_specimens(comparisons)}"
    data = [data_of(c, roles.get(c.run.sha256, "")) | dict(more.get(c.run.sha256, {})) for c in comparisons]
    return assemble(title, sentence(comparisons), data)


def assemble(
    title: str,
    says: str,
    runs: list[dict[str, Any]],
    kind: str = "",
    scripts: Sequence[str] = SCRIPTS,
    *,
    above: str = "",
    below: str = "",
    styles: Sequence[str] = ("page",),
) -> str:
    """Template, styles and scripts round the data of some runs; ``kind`` is the body's class.

    ``above`` and ``below``: HTML around the player.
    """
    here = files("straw.replay.report")

    def part(name: str) -> str:
        return here.joinpath(name).read_text(encoding="utf-8")

    # No "<" in the data: a name from a recording must not end the script element it stands in.
    data = json.dumps(finite(runs), allow_nan=False).replace("<", "\\u003c")
    filled = {
        "title": html.escape(title),
        "sentence": html.escape(says),
        "kind": kind,
        "style": part("vendor/uPlot.min.css") + "".join(part(f"{name}.css") for name in styles),
        "above": above,
        "below": below,
        "uplot": part("vendor/uPlot.iife.min.js"),
        "data": data,
        "script": "\n".join(part(f"{name}.js") for name in scripts),
    }
    # One pass: braces in a recording's name stay a name.
    return re.sub(r"\{\{(\w+)\}\}", lambda place: filled[place[1]], part("page.html"))


def _specimens(comparisons: list[Comparison]) -> str:
    return ", ".join(sorted({c.run.specimen or "an unnamed specimen" for c in comparisons}))
