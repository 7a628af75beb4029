"""The concealed effect of the demo: drawn by seed, sealed before anything is recorded, opened at the end."""

from __future__ import annotations

import hashlib
import json
import secrets
from dataclasses import dataclass
from typing import Any

import numpy as np

from straw.model.parameters import StrawParameters
from straw.model.terms import TERMS
from straw.replay.diagnose import figures
from straw.replay.diagnose.findings import Findings
from straw.replay.diagnose.systems.straw.instrument import Instrument

NOTHING = "complete"
#: Effects that may be concealed, each of a well visible size: terms of the straw and faults of the instrument, SI. The
#: drawn strength, the first constant of each, is this times a factor of up to SPREAD either way.
DRAWER: dict[str, dict[str, float]] = {
    "cohesion": {"force_n": 5.0, "range_m": 0.3e-3, "weakening": 0.3},
    "poiseuille_loss": {"resistance_pa_s_per_m3": 2e9},
    "clock_offset": {"clock_offset_s": 40e-3},
    NOTHING: {},
    "squeeze_film": {"folded_n_s_per_m": 400.0, "gap_m": 0.2e-3},
    "viscoelasticity": {"k1_n_per_m": 1000.0, "tau_s": 0.3},
    "camera_roll": {"camera_roll_rad": 8e-3},
    "dry_friction": {"force_n": 0.6},
    "gauge_offset": {"gauge_offset_pa": 2000.0},
    "crease_stiffness": {"zeta_n_per_m": 400.0, "phi_n_m_per_rad": 40e-3},
}
SPREAD = 1.25


@dataclass(frozen=True)
class Unlisted:
    """A law that the library does not hold: a table of the term, and where it acts in the contract's words."""

    says: str
    term: str
    at: str  # names of the table's points and values, with braces for the number
    value: str
    where: tuple[float, ...]
    values: tuple[float, ...]  # SI, times the drawn strength
    place: str
    state: str


#: Laws that the library does not hold.
UNLISTED = {
    "taut_cable": Unlisted(
        says="a cable at the tip that is taut where the tip is far out, F_X = -s (X/L - 0.8) 5 N beyond X/L = 0.8",
        term="missing_tip_force",
        at="x_{}",
        value="along_x_{}_n",
        where=(where := (0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 1.0, 1.1)),
        values=tuple(-5.0 * max(x - 0.8, 0.0) for x in where),
        place="tip_force",
        state="tip_x",
    ),
}
#: Share of seeds that draw one of these.
UNLISTED_SHARE = 0.25


@dataclass(frozen=True)
class Concealed:
    """An effect's name in the contract, ``complete`` for none, or a name of `UNLISTED`, and its constants, SI."""

    cause: str
    constants: dict[str, float]

    def straw(self, base: StrawParameters) -> StrawParameters:
        """The twin's straw."""
        if (law := UNLISTED.get(self.cause)) is not None:
            table = {law.at.format(n): x for n, x in enumerate(law.where, 1)}
            table |= {law.value.format(n): y for n, y in enumerate(law.values, 1)}
            return base.with_term(law.term, amount=self.constants["strength"], **table)
        return base.with_term(self.cause, **self.constants) if self.cause in TERMS else base

    @property
    def instrument(self) -> Instrument:
        """The twin's clock, camera and gauge."""
        return Instrument() if self.cause in (*TERMS, *UNLISTED) else Instrument.of(self.constants)

    def __str__(self) -> str:
        if (law := UNLISTED.get(self.cause)) is not None:
            return f"{law.says} with s = {self.constants['strength']:.4g}, which the library does not hold"
        sizes = ", ".join(f"{name} = {value:.4g}" for name, value in self.constants.items())
        return f"{self.cause.replace('_', ' ')} ({sizes})" if sizes else "nothing"


def draw(seed: int) -> Concealed:
    """The effect that belongs to a seed."""
    rng = np.random.default_rng(seed)
    cause = list(DRAWER)[int(rng.integers(len(DRAWER)))]
    constants = dict(DRAWER[cause])
    if constants:
        strength = next(iter(constants))
        constants[strength] *= float(SPREAD ** rng.uniform(-1, 1))
    if rng.random() > 1 - UNLISTED_SHARE:
        cause = list(UNLISTED)[int(rng.integers(len(UNLISTED)))]
        constants = {"strength": float(SPREAD ** rng.uniform(-1, 1))}
    return Concealed(cause, constants)


@dataclass(frozen=True)
class Seal:
    """A label as the text that is opened at the end; its SHA-256 is shown at once. The nonce prevents guessing."""

    label: str

    @classmethod
    def on(cls, concealed: Concealed) -> Seal:
        """Seal what is concealed."""
        return cls(json.dumps({**vars(concealed), "nonce": secrets.token_hex(16)}) + "\n")

    @property
    def sha256(self) -> str:
        """The SHA-256 of the opened label, as ``sha256sum`` prints it."""
        return hashlib.sha256(self.label.encode()).hexdigest()


def named(concealed: Concealed, findings: Findings) -> bool:
    """Whether the diagnosis names this cause and no other, "complete" where nothing was concealed, or the place and
    state of a law that the library does not hold."""
    if concealed.cause == NOTHING:
        return findings.verdict == "complete"
    if (law := UNLISTED.get(concealed.cause)) is not None:
        found = findings.discovered
        return found is not None and found["place"] == law.place and law.state in found["states"]
    return findings.verdict in ("missing_physics", "measurement_fault") and findings.causes == [concealed.cause]


def opened(concealed: Concealed, seal: Seal, told: str, findings: Findings) -> dict[str, Any]:
    """The outcome for machines: ``told`` is the SHA-256 that was shown before the analysis."""
    return {
        "concealed": concealed.cause,
        "constants": concealed.constants,
        "sha256": told,
        "sha256_agrees": seal.sha256 == told,
        "verdict": findings.verdict,
        "causes": findings.causes,
        "probability": dict(findings.judgement.probability),
        "found": findings.parameters,
        "named": named(concealed, findings),
    }


def story(concealed: Concealed, seal: Seal, told: str, findings: Findings) -> str:
    """The outcome for people."""
    agrees = "as sealed above" if seal.sha256 == told else f"but its SHA-256 is {seal.sha256}, NOT the one above"
    found = figures.told(findings.parameters.get(concealed.cause, {}))
    if named(concealed, findings) and findings.discovered:
        verdict = f"the diagnosis found it, as {findings.discovered['formula']}"
    elif named(concealed, findings):
        verdict = "the diagnosis named it" + (f" and found {', '.join(found)}" if found else "")
    else:
        between = f", {' or '.join(findings.causes)}" if findings.causes else ""
        verdict = f"not named: the diagnosis said {findings.verdict.replace('_', ' ')}{between}"
    return f"concealed was {concealed}, {agrees}; {verdict}"
