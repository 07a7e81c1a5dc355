"""GMapping's kernels once more, slowly, in plain numpy: what they should compute."""

from __future__ import annotations

import math

import numpy as np


def cell(coordinate, resolution):
    return math.floor(coordinate / resolution + 0.5)


def moved(pose, points):
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return points @ np.array([[c, s], [-s, c]]) + pose[:2]


def hit_map(points, resolution):
    """Cell -> all hits in it."""
    cells = {}
    for p in points:
        cells.setdefault((cell(p[0], resolution), cell(p[1], resolution)), []).append(p)
    return cells


def nearest2(cells, point, resolution):
    """Squared distance to the nearest mean in the 3 x 3 cells around, None if there is none."""
    ix, iy = cell(point[0], resolution), cell(point[1], resolution)
    found = [
        float(np.sum((point - np.mean(cells[ix + dx, iy + dy], axis=0)) ** 2))
        for dx in (-1, 0, 1)
        for dy in (-1, 0, 1)
        if (ix + dx, iy + dy) in cells
    ]
    return min(found) if found else None


def score(cells, points, resolution, sigma):
    squares = [nearest2(cells, p, resolution) for p in points]
    return sum(math.exp(-d / sigma) for d in squares if d is not None)


def log_likelihood(cells, points, resolution, lsigma, missed):
    squares = [nearest2(cells, p, resolution) for p in points]
    return -sum(missed if d is None else d for d in squares) / lsigma


def facing(normal):
    return round(math.atan2(normal[1], normal[0]) / (math.pi / 2)) % 4


def surface_map(points, normals, resolution, band, cap):
    """(layer, cell) -> weighted means of distance and normal, and the weight."""
    cells = {}
    for p, n in zip(points, normals, strict=True):
        tangent = np.array([-n[1], n[0]])
        ix, iy = cell(p[0], resolution), cell(p[1], resolution)
        for jx in range(ix - band, ix + band + 1):
            for jy in range(iy - band, iy + band + 1):
                offset = np.array([jx, jy]) * resolution - p
                weight = 1.0 - abs(tangent @ offset) / (1.5 * resolution)
                if weight > 0.0 and abs(n @ offset) <= (band + 0.5) * resolution:
                    old, total = cells.get((facing(n), jx, jy), (np.zeros(3), 0.0))
                    line = np.array([n @ offset, *n])
                    mean = (old * total + line * weight) / (total + weight)
                    cells[facing(n), jx, jy] = (mean, min(total + weight, cap))
    return cells


def residuals(cells, pose, points, normals, resolution):
    """Distance of every point from the mean line of its cell, nan where there is none."""
    out = []
    for p, n in zip(moved(pose, points), moved((0, 0, pose[2]), normals), strict=True):
        ix, iy = cell(p[0], resolution), cell(p[1], resolution)
        line, weight = cells.get((facing(n), ix, iy), (None, 0.0))
        center = np.array([ix, iy]) * resolution
        out.append(line[0] + line[1:] @ (p - center) if weight > 0 else math.nan)
    return np.array(out)
