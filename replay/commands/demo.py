"""straw demo: the whole loop without hardware: drive, film, track, diagnose what the simulated straw conceals,
replay."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from straw.model.parameters import StrawParameters
from straw.replay.commands import replay
from straw.replay.commands.track import summary
from straw.replay.compare.comparison import CHANNELS, compare
from straw.replay.compare.gather import gather
from straw.replay.demo.campaign import PLANS, Filmed, record
from straw.replay.demo.conceal import Seal, draw, opened, story
from straw.replay.demo.film import lens_alone
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import Findings, conclude
from straw.replay.diagnose.heldout import Held
from straw.replay.diagnose.page.report import report
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.errors import ReplayError
from straw.replay.output import write_json, write_text
from straw.replay.progress import compiling_meanwhile, prepare, progress_bar, say, stage_bar
from straw.replay.report.page import page
from straw.replay.report.proxy import film as film_proxy
from straw.rig.run import Run
from straw.tracking.camera import save_camera

#: The base straw; its damping lies between those of the paper's two runs.
BASE = StrawParameters().replace(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)
MARKER = ".straw-demo"  # marks a folder that the demo may overwrite
MADE = (
    "sealed.txt", "base.toml", "camera.json", *(name for plan in PLANS for name in plan.files),
    "why.html", "improved.toml", "replay.html", "opened.json", "demo.json",
    "air_chamber.py", "Ultimaker_015.csv", "SOURCE.md",
)  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Conceal, drive, film, track, diagnose, replay, open the seal; 0 whether or not the diagnosis named it."""
    out = clear_folder(args.out)
    if args.measured:
        from straw.replay.commands import demo_measured

        return demo_measured.run(args, out)
    concealed = draw(args.seed)
    seal = Seal.on(concealed)
    told = seal.sha256
    print(f"sealed    SHA-256 of what is concealed: {told}", flush=True)
    write_text(out / "sealed.txt", f"{told}  opened.json\n")
    write_text(out / "base.toml", BASE.to_toml())
    save_camera(out / "camera.json", lens_alone())

    prepare()
    filmed: list[Filmed] = []
    with compiling_meanwhile() as wait:
        for k, plan in enumerate(PLANS):
            say(f"{k + 1}/6 {plan.name}: an emulated OB1 MK4 is driven by its real driver, filmed, tracked")
            camera = None if plan.places else filmed[-1].tracked.camera
            filmed.append(record(plan, BASE, concealed, out, args.seed + k, camera))
        wait()

    say(f"5/6 diagnose: {len(PLANS)} runs, {len(CHANNELS)} channels, and the straw without what is concealed")
    runs = gather([path for one in filmed for path in (one.recording, one.tip)])
    findings, why = diagnosed(runs)
    write_text(out / "why.html", why)
    write_text(out / "improved.toml", findings.written["straw"])

    say("6/6 replay: the improved model under the measured pressure, laid over the tracks")
    comparisons = [compare(one, findings.model) for one in runs]
    before = compare(runs[0], BASE)
    with progress_bar("proxy", "frame") as progress:
        shown = film_proxy(comparisons[0], [filmed[0].video], progress=progress)
    write_text(out / "replay.html", page(comparisons, more={runs[0].sha256: {"film": shown}}))

    write_text(out / "opened.json", seal.label)
    data = {
        "tracking_error": {name: vars(error) for name, error in filmed[0].errors.items()},
        "base_residual": replay.as_data([before])["runs"],
        "model_residual": replay.as_data(comparisons)["runs"],
        "seal": opened(concealed, seal, told, findings),
    }
    for path in filter(None, (out / "demo.json", args.json)):
        write_json(path, data)
    for one in filmed:
        print(f"tracked   {summary(one.tracked)}: {one.tip}")
    print(figures(filmed[0], findings.held))
    print(f"diagnosis {findings.says} {findings.where}")
    print(f"seal      {story(concealed, seal, told, findings)}: {out / 'opened.json'}")
    print(f"open      {out / 'why.html'} and {out / 'replay.html'}")
    return 0


def diagnosed(runs: list[Run]) -> tuple[Findings, str]:
    """Diagnose the recordings with the base straw alone, and write the page."""
    with ThreadPoolExecutor() as pool, stage_bar("diagnose") as told:
        found = inquire([observe(one) for one in runs], StrawSystem(BASE), executor=pool, told=told)
        findings = conclude(found)
        return findings, report(findings, found)


def clear_folder(out: Path) -> Path:
    """The demo's folder without an earlier demo's files; ReplayError rather than touch a folder that is not one."""
    try:
        if out.is_dir() and any(out.iterdir()) and not (out / MARKER).exists():
            raise ReplayError(f"{out}: is not empty and not an earlier demo; choose another folder with --out")
        out.mkdir(parents=True, exist_ok=True)
        for name in MADE:  # and nothing else: the user may keep recordings of their own here
            for ending in ("", ".sha256", ".part", ".corners"):  # the last two are left by a demo that was killed
                (out / f"{name}{ending}").unlink(missing_ok=True)
        (out / MARKER).write_text(f"straw demo overwrites: {', '.join(MADE)}\n", encoding="utf-8")
    except OSError as error:
        raise ReplayError(f"{out}: cannot be the demo's folder: {error.strerror}; choose another with --out") from None
    return out


def figures(filmed: Filmed, held: Held | None) -> str:
    """Tracking error of one run, and errors of base and improved model on held-out runs, in display units.

    From the diagnosis rather than the page, so that a fault of clock, camera or gauge that it found is included.
    """
    lines = [f"{filmed.recording.name:<26}    X / um    Z / um   Phi / mrad"]
    scale = dict(zip(CHANNELS, (1e6, 1e6, 1e3), strict=True))

    def row(label: str, values: Mapping[str, float]) -> str:
        x, z, phi = (values[name] * scale[name] for name in CHANNELS)
        return f"{label:<26}{x:10.1f}{z:10.1f}{phi:13.2f}"

    lines += [
        row("tracking error, RMS", {name: e.rms for name, e in filmed.errors.items()}),
        row("tracking error, largest", {name: e.largest for name, e in filmed.errors.items()}),
    ]
    if held:
        lines += [
            f"{' and '.join(held.heldout)}, held out of the fit",
            row("base model, RMS misfit", held.before),
            row("improved model, RMS misfit", held.after),
            row("noise floor, RMS", held.floor),
        ]
    return "\n".join(lines)
