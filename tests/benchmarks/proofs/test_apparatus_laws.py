"""Every law of the apparatus shows in a recording, in each of its forms."""

from __future__ import annotations

import numpy as np

from tests.apparatus.campaign import NONE, make
from tests.apparatus.effects import BESIDE, PHYSICS, Cause
from tests.apparatus.instrument import SIGMA


def test_every_law_has_a_large_effect_at_its_strongest_and_a_smaller_one_at_its_weakest() -> None:
    steps = ("fold-25kPa", "deploy-35kPa-1")
    plain = make((), 0, steps, NONE)
    stamp = np.arange(0.0, 4.0, 1 / 240)
    for name, sizes in {**PHYSICS, **BESIDE}.items():
        for form in sizes.forms:
            seen = []
            for size in (sizes.weak, sizes.strong):
                found = make((Cause(name, size, form),), 0, steps, NONE)
                away = [(a.motion.at(stamp) - b.motion.at(stamp)) / SIGMA for a, b in zip(found, plain, strict=True)]
                seen.append(np.sqrt(np.mean(np.square(away))))
            assert seen[1] > 2.0, (name, form, seen)
            assert seen[0] < seen[1], (name, form, seen)
