"""The room that tests match against, and what only they need of it."""

import numpy as np

from slams.room import ROOM, box, cast, drive, laser, scan_at, way

__all__ = ["CORRIDOR", "ROOM", "box", "cast", "drive", "laser", "mirrored", "scan_at", "way"]

CORRIDOR = np.array([(-50.0, -1.0, 50.0, -1.0), (-50.0, 1.0, 50.0, 1.0)])


def mirrored(segments):
    return segments * np.array([1.0, -1.0, 1.0, -1.0])
