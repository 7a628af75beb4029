"""What measured systems leave out, found from their recordings and a base model alone, beside what the literature says.

    python -m tests.benchmarks.measured [NAME ...] [--rows FILE.jsonl] [--report FOLDER] [--json FILE] [--jobs N]

Data are read from ../shared/realdata and left out, saying so, where they are not there. A base model holds nothing of
what is missing. Figures are RMS where nothing was fitted; "quick fit" is a hand-written model's with the answer in it.
Each row is appended to --rows as soon as it is there, and a system that has one there is not run again.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from straw.replay.diagnose.discover.discover import discover
from straw.replay.diagnose.discover.findings import SystemFindings, text
from straw.replay.diagnose.discover.page import page
from straw.replay.diagnose.systems.function.model import Model, load_model
from straw.replay.diagnose.systems.function.recording import read_recordings
from straw.replay.diagnose.systems.function.shapes import SHAPES, TABLE
from straw.replay.diagnose.systems.function.system import FunctionSystem
from straw.replay.output import write_json, write_text
from straw.rig.provenance import software
from tests.benchmarks.measured.cases import CASES, SHARED, Case

#: How a finding compares with what the literature names.
AGREES = ("yes", "place only", "in the set", "not told", "no", "no (claims)")


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
    seconds: float
    commit: str = ""  # of the checkout that made it


def diagnosed(case: Case, model: Model, paths: list[Path], jobs: int) -> tuple[SystemFindings, Row]:
    """Findings of a case, and its line."""
    begin = time.perf_counter()
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
        time.perf_counter() - begin,
        software().get("git_commit", "")[:7],
    )
    return f, row


def agrees(case: Case, f: SystemFindings) -> str:
    """How the findings compare with the literature's answer, as one of `AGREES`.

    Where nothing may be claimed, any law is a claim; where the law cannot be told, so is one whose form is told.
    """
    laws = [one.law for one in f.laws]
    if not case.found:
        return "yes" if not laws or f.verdict == "ambiguous" else "no (claims)"
    if "cannot be told" in case.literature:
        if not laws:
            return "no"
        return "yes" if f.verdict == "ambiguous" or f.forms or f.alike_places else "no (claims)"
    for number, law in enumerate(laws):
        hits = [k for k, word in enumerate(case.found) if word in law.says]
        if hits and case.forms:
            wanted = {case.forms[k] for k in hits}
            forms = {*(f.forms if number == 0 else ()), *([SHAPES[law.shape].name] if law.shape != TABLE else [])}
            return "yes" if forms & wanted else "place only"
        if hits:
            return "yes"
    alike = [*f.same, *(trial.laws[-1].says for step in f.discovery.steps for trial in step.alike)]
    if any(word in one for word in case.found for one in alike):
        return "in the set"
    return "not told" if f.verdict == "ambiguous" else "no"


def line(row: Row) -> str:
    """A row as text."""
    scale, unit = (1e3, "mV") if row.unit == "V" and row.quick < 0.01 else (1.0, row.unit)
    numbers = " ".join(f"{scale * x:8.3g}" for x in (row.base, row.after, row.quick_base, row.quick))
    return (
        f"{row.name:<24} {numbers} {unit:<4} {row.verdict:<18} {row.agrees:<11} {row.seconds:4.0f} s  {row.found[:150]}"
    )


def kept(path: Path | None) -> dict[str, Row]:
    """Rows of an earlier run by name; a line that was cut off is no row."""
    out: dict[str, Row] = {}
    for text_ in path.read_text().splitlines() if path and path.exists() else ():
        try:
            row = Row(**json.loads(text_))
        except (ValueError, TypeError):
            continue
        out[row.name] = row
    return out


def summary(rows: Sequence[Row]) -> str:
    """The table's last line."""
    ratio = float(np.median([row.after / row.quick for row in rows]))
    good = sum(row.after <= 1.05 * row.quick for row in rows)
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
    args = parser.parse_args()
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
    if args.json:
        write_json(args.json, [asdict(row) for row in rows])


if __name__ == "__main__":
    main()
