"""Trains the proposal: simulates campaigns, makes recordings of them, trains networks, writes the weights.

    python -m straw.replay.diagnose.propose.train FOLDER --campaigns 15000

FOLDER keeps the simulations and every finished network: an interrupted training continues, and a larger one reuses
them. With a new law in `model/terms` and in the library, the same command on another folder includes it;
`--no-simulation` only trains on the folder's contents. Takes hours on two cores.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.propose import network
from straw.replay.diagnose.propose.dataset import Examples, examples_of, hash_of_code, joined, numbers, recipe
from straw.replay.diagnose.propose.learned import SHIPPED, Familiar, Learned, Scaling
from straw.replay.diagnose.propose.network import Adam, Batch, Weights, answer, fresh, learning_rates, slopes
from straw.replay.diagnose.propose.simulate_campaigns import SPECIMENS, simulate_until
from straw.replay.diagnose.systems.straw.library import causes
from straw.replay.progress import progress_bar, say

#: Every tenth group is held out for the test, and as many again calibrate the limits and the temperature.
FOLDS, HELD_OUT, CALIBRATE = 10, 2, 3
#: Recordings of a step, passes through all of them, networks that are averaged; principal directions and quantiles that
#: describe the training distribution.
BATCH, EPOCHS, MEMBERS, DIRECTIONS, LEVELS = 48, 40, 3, 40, 201
Indices = NDArray[np.int64]
Singles = NDArray[np.float32]


def gathered(folder: Path, times: int, folds: tuple[int, ...], most: int | None = None) -> Examples:
    """Examples of the groups whose number falls into some folds."""
    paths = [p for p in sorted((folder / "groups").glob("group-*.npz")) if int(p.stem.split("-")[1]) % FOLDS in folds]
    paths = paths[:most]
    parts = []
    with progress_bar("features", "groups") as update:
        for k, path in enumerate(paths):
            parts.append(examples_of(path, times))
            update(k + 1, len(paths))
    return joined(parts)


def scaling_of(x: NDArray[np.float16]) -> Scaling:
    """Mean and deviation of every feature, of some thousands of runs."""
    some = x[:: max(1, len(x) // 20_000)].astype(np.float32)
    return Scaling(some.mean(axis=0), some.std(axis=0) + 1e-3)


def scales_of(examples: Examples) -> Singles:
    """Root mean square of every number where present, with a lower bound: its unit for the networks."""
    known = np.isfinite(examples.values)
    square = np.nan_to_num(examples.values) ** 2
    mean_square = square.sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    return np.asarray(np.sqrt(mean_square + 1e-2), dtype=np.float32)


def trained(examples: Examples, scaling: Scaling, seed: int, epochs: int = EPOCHS) -> Weights:
    """One network."""
    scales = scales_of(examples)
    rng = np.random.default_rng([seed, 33])
    w = fresh(rng, examples.x.shape[1], examples.present.shape[1], examples.values.shape[1])
    share = np.clip(examples.present.mean(axis=0), 1e-3, 1 - 1e-3)
    w["b3"][: len(share)] = np.log(share / (1 - share))
    adam, per_epoch = Adam(w), max(len(examples) // BATCH, 1)
    with progress_bar(f"network {seed}", "steps") as update:
        order: Indices = np.empty(0, np.int64)
        for step, rate in enumerate(learning_rates(epochs * per_epoch)):
            if step % per_epoch == 0:
                order = rng.permutation(len(examples))
            which = order[(step % per_epoch) * BATCH :][:BATCH]
            raw = examples.batch(which, rng)
            batch = Batch(scaling(raw.x), raw.starts)
            adam.step(w, slopes(w, batch, examples.truth(which, scales), rng)[1], rate)
            update(step + 1, epochs * per_epoch)
    return w


def asked(members: list[Weights], scaling: Scaling, examples: Examples) -> NDArray[np.float32]:
    """Every member's output for each recording, (members, recordings, outputs)."""
    out = []
    for k in range(0, len(examples), 256):
        raw = examples.batch(np.arange(k, min(k + 256, len(examples))))
        out.append(np.stack([answer(w, Batch(scaling(raw.x), raw.starts)) for w in members]))
    return np.concatenate(out, axis=1)


def tempered(logits: NDArray[np.float32], present: NDArray[np.bool_]) -> float:
    """The temperature (Guo et al. 2017) of maximum likelihood for the ensemble's mean."""
    tried = np.geomspace(0.5, 4.0, 43)
    losses = [np.mean(np.logaddexp(0, logits / t) - present * logits / t) for t in tried]
    return float(tried[int(np.argmin(losses))])


