"""The rig with the apparatus on it: its recordings are read like any other, and it continues with the same straw."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from straw.replay.compare.gather import gather
from straw.replay.investigate.campaign import Folder
from straw.rig.errors import RigError
from straw.rig.protocol_toml import protocol_from_toml
from straw.rig.run_read import read_run
from tests.apparatus import rig as module
from tests.apparatus.campaign import campaign
from tests.apparatus.effects import Cause
from tests.apparatus.plans import PLANS
from tests.apparatus.rig import ApparatusRig, as_plan, as_toml

SEED, CLOG = 5, Cause("poiseuille_loss", 7e8, "Carreau, thinning")


def drive(rig: ApparatusRig, folder: Folder, protocol: str, name: str) -> None:
    """One run as the closed loop requests it."""
    path = folder.path / f"{name}.toml"
    path.write_text(protocol)
    words = ["rig", "run", str(path), "-o", str(folder.path / f"{name}.mcap"), "--specimen", folder.specimen]
    words += ["--cycle", str(folder.next_cycle()), "--operator", "x", "--meta", "investigated=1", "--emulate"]
    assert rig([*words, "--tip", str(folder.tip_of(f"{name}.mcap")), "--no-film", "--fast"]) == 0


@pytest.mark.parametrize("plan", PLANS, ids=[plan.run_id for plan in PLANS])
def test_a_plan_survives_the_conversion_to_a_protocol_and_back(plan: object) -> None:
    assert isinstance(plan, type(PLANS[0]))
    again = as_plan(protocol_from_toml(as_toml(plan), "plan"), plan.run_id, plan.cycle)
    assert replace(again, commands=()) == replace(plan, commands=())
    assert np.allclose(again.commands, plan.commands)


def test_its_recordings_equal_those_of_the_campaign_also_after_an_interruption(tmp_path: Path) -> None:
    folder = Folder(tmp_path, "specimen")
    quick = [replace(PLANS[0], run_id="a", seconds=0.6), replace(PLANS[1], run_id="b", seconds=0.6)]
    for plan in quick:
        drive(ApparatusRig((CLOG,), SEED), folder, as_toml(plan), plan.run_id)  # a rig that has only the files
    assert (folder.next_cycle(), folder.tracked("a.mcap")) == (2, True)
    made = {run.run_id: run for run in campaign((CLOG,), SEED, plans=tuple(quick), name="specimen")}
    for run in gather(folder.paths()):
        truth = made[run.run_id]
        assert run.tip is not None and truth.tip is not None  # noqa: PT018
        assert np.allclose(run.tip.x_m, truth.tip.x_m, atol=1e-12)
        assert (run.initial_deployed, run.cycle) == (truth.initial_deployed, truth.cycle)
        assert run.attachments["protocol.toml"].decode() == as_toml(next(p for p in quick if p.run_id == run.run_id))


def test_a_protocol_that_the_apparatus_cannot_run_is_an_error_of_the_rig_and_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lost(*_: object, **__: object) -> None:
        raise RuntimeError("the straw could not be followed beyond 0.3 s")

    monkeypatch.setattr(module, "make", lost)
    with pytest.raises(RigError, match="could not be followed"):
        drive(ApparatusRig((), SEED), Folder(tmp_path, "s"), as_toml(PLANS[0]), "a")
    assert not list(tmp_path.glob("*.mcap"))


def test_a_track_of_it_names_its_run(tmp_path: Path) -> None:
    folder = Folder(tmp_path, "s")
    drive(ApparatusRig((), SEED), folder, as_toml(replace(PLANS[0], seconds=0.4)), "a")
    track, run = read_run(tmp_path / "a-tip.mcap"), read_run(tmp_path / "a.mcap")
    assert (track.metadata["parent_sha256"], track.pressure, run.tip) == (run.sha256, None, None)
