"""Plain numpy twins of the kernels of tsd, written for reading."""

import math

import numpy as np

from slams.types import Pose2


def bilinear(image, corner, cell, x, y):
    """Value between the four cell centers around a point."""
    u, v = (x - corner[0]) / cell - 0.5, (y - corner[1]) / cell - 0.5
    ix, iy = math.floor(u), math.floor(v)
    wx, wy = u - ix, v - iy
    if not (0 <= ix < image.shape[1] - 1 and 0 <= iy < image.shape[0] - 1):
        return math.nan
    patch = image[iy : iy + 2, ix : ix + 2].astype(float)
    return float(np.array([1 - wy, wy]) @ patch @ np.array([1 - wx, wx]))


def push_once(shape, corner, cell, tau, pose, ranges, angles, weight):
    """A first push into an unknown grid, cell by cell: tsd of all cells the beams reach."""
    tsd = np.full(shape, np.nan)
    step = angles[1] - angles[0]
    for iy in range(shape[0]):
        for ix in range(shape[1]):
            x, y = corner[0] + (ix + 0.5) * cell, corner[1] + (iy + 0.5) * cell
            local = Pose2(*pose).inverse().transform(np.array([[x, y]]))[0]
            beam = round((math.atan2(local[1], local[0]) - angles[0]) / step)
            if 0 <= beam < len(ranges):
                sd = ranges[beam] - math.hypot(*local)
                if sd >= -tau:
                    tsd[iy, ix] = min(sd / tau, 1.0)
    return tsd


def cast_ray(image, corner, cell, origin, direction, far):
    """Distance to the first sign change from + to - in steps of a cell."""
    before = math.nan
    for k in range(int(far / cell)):
        x, y = origin[0] + k * cell * direction[0], origin[1] + k * cell * direction[1]
        now = bilinear(image, corner, cell, x, y)
        if before > 0 > now:
            return (k - 1 + before / (before - now)) * cell
        before = now
    return math.nan


def nearest(points, query, reach):
    """Index of the nearest point within reach, -1 when there is none."""
    d = np.hypot(*(points - query).T)
    return int(d.argmin()) if d.min() <= reach else -1


def pdf_score(image, corner, cell, points, motion, pose, z_random):
    """Product of 1 - (1 - zrand) |tsd| over all points, zrand where unknown."""
    placed = (Pose2(*pose) @ Pose2(*motion)).transform(points)
    values = [bilinear(image, corner, cell, x, y) for x, y in placed]
    return math.prod(z_random if v != v else 1 - (1 - z_random) * abs(v) for v in values)


def line_of(points):
    """Center and normal of the total least squares line."""
    center = points.mean(axis=0)
    return center, np.linalg.svd(points - center)[2][1]


def coarse_score(value, points, layers, x, y, truncation):
    """How well shifted points agree with a field, read cell by cell; value(layer, x, y) or nan."""
    total = 0.0
    for (px, py), layer in zip(points, layers, strict=True):
        v = value(layer, x + px, y + py)
        total += 0.0 if math.isnan(v) else max(1.0 - abs(v) / truncation, 0.0)
    return total


def passed(laser, ends, corner, cell, shape):
    """Cells that the beams from a laser to their ends pass, in steps of a cell."""
    seen = np.zeros(shape, bool)
    for end in ends:
        r = np.hypot(*(end - laser))
        for step in range(int(r / cell)):
            x, y = laser + step * cell * (end - laser) / r
            seen[math.floor((y - corner[1]) / cell), math.floor((x - corner[0]) / cell)] = True
    return seen


def beam_score(closest, angles, points, motion, model):
    """Product of the beam model's probabilities of moved points; 0 when too few have a partner."""
    product, near = 1.0, 0
    for x, y in Pose2(*motion).transform(points):
        r, a = math.hypot(x, y), math.atan2(y, x)
        j = min(max(math.floor((a - angles[0]) / angles[1] + 0.5), 0), len(closest) - 1)
        m = closest[j, 0]
        near += closest[j, 1] < model.max_angle
        gauss = math.exp(-0.5 * ((m - r) / model.sigma) ** 2)
        p = model.hit / math.sqrt(2 * math.pi) / model.sigma * gauss
        p += model.random / model.range_max
        if r < m:
            lam = model.decay
            p += model.short * lam * math.exp(-lam * r) / (1 - math.exp(-lam * m))
        product *= p
    return product if near > model.share * len(points) else 0.0


def pushed_cell(lines, x, y, truncation, cap):
    """Value and weight that lines (x, y, nx, ny, weight) give one cell, one after the other."""
    value, total = 0.0, 0.0
    for px, py, nx, ny, weight in lines:
        sd = nx * (x - px) + ny * (y - py)
        w = weight * max(min(1.0 + sd / truncation, 1.0), 0.01)
        value += (sd - value) * w / (total + w)
        total = min(total + w, cap)
    return value, total


def matched_pairs(model, scene, gate):
    """For every model point the closest scene point that has it as nearest within the gate."""
    partner = np.full(len(model), -1)
    best = np.full(len(model), np.inf)
    for k, point in enumerate(scene):
        d = np.hypot(*(model - point).T)
        m = int(d.argmin())
        if d[m] <= gate and d[m] < best[m]:
            partner[m], best[m] = k, d[m]
    return partner
