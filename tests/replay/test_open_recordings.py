"""Replay of the given recordings, whose apparatus is not part of this project."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from straw.replay.cli import main

BASE = "r_ch_m = 0.40e-3\nc_zeta_n_s_per_m = 20.0\nc_phi_n_m_s_per_rad = 2e-3\n"


def replayed(shared: Path, specimen: str, folder: Path) -> dict[str, dict[str, float]]:
    """Metrics of X by run, with the base constants published for the given folders."""
    (folder / "base.toml").write_text(BASE)
    runs = sorted(map(str, (shared / "recordings" / specimen).glob("*.mcap")))
    out = ["--straw", str(folder / "base.toml"), "--report", str(folder / "r.html"), "--json", str(folder / "r.json")]
    assert main(["replay", *runs, *out]) == 0
    return {r["run_id"]: r["metrics"] for r in json.loads((folder / "r.json").read_text())["runs"]}


def test_every_run_of_the_complete_specimen_is_explained_to_within_noise_and_repeatability(
    shared: Path, tmp_path: Path
) -> None:
    """Noise is 25 um and 1.5 mrad; snap times repeat to a few ms, which a snap at 5 mm per 50 ms turns into Z."""
    found = replayed(shared, "open-a", tmp_path)
    assert len(found) == 8
    for metrics in found.values():
        assert metrics["x_m"]["rmse"] < 1.2 * 25e-6
        assert metrics["z_m"]["rmse"] < 3 * 25e-6
        assert metrics["phi_rad"]["rmse"] < 2 * 1.5e-3


@pytest.mark.parametrize("specimen", ["open-b", "open-c", "open-d"])
def test_specimens_with_something_left_out_are_not_explained(shared: Path, specimen: str, tmp_path: Path) -> None:
    found = replayed(shared, specimen, tmp_path)
    assert max(m["x_m"]["rmse"] for m in found.values()) > 10 * 25e-6