def familiar_of(x: NDArray[np.float16], scaling: Scaling, calibrate: Examples) -> Familiar:
    """Principal directions of the training's runs, and the distances of held-out campaigns."""
    some = scaling(x[:: max(1, len(x) // 12_000)])
    variance, directions = np.linalg.eigh(some.T @ some / len(some))
    order = np.argsort(variance)[::-1][:DIRECTIONS]
    found = Familiar(
        directions[:, order].astype(np.float32), variance[order].astype(np.float32), np.zeros((2, LEVELS), np.float32)
    )
    ends = np.append(calibrate.starts[1:], len(calibrate.x))
    away = [found.distances(scaling(calibrate.x[a:b])) for a, b in zip(calibrate.starts, ends, strict=True)]
    quantiles = np.quantile(np.array(away), np.linspace(0, 1, LEVELS), axis=0).T
    return Familiar(found.directions, found.variance, quantiles.astype(np.float32))


def top(scores: NDArray[np.floating[Any]], present: NDArray[np.bool_]) -> dict[str, float]:
    """Shares of held-out recordings: one cause, first or among the first three; two, both first or among four."""
    order = np.argsort(-scores, axis=1)
    many = present.sum(axis=1)
    hit = np.take_along_axis(present, order, axis=1)
    one, two = many == 1, many == 2
    return {
        "one_first": float(hit[one, 0].mean()),
        "one_in_three": float(hit[one, :3].any(axis=1).mean()),
        "two_first": float(hit[two, :2].all(axis=1).mean()),
        "two_in_four": float((hit[two, :4].sum(axis=1) == 2).mean()),
        "nothing_above_half": float((scores[many == 0].max(axis=1) < 0.5).mean()),
    }


def main() -> None:
    """Simulate, train, write."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("folder", type=Path, help="for simulations and networks; 2 GB for 15,000 campaigns")
    ask.add_argument("--campaigns", type=int, default=15_000)
    ask.add_argument("--seed", type=int, default=0, help="of the first group and network")
    ask.add_argument("--times", type=int, default=1, help="recordings, with other noise and faults, of each specimen")
    ask.add_argument("--no-simulation", action="store_true", help="train on the folder's contents")
    ask.add_argument(
        "--curve",
        action="store_true",
        help="show the result with an eighth, a quarter and a half of the data; write nothing",
    )
    ask.add_argument("--out", type=Path, default=SHIPPED)
    args = ask.parse_args()
    if not args.no_simulation:
        groups = -(-args.campaigns // SPECIMENS)
        with progress_bar("simulating", "groups") as update:
            for k in range(groups):
                simulate_until(args.folder / "groups", [args.seed + k])
                update(k + 1, groups)
    rest = tuple(k for k in range(FOLDS) if k not in (HELD_OUT, CALIBRATE))
    examples, calibrate, held = (gathered(args.folder, args.times, f) for f in (rest, (CALIBRATE,), (HELD_OUT,)))
    say(f"{len(examples)} training recordings, {len(held)} held out")
    if args.curve:
        _curve(examples, held, args.seed)
        return
    write(args, examples, calibrate, held)


def write(args: argparse.Namespace, examples: Examples, calibrate: Examples, held: Examples) -> None:
    """Train, calibrate, test and save the ensemble."""
    scaling = scaling_of(examples.x)
    members = [_kept(args.folder, examples, scaling, args.seed + k) for k in range(MEMBERS)]
    straw, causes_known = StrawParameters(), examples.present.shape[1]
    logits = asked(members, scaling, calibrate)[..., :causes_known].mean(axis=0)
    temperature = tempered(logits, calibrate.present)
    found = asked(members, scaling, held)[..., :causes_known].mean(axis=0)
    good = {k: round(v, 3) for k, v in top(1 / (1 + np.exp(-found / temperature)), held.present).items()}
    about = {
        "members": len(members),
        "causes": list(causes(straw.cells)),
        "numbers": [n.name for n in numbers(straw)],
        "scales": [round(float(s), 5) for s in scales_of(examples)],
        "prior": [round(float(p), 4) for p in examples.present.mean(axis=0)],
        "temperature": round(temperature, 4),
        "recipe": recipe(),
        "recordings": len(examples),
        "held_out": good,
        "seed": args.seed,
        "date": datetime.date.today().isoformat(),
    }
    Learned(tuple(members), scaling, familiar_of(examples.x, scaling, calibrate), about).save(args.out)
    print(f"{args.out}: {args.out.stat().st_size / 1e6:.1f} MB; held out: {good}")


def _kept(folder: Path, examples: Examples, scaling: Scaling, seed: int) -> Weights:
    """The folder's network if it was trained on these examples with these settings, else a new one."""
    how = hash_of_code(network) + f"{BATCH} {EPOCHS}"
    of = hashlib.sha256(examples.values.tobytes() + examples.x[::97].tobytes() + how.encode()).hexdigest()[:12]
    path = folder / f"network-{of}-{seed}.npz"
    if path.exists():
        with np.load(path) as data:
            return {name: data[name] for name in data.files}
    w = trained(examples, scaling, seed)
    np.savez(path, **w)  # type: ignore[arg-type]
    return w


def _curve(examples: Examples, held: Examples, seed: int) -> None:
    for part in (8, 4, 2, 1):
        n = len(examples) // part
        some = Examples(
            examples.x[: examples.starts[n] if n < len(examples) else None],
            examples.starts[:n], examples.present[:n], examples.values[:n], examples.usual[:n],
        )  # fmt: skip
        scaling = scaling_of(some.x)
        w = trained(some, scaling, seed, EPOCHS)
        found = asked([w], scaling, held)[0, :, : held.present.shape[1]]
        print(n, {k: round(v, 3) for k, v in top(1 / (1 + np.exp(-found)), held.present).items()}, flush=True)


if __name__ == "__main__":
    main()
