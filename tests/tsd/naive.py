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


def pdf_score(image, corner, cell, points, motion, pose, z_random):
    """Product of 1 - (1 - zrand) |tsd| over all points, zrand where unknown."""
    placed = (Pose2(*pose) @ Pose2(*motion)).transform(points)
    values = [bilinear(image, corner, cell, x, y) for x, y in placed]
    return math.prod(z_random if v != v else 1 - (1 - z_random) * abs(v) for v in values)


def line_of(points):
    """Center and normal of the total least squares line."""
    center = points.mean(axis=0)
    return center, np.linalg.svd(points - center)[2][1]


def cell_of(kernel, layer, x, y):
    """Signed distance and center of the cell at a point, and whether a beam passed it."""
    ix = math.floor((x - kernel.corner[0]) / kernel.cell)
    iy = math.floor((y - kernel.corner[1]) / kernel.cell)
    center = kernel.corner + kernel.cell * (np.array([ix, iy]) + 0.5)
    sd = float(kernel.tsd[kernel.slots[iy // 8, ix // 8, layer], iy % 8, ix % 8])
    return sd, center, bool(kernel.cell_state[iy, ix] & 3)


def layer_of(normal):
    """The layer 0 +x, 1 +y, 2 -x, 3 -y that a normal is closest to."""
    return int(np.argmax([normal[0], normal[1], -normal[0], -normal[1]]))


def pose_score(kernel, elements, pose, truncation, penalty):
    """Match score of elements (n, 6) at a pose: inliers less conflicts."""
    total = 0.0
    for x, y, nx, ny, *_ in elements:
        point = Pose2(*pose).transform(np.array([[x, y]]))[0]
        normal = Pose2(0.0, 0.0, pose[2]).transform(np.array([[nx, ny]]))[0]
        sd, center, passed_by = cell_of(kernel, layer_of(normal), *point)
        sd += normal @ (point - center)
        if abs(sd) < truncation:
            total += 1.0 - abs(sd) / truncation
        elif not math.isnan(sd) or passed_by:
            total -= penalty
    return total


def pair_pose(line, element):
    """The pose that aligns an element x, y, normal with a line x, y, normal."""
    theta = math.atan2(line[3], line[2]) - math.atan2(element[3], element[2])
    turned = Pose2(0.0, 0.0, theta).transform(np.array([element[:2]]))[0]
    return Pose2(line[0] - turned[0], line[1] - turned[1], theta)


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


def in_line(points, beams, noise):
    """Whether the beam of the middle one of three points ends on the chord of the others."""
    first, middle, last = points
    chord = last - first
    along = np.linalg.solve(np.stack([middle, -chord], axis=1), first)[0]  # where they cross
    return beams[2] - beams[0] <= 4 and abs(along - 1.0) * np.linalg.norm(middle) < 4.0 * noise


def passed(laser, ends, corner, cell, shape):
    """Cells that the beams from a laser to their ends pass, in steps of a cell."""
    seen = np.zeros(shape, bool)
    for end in ends:
        r = np.hypot(*(end - laser))
        for step in range(int(r / cell)):
            x, y = laser + step * cell * (end - laser) / r
            seen[math.floor((y - corner[1]) / cell), math.floor((x - corner[0]) / cell)] = True
    return seen


def runs_of(points, ranges, beams, step, max_slope, noise):
    """For every hit the first and one past the last hit of its unbroken surface."""
    cuts = [0]
    for k in range(1, len(ranges)):
        gap = beams[k] - beams[k - 1]
        limit = max_slope * min(ranges[k], ranges[k - 1]) * step * gap + 4.0 * noise
        if gap <= 3 and abs(ranges[k] - ranges[k - 1]) <= limit:
            continue
        triples = [slice(a, a + 3) for a in (k - 2, k - 1) if a >= 0 and a + 3 <= len(ranges)]
        if not any(in_line(points[t], beams[t], noise) for t in triples):
            cuts.append(k)
    cuts.append(len(ranges))
    return [(a, b) for a, b in zip(cuts, cuts[1:], strict=False) for _ in range(a, b)]
