"""The fast encoder of points on a picture writes the bytes that protobuf itself writes, which protobuf reads."""

from __future__ import annotations

import numpy as np
import pytest

from straw.rig.foxglove import ANNOTATIONS, descriptors, dots
from straw.rig.schema import message_class

NOW_NS = 1_795_000_000_123_456_789


@pytest.mark.parametrize(("count", "covered"), [(49, 0), (49, 5), (3, 3), (200, 100)])
def test_dots_are_encoded_byte_for_byte_as_by_protobuf(count: int, covered: int) -> None:
    rng = np.random.default_rng(0)
    pixels, used = rng.uniform(0, 1920, (count, 2)), np.arange(count) >= covered
    data = dots(NOW_NS, pixels, used)
    said = message_class(ANNOTATIONS, descriptors()).FromString(data)
    assert said.SerializeToString() == data
    groups = [which for which in (used, ~used) if which.any()]
    assert len(said.points) == len(groups)
    for one, which in zip(said.points, groups, strict=True):
        assert one.timestamp.seconds * 10**9 + one.timestamp.nanos == NOW_NS
        assert one.type == 1
        np.testing.assert_array_equal([(p.x, p.y) for p in one.points], pixels[which] + 0.5)
        assert one.outline_color.g == (0.8 if which is used else 0.2)
        assert one.thickness == 3.0


def test_a_picture_without_corners_has_no_dots() -> None:
    assert dots(NOW_NS, np.empty((0, 2)), np.empty(0, np.bool_)) == b""
