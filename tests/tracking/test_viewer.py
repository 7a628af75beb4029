"""Views computed while decoding are reused by the solver: only around rejected frames are they recomputed."""

from __future__ import annotations

import numpy as np
import pytest

from straw.tracking import viewer as module
from straw.tracking.corners import Sighting
from straw.tracking.record import Record
from straw.tracking.video import Frame
from straw.tracking.viewer import viewer
from straw.tracking.views import AROUND, Views, views_of

COUNT = 90
LUMA = np.zeros((2, 2), np.uint8)


@pytest.fixture
def record(tmp_path):
    """A board that moves over the picture; it is not detected in frame 70."""
    record, rng = Record(tmp_path / "record", {}, (4, 4)), np.random.default_rng(0)
    grid = 20.0 * np.stack(np.meshgrid(range(4), range(4), indexing="ij"), axis=-1) + 800.0
    for k in range(COUNT):
        here = grid + 30 * np.sin(k / 9) + rng.normal(0, 0.05, grid.shape)
        seen = Sighting(here, np.ones((4, 4), bool), np.eye(3).ravel(), np.ones(2), 20.0, 80.0, 0.05)
        record.add(Frame(k, k / 240, LUMA, key=k % 30 == 0), 0, seen if k != 70 else "no board in the picture")
    yield record
    record.remove()


@pytest.mark.parametrize("rejected", [(), (0,), (40, 44, 72), (COUNT - 1,)])
def test_views_around_rejected_frames_equal_those_of_a_full_recomputation(record, hero6, monkeypatch, rejected):
    rows, believed, looked_at = record.rows(0, COUNT), np.ones(COUNT, bool), []
    believed[list(rejected)] = False
    whole, where = views_of(record, hero6, 0, rows, believed)

    def counted(record, lens, start, rows, believed):
        looked_at.append(len(rows))
        return views_of(record, lens, start, rows, believed)

    monkeypatch.setattr(module, "views_of", counted)
    found, at = viewer(record, hero6, believed, {0: views_of(record, hero6, 0, rows)})(0, rows)
    np.testing.assert_array_equal(at, where)
    for name in Views.__annotations__:
        # the frame's period is the median of fewer steps, equal except for the last bits
        np.testing.assert_allclose(getattr(found, name), getattr(whole, name), rtol=1e-9, atol=1e-9)
    assert sum(looked_at) <= len(rejected) * (2 * AROUND + 1)
