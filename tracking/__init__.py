"""Pictures to poses: lens, corners, planar pose, and the painter that makes truth."""
