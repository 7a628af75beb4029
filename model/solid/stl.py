"""STL: the body of revolution as triangles, binary, in mm as printers take it."""

from __future__ import annotations

import numpy as np

from straw.model.solid.outline import Floats

RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def triangles(corners: Floats, around: int = 180) -> Floats:
    """Triangles (n, 3, 3) in m, outward by the right hand, of a section (corners, 2) turned about the axis."""
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    made = []
    for (r0, z0), (r1, z1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        low, high = (np.column_stack([r * ring, np.full(around, z)]) for r, z in ((r0, z0), (r1, z1)))
        next_low, next_high = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
        if r0 > 0:
            made.append(np.stack([low, next_low, high], axis=1))
        if r1 > 0:
            made.append(np.stack([next_low, next_high, high], axis=1))
    return np.concatenate(made)


def stl_bytes(facets: Floats) -> bytes:
    """A binary STL of triangles (n, 3, 3) in m; its numbers are mm."""
    record = np.zeros(len(facets), RECORD)
    mm = 1e3 * facets
    normal = np.cross(mm[:, 1] - mm[:, 0], mm[:, 2] - mm[:, 0])
    record["normal"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    record["corners"] = mm
    header = b"straw, mm".ljust(80)
    return header + len(facets).to_bytes(4, "little") + record.tobytes()
