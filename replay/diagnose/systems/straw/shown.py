"""The straw's contents of a diagnosis page: its portrait, its laws, its motion, the next protocol."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.model.terms import TERMS
from straw.replay.diagnose.fit import Fit
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.page.pictures import AFTER, BEFORE, INK, LEGEND, SOFT, axes_of, svg
from straw.replay.diagnose.page.shown import Drawing, Law, Shown
from straw.replay.diagnose.page.words import symbol_of
from straw.replay.diagnose.systems.straw.experiment import Experiment
from straw.replay.diagnose.systems.straw.law_curves import about_instrument, instrument_law, law_curve
from straw.replay.diagnose.systems.straw.library import hypothesis
from straw.replay.diagnose.systems.straw.observation import Observation
from straw.replay.diagnose.systems.straw.portrait import portrait
from straw.replay.diagnose.systems.straw.simulated import simulated
from straw.replay.report.data import pressure, shape, straw_data
from straw.rig.outlet import Outlet
from straw.rig.protocol_toml import protocol_from_toml

Floats = NDArray[np.float64]

#: Colours of the hypotheses that an experiment would distinguish.
COLOURS = (AFTER, BEFORE, INK, SOFT)


class StrawShown(Shown):
    """Of one straw."""

    def __init__(self, straw: StrawParameters) -> None:
        self.straw = straw

    def picture(self, model: StrawParameters, places: Sequence[int], causes: Sequence[str]) -> Drawing:
        """The straw from the side, with the parts marked that the causes act on; of frusta those whose snaps differ
        most."""
        return portrait(self.straw, places, causes)

    def about(self, cause: str) -> dict[str, str]:
        """Descriptions of a term's constants, with those of single cells and of terms that belong to the cause."""
        if cause not in TERMS:
            return {k.target.partition(".")[2]: about_instrument(cause) for k in hypothesis([cause], 1).unknowns}
        about = {c.name: c.about for c in TERMS[cause].constants}
        for k in hypothesis([cause], self.straw.cells).unknowns:
            _, term, name, *where = k.target.split(".")
            known = {c.name: c.about for c in TERMS[term.partition("&")[0]].constants}
            symbol, what = symbol_of(name, known[name])
            about[".".join([name, *where])] = f"{symbol}_{where[0]}, {what}" if where else known[name]
        return about

    def law(self, cause: str, fit: Fit, covariance: Floats) -> Law | None:
        """A term's law and constants; of an instrument its excess."""
        if cause in TERMS:
            term = TERMS[cause]
            return Law(term.law, term.source, self.about(cause), law_curve(self.straw, term, fit, covariance))
        return instrument_law(cause, self.straw, fit, covariance)

    def played(self, recording: Observation, unknowns: Sequence[Unknown], u: Floats) -> dict[str, Any]:
        """Shape and pressure as on the replay page."""
        run = recording.run
        assert run.pressure is not None
        seen = simulated(recording, self.straw, unknowns, u).prediction
        return {
            "specimen": run.specimen,
            "deployed": ",".join(map(str, run.initial_deployed or ())) or "none",
            "cycle": run.cycle,
            "file": run.path.name,
            "sha": run.sha256,
            "events": [[e.time_s, e.kind] for e in run.events],
            "shape": shape(seen, self.straw.form),
            "pressure": pressure(run.pressure, run.command),
            "straw": straw_data(self.straw),
        }

    def experiment(self, proposed: Experiment) -> Drawing:
        """The command, and below it the tip's prediction by each surviving hypothesis."""
        protocol = protocol_from_toml(proposed.protocol, "the experiment")
        figure, rows = axes_of(5.8, 4.4 if proposed.seen else 2.4, nrows=2 if proposed.seen else 1, sharex=True,
                               squeeze=False)  # fmt: skip
        t = np.linspace(0.0, protocol.duration_s, 1200)
        rows[0, 0].plot(t, Outlet(protocol)(t) / 1e3, color=INK, linewidth=1.6)
        rows[0, 0].set_ylabel("gauge pressure / kPa")
        for (name, time_s, tip), colour in zip(proposed.seen, COLOURS, strict=False):
            rows[1, 0].plot(time_s, 1e3 * tip[2], color=colour, linewidth=1.3, label=name)
        if proposed.seen:
            rows[1, 0].set_ylabel("Phi of the tip / mrad")
            rows[1, 0].legend(**LEGEND)
        rows[-1, 0].set_xlabel("time / s")
        cells = proposed.initial_deployed or "none"
        caption = f"What the controller makes of the command; cells deployed at the start: {cells}."
        if proposed.seen:
            caption += " Below: what each hypothesis predicts."
        commands = (
            "straw diagnose RUNS --experiment next.toml",
            "straw rig show next.toml",
            "straw rig run next.toml -o next.mcap",
        )
        return Drawing(svg(figure, "the next experiment"), caption, commands)
