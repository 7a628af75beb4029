"""Laws missing from base models of measured systems, found from recordings alone and compared with the literature.

    python -m tests.benchmarks.measured [NAME ...] [--rows FILE.jsonl] [--report FOLDER] [--json FILE] [--jobs N]

Data are read from ../shared/realdata; systems without data are skipped, with a message. A base model contains nothing
of what is missing. Figures are RMS on held-out readings, on which nothing was fitted and no law chosen; "quick fit" is
that of a hand-written model that contains the answer.
Each row is appended to --rows when it is done, and a system that has one is not run again. In the table of README.md
misses are bold.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from straw.replay.diagnose.discover.discover import discover
from straw.replay.diagnose.discover.findings import SystemFindings
from straw.replay.diagnose.discover.page import page
from straw.replay.diagnose.discover.said import text
from straw.replay.diagnose.systems.function.model import Model, load_model
from straw.replay.diagnose.systems.function.read_recordings import read_recordings
from straw.replay.diagnose.systems.function.shapes import SHAPES, TABLE
from straw.replay.diagnose.systems.function.system import FunctionSystem
from straw.replay.output import write_json, write_text
from straw.rig.provenance import software
from tests.benchmarks.figures import missed, publish, table, write_option
from tests.benchmarks.measured.cases import CASES, SHARED, Case, Effect

#: How a finding compares with the literature: verdict, places and formulas agree; only the first effect agrees; its
#: place agrees but not its formula (a curve is none); ambiguous, with the first effect among those named; ambiguous
#: without it; nothing claimed where something could be; something else claimed.
AGREES = ("yes", "in part", "place only", "in the set", "not told", "no", "no (claims)")


#: Worse than the quick fit: by more than this factor.
WORSE = 1.05


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    name: str
    base: float
    after: float
    quick_base: float
    quick: float
    unit: str
    verdict: str
    found: str
    literature: str
    agrees: str
    seconds: float  # of a processor, all threads
    commit: str = ""  # of the checkout that made it
    date: str = ""  # UTC
    refused: str = ""  # laws chosen on the fitted readings that did not improve the held-out ones


def diagnosed(case: Case, model: Model, paths: list[Path], jobs: int) -> tuple[SystemFindings, Row]:
    """Findings of a case, and its line."""
    begin = time.process_time()
    recordings = read_recordings(model, paths)
    with ThreadPoolExecutor(jobs) as pool:
        found = discover(FunctionSystem(model), recordings, executor=pool)
    f = SystemFindings(found, tuple(recordings))
    laws = "; ".join(f"{one.law.says}: {one.formula}" for one in f.laws)
    row = Row(
        case.name,
        float(found.held[0][0]),
        float(found.held[-1][0]),
        case.base,
        case.best,
        case.unit,
        f.verdict,
        laws or f.best_located or "-",
        case.literature,
        agrees(case, f),
        time.process_time() - begin,
        software().get("git_commit", "")[:7],
        f"{datetime.now(UTC):%Y-%m-%d}",
        "; ".join(f.refused),
    )
    return f, row


def agrees(case: Case, f: SystemFindings) -> str:
    """How the findings compare with the literature's answer, as one of `AGREES`."""
    laws = [one.law for one in f.laws]
    if case.nothing:
        return "yes" if f.verdict == "complete" else "no (claims)"
    if not case.effects:
        return "yes" if not laws or f.verdict == "ambiguous" else "no (claims)"
    if f.verdict == "ambiguous":
        there = [*(law.says for law in laws), *f.same, *f.alike_places]
        there += [f"{laws[0].place.says}, over {state}" for state in f.goes_with]
        return "in the set" if any(_says(case.effects[0], one) for one in there) else "not told"
    if not laws:
        return "no"
    found = [_found(effect, f) for effect in case.effects]
    if found[0] == "no":
        alike = [*f.same, *(trial.laws[-1].says for step in f.discovery.steps for trial in step.alike)]
        return "in the set" if any(_says(case.effects[0], one) for one in alike) else "no (claims)"
    if found[0] != "yes":
        return found[0]
    return "yes" if all(one == "yes" for one in found) else "in part"


def _says(effect: Effect, law: str) -> bool:
    return any(re.fullmatch(one, law) for one in effect.says)


def _found(effect: Effect, f: SystemFindings) -> str:
    """An effect among the accepted laws: found, at its place only, claimed with an undetermined formula, or missing."""
    for number, one in enumerate(f.laws):
        if not _says(effect, one.law.says):
            continue
        forms = {*(f.forms if number == 0 else ()), *([SHAPES[one.law.shape].name] if one.law.shape != TABLE else [])}
        if effect.untold:
            rivals = [other for other in (*f.alike_places, *f.same) if other.startswith(one.law.place.says)]
            return "no (claims)" if len(f.laws) > 1 or (len(forms) == 1 and not rivals) else "yes"
        return "yes" if not effect.forms or forms & set(effect.forms) else "place only"
    return "no"


