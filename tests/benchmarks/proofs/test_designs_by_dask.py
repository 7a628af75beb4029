"""Designs found by the workers of a Dask cluster are those found here."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from straw.replay.cli import main


def test_a_dask_cluster_finds_the_same_designs(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="dask's workers are not installed")
    wish = tmp_path / "wish.toml"
    wish.write_text("[wanted]\ndeploy_kpa = 30.0\n[vary]\nh_mm = [0.35, 0.7]\n")
    found = []
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster:
        for where in (["--jobs", "1"], ["--dask", cluster.scheduler_address]):
            told = tmp_path / "designs.json"
            options = ["--count", "64", "--keep", "1", "--check", "1", "--out", str(tmp_path), "--json", str(told)]
            assert main(["design", str(wish), *options, *where]) == 0
            found.append(json.loads(told.read_text()))
    assert found[0] == found[1]
    assert found[0]["designs"][0]["gives"]["deploy_kpa"] == pytest.approx(30.0, abs=1e-3)
