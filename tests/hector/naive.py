"""Plain slow twins of hector's kernels, written from the definitions; never shipped."""

import math

import numpy as np


def cells_of_line(ax, ay, bx, by):
    """Cells from a up to, without, b by the integer Bresenham of the specification."""
    dx, dy = abs(bx - ax), abs(by - ay)
    sx, sy = (1 if bx > ax else -1), (1 if by > ay else -1)
    n = max(dx, dy)
    cells, x, y, error = [], ax, ay, n // 2
    for _ in range(n):
        cells.append((x, y))
        if dx >= dy:
            x += sx
            error += dy
            if error >= n:
                y += sy
                error -= n
        else:
            y += sy
            error += dx
            if error >= n:
                x += sx
                error -= n
    return cells


def inserted(shape, x0, y0, resolution, points, pose, origin, l_free, l_occupied):
    """Log-odds after one scan: free or occupied once per cell, occupied wins."""
    free, occupied = set(), set()

    def cell(x, y):
        c, s = math.cos(pose[2]), math.sin(pose[2])
        wx, wy = pose[0] + c * x - s * y, pose[1] + s * x + c * y
        return math.floor((wx - x0) / resolution + 0.5), math.floor((wy - y0) / resolution + 0.5)

    def inside(c):
        return 0 <= c[0] < shape[1] and 0 <= c[1] < shape[0]

    start = cell(*origin)
    for point in points.T:
        end = cell(*point)
        if end == start or not inside(end) or not inside(start):
            continue
        free.update(cells_of_line(*start, *end))
        occupied.add(end)
    log_odds = np.zeros(shape)
    for x, y in free - occupied:
        log_odds[y, x] = l_free
    for x, y in occupied:
        log_odds[y, x] = l_occupied
    return log_odds


def map_value(p, x, y):
    """Bilinear interpolation between cell centers at integer coordinates."""
    ix, iy = math.floor(x), math.floor(y)
    fx, fy = x - ix, y - iy
    rows = [(1 - fx) * p[iy + k, ix] + fx * p[iy + k, ix + 1] for k in (0, 1)]
    return (1 - fy) * rows[0] + fy * rows[1]
