"""The trained proposal as a file: an ensemble of networks, the features' scaling, the training distribution's
limits."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.propose.network import Batch, Weights, answer
from straw.replay.errors import ReplayError

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

TRAIN = "train it with python -m straw.replay.diagnose.propose.train"
SHIPPED = Path(__file__).with_name("weights.npz")
#: Of the layout of the file with the weights; a file of another is refused.
VERSION = 1
#: Precision of the limits of the training distribution; the networks' weights have half of it.
EXACT, HALF = np.float32, np.float16


@dataclass(frozen=True, eq=False)
class Scaling:
    """Standardises features: minus mean, over deviation, outliers compressed."""

    mean: Singles
    sd: Singles

    def __call__(self, x: NDArray[Any]) -> Singles:
        """Scaled features (runs, features)."""
        return np.asarray(4 * np.tanh((x.astype(np.float32) - self.mean) / self.sd / 4), dtype=np.float32)


@dataclass(frozen=True, eq=False)
class Familiar:
    """The training distribution: principal directions of its runs' features (after Hotelling and Jackson: distance
    within these directions, and distance from them), and quantiles of held-out campaigns."""

    directions: Singles  # (features, k)
    variance: Singles  # (k,)
    quantiles: Singles  # (2, levels) of the campaign's mean of both distances

    def distances(self, x: Singles) -> Floats:
        """Both distances of a campaign's scaled runs (runs, features), (2,)."""
        along = x @ self.directions
        beside = np.mean(x**2, axis=1) - np.sum(along**2, axis=1) / x.shape[1]
        return np.array([np.mean(along**2 / self.variance), beside.mean()], dtype=np.float64)

    def quantile(self, x: Singles) -> float:
        """Share of held-out campaigns that lie nearer, by the larger quantile of both distances."""
        levels = np.linspace(0, 1, self.quantiles.shape[1])
        found = [np.interp(d, q, levels) for d, q in zip(self.distances(x), self.quantiles, strict=True)]
        return float(max(found))


@dataclass(frozen=True, eq=False)
class Learned:
    """An ensemble with its scaling, its limits and its recipe."""

    members: tuple[Weights, ...]
    scaling: Scaling
    familiar: Familiar
    about: dict[str, Any]  # causes, numbers, prior, temperature, recipe, seed, date, version

    def ask(self, x: NDArray[Any]) -> list[Singles]:
        """Each member's output for a campaign's runs (runs, features)."""
        batch = Batch(self.scaling(x), np.array([0]))
        return [answer(w, batch)[0] for w in self.members]

    def save(self, path: Path) -> None:
        """Write one file with the hash of its arrays inside."""
        arrays: dict[str, NDArray[Any]] = {
            f"member{k}_{name}": x.astype(HALF) for k, w in enumerate(self.members) for name, x in w.items()
        }
        arrays |= {"scaling_mean": self.scaling.mean, "scaling_sd": self.scaling.sd}
        arrays |= {"familiar_directions": self.familiar.directions.astype(HALF)}
        arrays |= {"familiar_variance": self.familiar.variance, "familiar_quantiles": self.familiar.quantiles}
        about = {**self.about, "version": VERSION, "sha256": _hashed(arrays)}
        part = path.with_name(path.name + ".part")
        with part.open("wb") as file:
            np.savez_compressed(file, about=np.array(json.dumps(about)), **arrays)  # type: ignore[arg-type]
        part.replace(path)


def load(path: Path = SHIPPED) -> Learned:
    """Read a trained proposal; ReplayError where it is missing, damaged or of another version."""
    try:
        with np.load(path) as data:
            arrays = {name: data[name] for name in data.files if name != "about"}
            about = json.loads(str(data["about"]))
    except (OSError, ValueError, KeyError) as error:
        raise ReplayError(f"{path}: cannot be read: {error}; {TRAIN}") from None
    if about.get("version") != VERSION or about.get("sha256") != _hashed(arrays):
        raise ReplayError(f"{path}: damaged or of another version; {TRAIN}")
    members: list[Weights] = [{} for _ in range(int(about["members"]))]
    for name, x in arrays.items():
        if name.startswith("member"):
            which, key = name.removeprefix("member").split("_")
            members[int(which)][key] = x.astype(np.float32)
    scaling = Scaling(arrays["scaling_mean"], arrays["scaling_sd"])
    directions = arrays["familiar_directions"].astype(np.float32)
    familiar = Familiar(directions, arrays["familiar_variance"], arrays["familiar_quantiles"])
    return Learned(tuple(members), scaling, familiar, about)


@lru_cache(maxsize=1)
def shipped() -> Learned:
    """The proposal that comes with the package."""
    return load()


def _hashed(arrays: dict[str, NDArray[Any]]) -> str:
    digest = hashlib.sha256()
    for name in sorted(arrays):
        digest.update(name.encode() + arrays[name].dtype.str.encode() + arrays[name].tobytes())
    return digest.hexdigest()
