"""Slow and plain twins of CRSM's kernels, straight from the published rules."""

import math

import numpy as np


def critical_rays(d, range_max, jump, level):
    """Marks of the published selection, its count, and the mean range difference."""
    n = len(d)
    rho = np.abs(np.diff(d))
    big = {next(i for i in range(n) if d[i] < range_max - 0.05)}
    big.add(next(i for i in reversed(range(n)) if d[i] < range_max - 0.05))
    i = 0
    while i < n - 1:
        added = 0
        if rho[i] > jump:
            for j in (i, i + 1):
                if d[j] < range_max - 0.05:
                    big.add(j)
                    added += 1
        i += max(1, added)
    picked, count = set(big), 0
    order = sorted(big)
    for s, e in zip(order, order[1:], strict=False):
        if d[s + 1] > range_max - 0.5:
            continue
        step = rho[s : e - 1].sum() / (e - s)
        total = 0.0
        for i in range(s, e):
            total += rho[i]
            if total > level * step / math.exp(3.0 * d[i] / math.sqrt(max(d))):
                picked.add(i)
                count += 1
                total = 0.0
    while True:
        order = sorted(picked)
        halves = {(a + b) // 2 for a, b in zip(order, order[1:], strict=False) if b - a > 25}
        if not halves:
            return sorted(picked), count, rho.mean()
        picked |= halves


def fitness(grid, ends, pose, origin):
    """Published fitness of end cells at pose (x, y, theta), in double."""
    ny, nx = grid.shape
    c, s = math.cos(pose[2]), math.sin(pose[2])
    total = 0.0
    for px, py in ends:
        x = px * c - py * s + pose[0] + origin[0]
        y = px * s + py * c + pose[1] + origin[1]
        if min(x, y) - 1 < 50 or x + 1 >= nx - 50 or y + 1 >= ny - 50:
            continue
        i, j = int(x), int(y)
        if grid[j, i] == 127:
            continue
        around = (grid[j, i - 1], grid[j, i + 1], grid[j - 1, i], grid[j + 1, i])
        total += (10 * (255 - int(grid[j, i])) + sum(255 - int(v) for v in around)) / 255
    return total / (14 * len(ends))


def hill_climb(score, draws, disparity):
    """Published search: best step (dx, dy, dth) and its fitness."""
    d = disparity
    best, best_step, step = 0.0, (0, 0, 0.0), (0, 0, 0.0)
    for u, v, w in draws.tolist():
        f = score(step)
        if f > best:
            best, best_step = f, step
            turn = step[2] + (w - d // 2) / 90
            step = (step[0] + u // 4 - d // 8, step[1] + v // 4 - d // 8, turn)
        else:
            step = (u // 2 - d // 4, v // 2 - d // 4, (w - d // 2) / 45)
    return best_step, best


def draw(grid, d, angles, pose, cell, m, rho, kappa):
    """Published map update on a copy of bytes; pose (x, y) cells from the corner, theta."""
    grid = grid.astype(int)
    ny, nx = grid.shape
    seen, first = set(), True
    for r, a in zip(d, angles, strict=True):
        end = (int(r / cell * math.cos(a)), int(r / cell * math.sin(a)))
        if r == 0 or end in seen:
            continue
        seen.add(end)
        length = int(r / cell)
        for n in range(0 if first else 1, length + 3):
            x = int(n * math.cos(pose[2] + a) + pose[0])
            y = int(n * math.sin(pose[2] + a) + pose[1])
            if min(x, y) < 50 or x >= nx - 50 or y >= ny - 50:
                break
            v = grid[y, x]
            step = float(np.float32((1 - math.sqrt(abs(v - 127) / 128)) * np.float32(m)))
            if n < length:
                v = int(v + step * rho)
            if length - 2 < n < length + 1:
                v = int(v - step * kappa * rho)
            grid[y, x] = v
        first = False
    return grid


def insert(gray, weight, segments, pose, frame, rules):
    """Add segments (k, 5) and their beams to gray levels and weights (ny, nx), in place."""
    (x0, y0), cell = frame
    laser, free, max_weight, width, unknown = rules
    ny, nx = gray.shape
    centers = np.stack(np.meshgrid(x0 + cell * np.arange(nx), y0 + cell * np.arange(ny)), axis=-1)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    turn = np.array([[c, -s], [s, c]])
    drawn = np.zeros(gray.shape, bool)

    def enter(j, i, value, by):
        total = weight[j, i] + by
        gray[j, i] += (value - gray[j, i]) * by / total
        weight[j, i] = min(total, max_weight)
        drawn[j, i] = True

    for x, y, *normal, half in segments:
        offsets = centers - (turn @ (x, y) + pose[:2])
        if any(normal):
            across, along = offsets @ (turn @ normal), offsets @ (turn @ (-normal[1], normal[0]))
        else:
            across, along = np.hypot(*np.moveaxis(offsets, -1, 0)), 0.0
        near = (np.abs(across) <= 2.5 * width) & (np.abs(along) <= half + 0.5 * cell)
        for j, i in zip(*np.nonzero(near), strict=True):
            dark = math.exp(-0.5 * (across[j, i] / width) ** 2)
            enter(j, i, dark, dark)
    start = turn @ laser + pose[:2]
    for x, y, *_ in segments:
        beam = turn @ (x, y) + pose[:2] - start
        length = math.hypot(*beam)
        for k in range(math.floor(length / cell) - 1):
            i, j = np.floor((start + beam / length * k * cell - (x0, y0)) / cell + 0.5).astype(int)
            if not drawn[j, i]:
                weight[j, i] = max(weight[j, i], unknown)
                enter(j, i, -1.0, free)


def leverages(points, normals):
    """Share of each point in fixing (x, y, theta): c' H^-1 c."""
    rows = np.column_stack((normals, normals[:, 1] * points[:, 0] - normals[:, 0] * points[:, 1]))
    inverse = np.linalg.inv(rows.T @ rows)
    return np.einsum("ij,jk,ik->i", rows, inverse, rows)


def spread_out(owed):
    """Numbers of the points at which the running sum of debts passes a whole number."""
    total, taken, picked = 0.0, 0, []
    for i, debt in enumerate(owed):
        total += min(debt, 1.0)
        if math.floor(total) > taken:
            picked.append(i)
        taken = math.floor(total)
    return picked
