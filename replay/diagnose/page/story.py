"""A diagnosis as a story: what is told, in order, whatever the system; `straw.replay.diagnose.page.html` writes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from straw.replay.diagnose.page.shown import Drawing

#: A 95 % interval is so many standard deviations to either side.
INTERVAL = 1.96


@dataclass(frozen=True)
class Constant:
    """A constant of a law: its symbol or name, what it is, value, 95 % interval, unit ("1" for none)."""

    symbol: str
    about: str
    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class LawTold:
    """A law as it is told: a heading, its formula in one line (empty where it has none), constants, pictures (HTML)."""

    name: str
    formula: str
    words: str
    constants: Sequence[Constant]
    picture: str = ""


@dataclass(frozen=True)
class Error:
    """RMS of simulated minus measured in one channel: base, improved (None: there is none), noise; as it is shown."""

    label: str
    unit: str
    before: float
    after: float | None
    noise: float
    explained: str = ""


@dataclass(frozen=True)
class Rival:
    """Another explanation: its name, its probability, and what it leaves (RMS by channel, as it is shown)."""

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
    """All that a page tells. Texts are plain, except ``fits`` and ``details``, which are pairs with HTML."""

    says: str
    where: str
    picture: Drawing
    runs: list[dict[str, Any]]  # for the player; each may have ``at``, the moment to begin with, and ``window``
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
    channels: Sequence[str] = ()  # heads of what rivals leave
    unseen: Sequence[tuple[str, str, str]] = ()  # cause, what of it, the smallest size that would have been seen
    unseen_says: str = ""
    doubts: Sequence[str] = ()
    next: Next | None = None
    next_says: str = ""
    details: Sequence[tuple[str, str]] = field(default_factory=list)  # heading, HTML
