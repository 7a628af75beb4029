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
#: A cable at the tip, taut beyond ``taut_beyond`` X/L, pulls with ``stiffness_n`` for each further X/L (L: the straw's
#: unloaded length): a law that the library does not hold, but of a form that its curves of a missing force can take.
CABLE = "taut_cable"
#: Effects that may be concealed, each of a well visible size: terms of the straw, faults of the instrument and the
#: cable, SI. The drawn strength, the first constant of each, is this times a factor of up to SPREAD either way.
DRAWER: dict[str, dict[str, float]] = {
    "cohesion": {"force_n": 5.0, "range_m": 0.3e-3, "weakening": 0.3},
    "poiseuille_loss": {"resistance_pa_s_per_m3": 2e9},
    "clock_offset": {"clock_offset_s": 40e-3},
    NOTHING: {},
    "viscoelasticity": {"k1_n_per_m": 1000.0, "tau_s": 0.3},
    "squeeze_film": {"folded_n_s_per_m": 400.0, "gap_m": 0.2e-3},
    "camera_roll": {"camera_roll_rad": 8e-3},
    "dry_friction": {"force_n": 0.6},
    "gauge_offset": {"gauge_offset_pa": 2000.0},
    CABLE: {"stiffness_n": 5.0, "taut_beyond": 0.8},
    "crease_stiffness": {"zeta_n_per_m": 400.0, "phi_n_m_per_rad": 40e-3},
}
SPREAD = 1.25


@dataclass(frozen=True)
class Concealed:
    """An effect of `DRAWER`, and its constants, SI."""

    cause: str
    constants: dict[str, float]

    def straw(self, base: StrawParameters) -> StrawParameters:
        """The twin's straw."""
        if self.cause == CABLE:
            return base.with_term("missing_tip_force", **_cable(**self.constants))
        return base.with_term(self.cause, **self.constants) if self.cause in TERMS else base

    @property
    def instrument(self) -> Instrument:
        """The twin's clock, camera and gauge."""
        return Instrument() if self.cause in (*TERMS, CABLE) else Instrument.of(self.constants)

    def __str__(self) -> str:
        sizes = ", ".join(f"{name} = {value:.4g}" for name, value in self.constants.items())
        return f"{self.cause.replace('_', ' ')} ({sizes})" if sizes else "nothing"


def _cable(stiffness_n: float, taut_beyond: float) -> dict[str, float]:
    """The term's table of F_X over X/L: zero up to where the cable is taut, then a straight line."""
    at = [taut_beyond * share for share in (0.2, 0.4, 0.6, 0.8, 1.0)] + [taut_beyond + more for more in (0.1, 0.2, 0.3)]
    force = {f"along_x_{n}_n": -stiffness_n * max(x - taut_beyond, 0.0) for n, x in enumerate(at, 1)}
    return {"amount": 1.0, **{f"x_{n}": x for n, x in enumerate(at, 1)}, **force}


def draw(seed: int) -> Concealed:
    """The effect that belongs to a seed."""
    rng = np.random.default_rng(seed)
    cause = list(DRAWER)[int(rng.integers(len(DRAWER)))]
    constants = dict(DRAWER[cause])
    if constants:
        strength = next(iter(constants))
        constants[strength] *= float(SPREAD ** rng.uniform(-1, 1))
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
    """Whether the diagnosis names this cause and no other, "complete" where nothing was concealed, or the cable's place
    and state."""
    if concealed.cause == NOTHING:
        return findings.verdict == "complete"
    if concealed.cause == CABLE:
        found = findings.discovered
        return found is not None and (found["place"], found["states"]) == ("tip_force", ["tip_x"])
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
    if concealed.cause == CABLE:
        agrees += ", which the library does not hold"
    if named(concealed, findings) and findings.discovered:
        verdict = f"the diagnosis found it, as {findings.discovered['formula']}"
    elif named(concealed, findings):
        verdict = "the diagnosis named it" + (f" and found {', '.join(found)}" if found else "")
    else:
        between = f", {' or '.join(findings.causes)}" if findings.causes else ""
        verdict = f"not named: the diagnosis said {findings.verdict.replace('_', ' ')}{between}"
    return f"{concealed} was concealed, {agrees}; {verdict}"
