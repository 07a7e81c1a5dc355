"""From end points to small pieces of surface."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import njit
from slams.scan.scan_kernels import Points
from slams.types import Floats, Pose2


class Walls(NamedTuple):
    """What counts as a piece of wall.

    `reach` [m] from a point to the neighbors its normal is fitted to; `flatness` [m] greatest
    deviation of the neighbors from their line; `ratio` greatest deviation over length, squared;
    `grazing` least cosine between beam and normal.
    """

    reach: float
    flatness: float
    ratio: float
    grazing: float


NEIGHBORS = 2  # points on either side that are neighbors at any distance
GAP = 10.0  # a wall is followed to an incidence at which neighbors lie this many beam widths apart


@njit
def merged(points: Points, n: int, grain: float, out: Floats) -> int:
    """Means of neighbors that end within `grain` [m] of each other.

    ours: points (3, >= n) x, y [m] of the base frame; out (>= n, 3) x, y, how many beams; returns
    how many rows were written.
    """
    count, first_x, first_y = 0, 0.0, 0.0
    for i in range(n):
        x, y = points[0, i], points[1, i]
        dx, dy = x - first_x, y - first_y
        if count == 0 or dx * dx + dy * dy >= grain * grain:
            first_x, first_y = x, y
            out[count, 0] = out[count, 1] = out[count, 2] = 0.0
            count += 1
        out[count - 1, 2] += 1.0
        out[count - 1, 0] += (x - out[count - 1, 0]) / out[count - 1, 2]
        out[count - 1, 1] += (y - out[count - 1, 1]) / out[count - 1, 2]
    return count


@njit
def surfaces(
    points: Floats, n: int, mount: Pose2, increment: float, walls: Walls, out: Floats
) -> int:
    """Points with the normal of the wall they lie on, facing the laser.

    ours: the normal is the direction of least variance among the neighbors along the scan within
    reach, at least two to either side. A point that lies on nothing flat looks at the laser: a
    post, or the frame of a door, tells along a corridor what its walls do not. One on a wall seen
    edge-on is left out, also where beams are so far apart on it that it has no neighbors: of those
    beside it one is nearer then, the other farther. points (>= n, 3) of `merged`; `increment` [rad]
    between two beams; out (>= n, 5) rows x, y [m], nx, ny, how many beams; returns how many.
    """
    count = 0
    for i in range(n):
        px, py = points[i, 0], points[i, 1]
        bx, by = mount.x - px, mount.y - py
        away = math.sqrt(bx * bx + by * by)
        if away <= 0.0:
            continue
        widest = max(walls.reach, GAP * away * increment)
        near, w, sx, sy, sxx, sxy, syy = 1, points[i, 2], 0.0, 0.0, 0.0, 0.0, 0.0
        farther = 0  # sides on which what lies beyond the neighbors is farther, less those nearer
        for side in (-1, 1):
            j, last_x, last_y = i + side, 0.0, 0.0
            while 0 <= j < n:
                x, y, m = points[j, 0] - px, points[j, 1] - py, points[j, 2]
                dx, dy = x - last_x, y - last_y
                if dx * dx + dy * dy > widest * widest:
                    beyond = math.hypot(mount.x - px - x, mount.y - py - y) - away
                    farther += int(beyond > walls.reach) - int(beyond < -walls.reach)
                    break
                if abs(j - i) > NEIGHBORS and x * x + y * y > walls.reach * walls.reach:
                    break
                near, w, sx, sy = near + 1, w + m, sx + m * x, sy + m * y
                sxx, sxy, syy = sxx + m * x * x, sxy + m * x * y, syy + m * y * y
                last_x, last_y = x, y
                j += side
        if near <= NEIGHBORS and farther <= 0:
            continue
        nx, ny = bx / away, by / away
        vxx, vxy, vyy = sxx - sx * sx / w, sxy - sx * sy / w, syy - sy * sy / w
        half = 0.5 * (vxx - vyy)
        split = math.sqrt(half * half + vxy * vxy)
        spread, mean = split / w, 0.5 * (vxx + vyy) / w
        flatness = walls.flatness * walls.flatness
        flat = mean - spread <= min(walls.ratio * (mean + spread), flatness)
        if flat and near > NEIGHBORS and split > 0.0:
            wx, wy = (vxy, -split - half) if half > 0.0 else (half - split, vxy)
            length = math.sqrt(wx * wx + wy * wy)
            toward = wx * nx + wy * ny
            if abs(toward) < walls.grazing * length:
                continue
            length = length if toward > 0.0 else -length
            nx, ny = wx / length, wy / length
        out[count, 0], out[count, 1], out[count, 2] = px, py, nx
        out[count, 3], out[count, 4] = ny, points[i, 2]
        count += 1
    return count
