"""A diagnosis as a story: the page's contents in order, for any system; ``write.py`` makes the HTML."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from straw.replay.diagnose.page.shown import Drawing

#: Half width of a 95 % interval in standard deviations.
INTERVAL = 1.96


@dataclass(frozen=True)
class Constant:
    """A constant of a law: symbol or name, description, value, 95 % interval, unit ("1" for none)."""

    symbol: str
    about: str
    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class LawTold:
    """A law on the page: a heading, its formula in one line (or empty), constants, pictures (HTML)."""

    name: str
    formula: str
    words: str
    constants: Sequence[Constant]
    picture: str = ""


@dataclass(frozen=True)
class Error:
    """RMS of simulated minus measured in one channel: base, improved (None: there is none), noise, as text."""

    label: str
    unit: str
    before: float
    after: float | None
    noise: float
    explained: str = ""


@dataclass(frozen=True)
class Rival:
    """Another explanation: its name, its probability, and its RMS by channel, as text."""

    name: str
    probability: float
    leaves: Sequence[str] = ()
    chosen: bool = False


@dataclass(frozen=True)
class Next:
    """The next experiment: why, its picture and commands, and the protocol as text."""

    why: str
    drawing: Drawing
    protocol: str


@dataclass(frozen=True)
class Story:
    """The contents of a page. Texts are plain, except ``fits`` and ``details``, which are pairs with HTML."""

    says: str
    where: str
    picture: Drawing
    runs: list[dict[str, Any]]  # the player's data; each may have ``at``, the moment to start from, and ``window``
    improved: bool  # whether there is an improved model to show
    fitted_say: str = "Both are fitted to all of them."
    laws: Sequence[LawTold] = ()
    laws_head: str = "The law"
    laws_say: str = ""
    errors: Sequence[Error] = ()
    errors_say: str = ""
    fits: Sequence[tuple[str, str]] = ()  # picture (HTML), caption
    rivals: Sequence[Rival] = ()
    rivals_say: str = ""
    channels: Sequence[str] = ()  # headings of the rivals' RMS
    unseen: Sequence[tuple[str, str, str]] = ()  # cause, constant, the smallest size that would have been seen
    unseen_says: str = ""
    doubts: Sequence[str] = ()
    next: Next | None = None
    next_says: str = ""
    details: Sequence[tuple[str, str]] = field(default_factory=list)  # heading, HTML