def line(row: Row) -> str:
    """A row as text."""
    scale, unit = (1e3, "mV") if row.unit == "V" and row.quick < 0.01 else (1.0, row.unit)
    numbers = " ".join(f"{scale * x:8.3g}" for x in (row.base, row.after, row.quick_base, row.quick))
    return (
        f"{row.name:<24} {numbers} {unit:<4} {row.verdict:<18} {row.agrees:<11} {row.seconds:4.0f} s  {row.found[:150]}"
    )


def kept(path: Path | None) -> dict[str, Row]:
    """Rows of an earlier run by name; an incomplete line is ignored."""
    out: dict[str, Row] = {}
    for text_ in path.read_text().splitlines() if path and path.exists() else ():
        try:
            row = Row(**json.loads(text_))
        except (ValueError, TypeError):
            continue
        out[row.name] = row
    return out


def figures(rows: Sequence[Row]) -> dict[str, str]:
    """The rows as a table, bold where worse than the quick fit by 5 %, or different from the literature; their sum; and
    the commits that made them."""
    head = ("recording", "base", "with what was found", "quick fit", "verdict", "as the literature says", "laws", "s")
    lines = []
    for row in rows:
        scale, unit = (1e3, "mV") if row.unit == "V" and row.quick < 0.01 else (1.0, row.unit)
        laws = "; ".join(x.split(":")[0] for x in row.found.split("; "))
        laws = laws if row.after != row.base or not row.refused else ""  # where all are refused, the located places
        lines.append(
            (
                row.name,
                f"{scale * row.base:.3g}",
                missed(f"{scale * row.after:.3g}", row.after <= WORSE * row.quick),
                f"{scale * row.quick:.3g} {unit}",
                row.verdict.replace("_", " "),
                missed(row.agrees, row.agrees == "yes"),
                "; ".join(filter(None, (laws, row.refused and f"refused: {row.refused}"))),
                f"{row.seconds:.0f}",
            )
        )
    commits = ", ".join(sorted({f"{row.commit} ({row.date})" for row in rows}))
    return {"table": table(head, lines), "sum": summary(rows), "commits": commits}


def summary(rows: Sequence[Row]) -> str:
    """The table's last line."""
    ratio = float(np.median([row.after / row.quick for row in rows]))
    good = sum(row.after <= WORSE * row.quick for row in rows)
    count = {word: sum(row.agrees == word for row in rows) for word in AGREES}
    return (
        f"{len(rows)} systems: {', '.join(f'{word} {n}' for word, n in count.items())}; within 5 % of the quick fit or "
        f"better {good} (median ratio {ratio:.2f}); worse than the base where nothing was fitted: "
        f"{sum(row.after > row.base for row in rows)}; {sum(row.seconds for row in rows):.0f} s"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="cases whose name holds one of these words (all)")
    parser.add_argument("--rows", type=Path, metavar="FILE", help="JSON lines, one for each system that is done")
    parser.add_argument("--report", type=Path, metavar="FOLDER", help="a page for each")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--data", type=Path, default=SHARED, metavar="FOLDER", help=f"where the data are ({SHARED})")
    parser.add_argument("--jobs", type=int, default=2)
    write_option(parser)
    args = parser.parse_args()
    if args.write and args.names:
        sys.exit("--write states the figures of all systems: leave out their names")
    head = f"{'system':<24} {'base':>8} {'after':>8} {'q. base':>8} {'q. fit':>8} {'unit':<4} {'verdict':<18} "
    print(f"{head}{'literature':<11} time   found")
    done, rows = kept(args.rows), []
    models: dict[tuple[Path, tuple[tuple[str, float, float, float], ...]], Model] = {}
    with tempfile.TemporaryDirectory() as scratch:
        for case in CASES:
            if args.names and not any(name in case.name for name in args.names):
                continue
            if case.name not in done:
                paths = case.paths(args.data, Path(scratch))
                if not paths:
                    print(f"{case.name:<24} left out: no data in {args.data / case.folder}")
                    continue
                key = case.system, case.given
                models.setdefault(key, load_model(*key))
                f, done[case.name] = diagnosed(case, models[key], paths, args.jobs)
                if args.rows:
                    with args.rows.open("a") as file:
                        file.write(json.dumps(asdict(done[case.name])) + "\n")
                if args.report:
                    args.report.mkdir(exist_ok=True, parents=True)
                    name = case.name.replace(" ", "-").replace(",", "")
                    write_text(args.report / f"{name}.html", page(f))
                    write_text(args.report / f"{name}.txt", text(f) + "\n")
            rows.append(done[case.name])
            print(line(rows[-1]), flush=True)
    if rows:
        print(summary(rows))
        publish("measured", figures(rows), args.write)
    if args.json:
        write_json(args.json, [asdict(row) for row in rows])


if __name__ == "__main__":
    main()
