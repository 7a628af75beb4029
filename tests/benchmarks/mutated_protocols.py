"""Mutated protocols through straw rig show: each ends within seconds with 0, or with 2 and one line."""

from __future__ import annotations

import argparse
import contextlib
import io
import multiprocessing
import time
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from straw.replay.cli import main as straw

SHIPPED = [
    path.read_text(encoding="utf-8") for path in (files("straw.rig") / "protocols").iterdir() if path.name.endswith("l")
]
KINDS = """name = "kinds"
pressure_unit = "kPa"
initial_deployed = [1, 4]
[limits]
max_rate = 1000
[[main]]
rows = [[0, 5], [1, -5]]
for_s = 2
[[main]]
repeat = 3
do = [{ hold = 10, for_s = 1 }, { ramp = [10, -20], for_s = 1 }]
[[main]]
prbs = { low = -5, high = 5, bit_s = 0.1, order = 5 }
for_s = 5
[[main]]
chirp = { amplitude = 3, from_hz = 0.5, to_hz = 20 }
for_s = 4
"""
NUMBERS = [
    *("0", "-1", "1", "59.99", "1e-300", "1e-9", "1e4", "86400", "5184000", "1e9", "1e10", "1e300", "1e999", "nan"),
    *("inf", "-0.0", "9223372036854775807", "99999999999999999999999", "true", '"x"', "[]", "{}", "1_000_000"),
]


@dataclass(frozen=True)
class Shown:
    """Result of one: exit code, lines on stderr, what was wrong with it (empty: nothing), s, MB."""

    text: str
    problem: str
    took_s: float
    peak_mb: float


def mutated(seed: int) -> str:
    """A protocol with one to three changes: a number, a line, a character."""
    random = np.random.default_rng(seed)
    texts = [*SHIPPED, KINDS]
    lines = texts[random.integers(len(texts))].splitlines()
    for _ in range(random.integers(1, 4)):
        k = int(random.integers(len(lines)))
        kind = random.random()
        words = lines[k].split("=")
        if kind < 0.6 and len(words) > 1:
            parts = words[-1].replace("[", "[ ").replace("]", " ]").replace(",", " , ").split()
            numeric = [i for i, part in enumerate(parts) if part.strip("-").replace(".", "").isdigit()]
            if numeric:
                parts[numeric[random.integers(len(numeric))]] = NUMBERS[random.integers(len(NUMBERS))]
            lines[k] = "=".join([*words[:-1], " " + " ".join(parts)])
        elif kind < 0.75:
            lines.insert(k, lines[random.integers(len(lines))])
        elif kind < 0.85 and len(lines) > 1:
            del lines[k]
        elif lines[k]:
            at = int(random.integers(len(lines[k])))
            lines[k] = lines[k][:at] + chr(random.integers(32, 127)) + lines[k][at + 1 :]
    return "\n".join(lines) + "\n"


def show(seed: int) -> Shown:
    """Draw one in this process; its memory is this process' peak so far."""
    text = mutated(seed)
    with TemporaryDirectory() as folder:
        path, said, before_s = Path(folder) / "p.toml", io.StringIO(), time.monotonic()
        path.write_text(text, encoding="utf-8")
        problem = ""
        try:
            with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
                code = straw(["rig", "show", str(path), "-o", str(Path(folder) / "p.png")])
            lines = said.getvalue().strip().splitlines()
            if code not in (0, 2) or len(lines) != (code == 2):
                problem = f"code {code}, said {lines}"
        except BaseException as error:
            problem = f"{type(error).__name__}: {error}"
        return Shown(text, problem, time.monotonic() - before_s, peak_mb())


def peak_mb() -> float:
    """Peak memory of this process."""
    import resource  # POSIX

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """Print the results; exit code 1 if one misbehaved."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--count", type=int, default=1000)
    options.add_argument("--seed", type=int, default=0)
    args = options.parse_args()
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=50) as pool:
        shown = list(pool.imap(show, range(args.seed, args.seed + args.count)))
    bad = [one for one in shown if one.problem]
    print(
        f"{len(shown)} protocols: {len(bad)} misbehaved; longest {max(one.took_s for one in shown):.1f} s, "
        f"peak {max(one.peak_mb for one in shown):.0f} MB"
    )
    for one in bad[:10]:
        print(one.problem, "\n" + one.text)
    raise SystemExit(bool(bad))


if __name__ == "__main__":
    main()
