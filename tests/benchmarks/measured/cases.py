"""The measured systems: data, split, the missing laws by the literature, and a quick fit's figures for comparison."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import straw.replay.demo
from tests.benchmarks.measured.systems import falling_balls

#: Where the data are: beside the checkout, as for the tests.
SHARED = Path(__file__).parents[4] / "shared" / "realdata"
SYSTEMS = Path(__file__).with_name("systems")
SHIPPED = Path(str(straw.replay.demo.__file__)).parent / "measured"


@dataclass(frozen=True)
class Effect:
    """A missing law by the literature: regular expressions that must match the whole place and state of a law, and
    the shapes of which its formula must be one; no shapes where the literature has no formula.

    ``untold``: by the literature such recordings do not determine the formula, so none may be claimed.
    """

    says: tuple[str, ...]
    forms: tuple[str, ...] = ()
    untold: bool = False


@dataclass(frozen=True)
class Case:
    """One campaign: system, files, and reference results.

    ``base`` and ``best`` are the quick fit's RMS on held-out readings; ``effects``, the most important first, are the
    missing laws by the literature (none: nothing may be claimed); ``nothing``: by the literature none is missing.
    """

    name: str
    system: Path
    folder: str
    files: tuple[str, ...]
    unit: str
    base: float
    best: float
    literature: str
    effects: tuple[Effect, ...] = ()
    given: tuple[tuple[str, float, float, float], ...] = ()
    nothing: bool = False
    prepared: Callable[[Path, Path], list[Path]] | None = None  # makes the tables of the folder's files

    def paths(self, shared: Path, scratch: Path) -> list[Path]:
        """Its files; none where the data are missing."""
        folder = shared / self.folder
        if self.prepared is not None:
            return self.prepared(folder, scratch) if folder.is_dir() else []
        return [path for pattern in self.files for path in sorted(folder.glob(pattern))]


def _ball(name: str) -> Callable[[Path, Path], list[Path]]:
    def made(folder: Path, scratch: Path) -> list[Path]:
        text = dict(falling_balls.tables(folder / "Ball_drops_data.xls"))[name]
        path = scratch / f"{name}.csv"
        path.write_text(text)
        return [path]

    return made


#: The delay of a line; a clock that drifts is none.
DELAY = Effect(
    ("the delay of the input the near pressure", "the clock of the far pressure(, over time)?"),
    ("constant",),
)
#: Flow by the difference of the squared absolute pressures.
COMPRESSIBLE = Effect(
    (
        "the line's lag, over (the history of )?the (near|far) pressure",
        "the rate of the far pressure, over (the history of )?the (near|far) pressure",
    )
)


def _tube(metres: int, way: str, base: float, best: float) -> Case:
    words, effects = "delay of the line", (DELAY,)
    if way == "start":
        words, effects = "delay and compressible flow", (DELAY, COMPRESSIBLE)
    if metres <= 2:
        words, effects = "faster than the sampling: not told", ()
    return Case(
        f"tube {metres} m {'filling' if way == 'start' else 'venting'}",
        SYSTEMS / "pneumatic_tube.py",
        "pneumatic_tube",
        (f"tube_l{metres}_p[234567]_{way}*.csv",),
        "bar",
        base,
        best,
        words,
        effects,
    )


def _chamber(name: str, base: float, best: float, told: bool) -> Case:
    linear = Effect(("the rate of the pressure, over the pressure",), ("linear",))
    some = Effect(("the rate of the pressure(, over .*)?",), untold=True)
    return Case(
        f"chamber {name}",
        SHIPPED / "air_chamber.py",
        "air_chamber_leak",
        (f"{name}.csv",),
        "bar",
        base,
        best,
        "leak linear in gauge pressure" if told else "leak; its law cannot be told",
        (linear if told else some,),
    )


def _bellows(name: str, base: float, best: float) -> Case:
    return Case(
        f"bellows {name}",
        SYSTEMS / "kresling_bellows.py",
        "kresling_bellows",
        (f"{name}_*.csv",),
        "%",
        base,
        best,
        "the video's clock wanders; then creep",
        (Effect(("the clock of the compression, over time",)), Effect((".*, over the history of the pressure",))),
    )


def _seal(name: str, base: float, best: float) -> Case:
    coulomb = Effect(("the (reading of the force|constant F0), over the rate of the stroke",), ("sign", "step"))
    grows = Effect(
        (
            "(the area|the input the pressure), over the rate of the stroke",
            "the strength of the law in .*, over the pressure",
        )
    )
    return Case(
        f"seal {name}",
        SYSTEMS / "piston_friction.py",
        "piston_friction",
        (f"{name}_?bar.csv",),
        "N",
        base,
        best,
        "Coulomb friction, growing with pressure",
        (coulomb, grows),
    )


def _drop(name: str, base: float, best: float, told: bool) -> Case:
    drag = Effect(("the rate of the speed, over the speed",), untold=True)
    return Case(
        f"ball {name}",
        SYSTEMS / "falling_balls.py",
        "falling_balls",
        (),
        "m",
        base,
        best,
        "air drag; linear or square not told" if told else "drag too small to be told",
        (drag,) if told else (),
        prepared=_ball(name),
    )


CASES = (
    Case(
        "silverbox",
        SYSTEMS / "silverbox.py",
        "silverbox",
        ("SNLS80mV.csv",),
        "V",
        12.9e-3,
        0.94e-3,
        "cubic spring k3 x^3",
        (Effect(("the rate of the output's speed v, over the output y",), ("cube",)),),
    ),
    Case(
        "two tanks",
        SYSTEMS / "cascaded_tanks.py",
        "cascaded_tanks",
        ("tanque.csv",),
        "V",
        0.670,
        0.305,
        "overflow of the tanks; outlet losses",
        (
            Effect(("(the rate of the upper level|the constant k[14]), over the upper level",)),
            Effect(("(the rate of the lower level|the constant k3), over the lower level",)),
        ),
    ),
    Case(
        "tank, empty",
        SYSTEMS / "draining_tank.py",
        "draining_tank",
        ("liq_level_data_empty_*.csv",),
        "cm",
        0.251,
        0.251,
        "nothing",
        nothing=True,
    ),
    Case(
        "tank, bottle",
        SYSTEMS / "draining_tank.py",
        "draining_tank",
        ("liq_level_data_w_bottle.csv",),
        "cm",
        2.60,
        0.226,
        "a solid: area lost by level",
        (Effect(("(the rate of the level|the discharge coefficient), over the level",)),),
        (("c", 0.280, 0.278, 0.282),),  # from the runs without load
    ),
    _tube(1, "start", 0.257, 0.306),
    _tube(2, "start", 0.182, 0.158),
    _tube(4, "start", 0.174, 0.132),
    _tube(7, "start", 0.220, 0.120),
    _tube(8, "start", 0.241, 0.134),
    _tube(4, "end", 0.520, 0.449),
    _tube(7, "end", 0.401, 0.171),
    _tube(8, "end", 0.334, 0.169),
    _bellows("10x", 5.86, 2.21),
    _bellows("20x", 6.68, 2.66),
    _bellows("40x", 9.41, 2.99),
    _chamber("Aluminium", 0.029, 0.0040, False),
    _chamber("Formlabs", 0.032, 0.0032, False),
    _chamber("Prusa", 0.083, 0.0051, False),
    _chamber("Ultimaker_006", 0.043, 0.0034, False),
    _chamber("Ultimaker_010", 0.089, 0.0033, False),
    _chamber("Ultimaker_015", 7.46, 0.087, True),
    _chamber("Ultimaker_020", 7.64, 0.035, True),
    _seal("O-ring257", 6.63, 1.28),
    _seal("KDN", 6.09, 0.99),
    _seal("NAPN", 9.16, 1.50),
    _drop("Whiffle Ball 1", 9.63, 0.35, True),
    _drop("Whiffle Ball 2", 9.38, 0.57, True),
    _drop("Yellow Whiffle Ball", 12.6, 0.73, True),
    _drop("Orange Whiffle Ball", 12.8, 0.58, True),
    _drop("Tennis Ball", 4.59, 0.98, True),
    _drop("Blue Basketball", 2.98, 1.08, True),
    _drop("Green Basketball", 2.32, 0.79, True),
    _drop("Volleyball", 3.96, 0.45, True),
    _drop("Baseball", 1.38, 1.22, False),
    _drop("Golf Ball", 0.84, 0.77, False),
    _drop("Bowling Ball", 0.54, 0.54, False),
)
