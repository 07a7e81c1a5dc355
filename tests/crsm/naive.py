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


def insert(walls, points, normals, pose, grid, rules):
    """End points of one scan, one by one, join the wall elements of a dict or begin new ones."""
    cell, corner = grid
    near, compat, most = rules
    c, s = math.cos(pose[2]), math.sin(pose[2])
    rotation = np.array([[c, -s], [s, c]])
    for p, n in zip(points, normals, strict=True):
        at, normal = rotation @ p + pose[:2], rotation @ n
        ix, iy = np.floor((at - corner) / cell).astype(int).tolist()
        around = [(x, y) for y in range(iy - 1, iy + 2) for x in range(ix - 1, ix + 2)]
        of = [(_away(walls[k], at), k) for k in around if k in walls]
        of = [(d, k) for d, k in of if d < near and _alike(walls[k], normal, compat)]
        key = min(of)[1] if of else (ix, iy)
        is_lone = key in walls and not walls[key]["normal"].any()
        if key not in walls or (is_lone and normal.any()):
            walls[key] = {"mean": at, "normal": normal, "weight": 0}
        w = walls[key]
        if not (_alike(w, normal, compat) and _away(w, at) < near):
            continue
        w["weight"] = min(w["weight"] + 1, most)
        w["mean"] = w["mean"] + (at - w["mean"]) / w["weight"]
        w["normal"] = w["normal"] + (normal - w["normal"]) / w["weight"]
        w["normal"] = w["normal"] / (math.hypot(*w["normal"]) or 1.0)


def _away(wall, at):
    return math.hypot(*(at - wall["mean"]))


def _alike(wall, normal, compat):
    """Both are walls of like direction, or lone."""
    if not normal.any():
        return not wall["normal"].any()
    return wall["normal"] @ normal > compat


def draw_grey(grey, points, pose, grid, steps):
    """Grey levels after one drawing: dict of the cells that change."""
    step, corner = grid
    white, black = steps

    def shade(v, by):
        gain = 1.0 - math.sqrt(abs(v)) if v * by > 0 else 1.0
        return max(-1.0, min(1.0, v + gain * by))

    def cell_of(at):
        return tuple(np.floor((at - corner) / step).astype(int).tolist())

    c, s = math.cos(pose[2]), math.sin(pose[2])
    start = np.array(pose[:2])
    ends = [start + np.array([c * p[0] - s * p[1], s * p[0] + c * p[1]]) for p in points]
    values = {key: shade(float(grey[key[1], key[0]]), black) for key in map(cell_of, ends)}
    for end in ends:
        length = math.hypot(*(end - start))
        for j in range(math.floor(length / step) - 1):
            key = cell_of(start + (end - start) / length * step * j)
            if key not in values:
                values[key] = shade(float(grey[key[1], key[0]]), white)
    return values


def leverages(points, normals, variances, lone_variance):
    """Share of each point in fixing (x, y, theta): trace of w J' J H^-1."""
    blocks = []
    for p, n, v in zip(points, normals, variances, strict=True):
        rows, variance = (n[None], v) if n.any() else (np.eye(2), lone_variance)
        jacobian = np.column_stack((rows, rows @ np.array([-p[1], p[0]])))
        blocks.append(jacobian.T @ jacobian / variance)
    inverse = np.linalg.inv(sum(blocks))
    return np.array([np.trace(b @ inverse) for b in blocks])


def spread_out(owed):
    """Numbers of the points at which the running sum of debts passes a whole number."""
    total, taken, picked = 0.0, 0, []
    for i, debt in enumerate(owed):
        total += min(debt, 1.0)
        if math.floor(total) > taken:
            picked.append(i)
        taken = math.floor(total)
    return picked
