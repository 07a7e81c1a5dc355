"""Direct alignment of surface elements with the directional field: Gauss-Newton."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.geometry import add_prior, solve3, wrap_angle
from slams.jit import FAST, njit
from slams.types import Floats, Pose2
from tsd.map_kernels import PASSED, Field, facing, read_field, seen_at
from tsd.scan_kernels import Beams

FLAT = 0.3  # least slope of the field for a direction of its own
ALIKE = 0.85  # cosine between that and an element's normal, below which values of two lines meet
SPARSE = 10.0  # cells between hits along a wall, beyond which the map has gaps there
SETTLED = 0.1  # of the robust scale: after a longer step it stays for another
ANNEAL = 2.0  # the robust scale follows the residual down, in residuals


class MatchRule(NamedTuple):
    """Iterations, steps [m, rad] below which to stop, robust scale [m], map's own error [m]."""

    iterations: int
    stop_translation: float
    stop_rotation: float
    robust: float
    map_noise: float


@njit(inner=True)
def accumulate(
    field: Field,
    surfaces: Floats,
    count: int,
    pose: Floats,
    rule: MatchRule,
    robust: float,
    out_H: Floats,
    out_b: Floats,
) -> tuple[float, float, float]:
    """Normal equations of sum w rho(sd(T p)), the sum over all elements that the field knows.

    ours: A1, residual = field value [m], Jacobian = the field's own direction: an element's normal
    is noisy, and noise that points along a corridor holds the pose there. So does the field's own
    where values of two lines meet: an element whose normal is told by its hits, and not alike, says
    nothing. Returns how many elements are known, how many close (robustly), and the rms of the
    known residuals [m].
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    known, close, squares = 0.0, 0.0, 0.0
    scale = 1.0 / (robust * robust)
    final_scale = 1.0 / (rule.robust * rule.robust)
    xx, xy, yy, xt, yt, tt, bx, by, bt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    floor = rule.map_noise * rule.map_noise
    for k in range(count):
        rx = c * surfaces[k, 0] - s * surfaces[k, 1]
        ry = s * surfaces[k, 0] + c * surfaces[k, 1]
        nx = c * surfaces[k, 2] - s * surfaces[k, 3]
        ny = s * surfaces[k, 2] + c * surfaces[k, 3]
        v, gx, gy = read_field(field, facing(nx, ny), pose[0] + rx, pose[1] + ry)
        if v != v:
            continue
        slope = math.sqrt(gx * gx + gy * gy)
        alike = True
        if slope > FLAT:
            alike = surfaces[k, 7] == 0.0 or nx * gx + ny * gy > ALIKE * slope
            nx, ny = gx / slope, gy / slope
        w = 1.0 / (1.0 / surfaces[k, 4] + floor)
        trust = 1.0 / (1.0 + v * v * scale)
        known += 1.0
        squares += v * v
        close += 1.0 / (1.0 + v * v * final_scale)
        if not alike:
            continue
        w *= trust * trust
        nt = ny * rx - nx * ry
        xx, xy, yy = xx + w * nx * nx, xy + w * nx * ny, yy + w * ny * ny
        xt, yt, tt = xt + w * nx * nt, yt + w * ny * nt, tt + w * nt * nt
        bx, by, bt = bx - w * nx * v, by - w * ny * v, bt - w * nt * v
    out_H[0, 0], out_H[1, 0], out_H[1, 1] = xx, xy, yy
    out_H[2, 0], out_H[2, 1], out_H[2, 2] = xt, yt, tt
    out_H[0, 1], out_H[0, 2], out_H[1, 2] = xy, xt, yt
    out_b[0], out_b[1], out_b[2] = bx, by, bt
    return known, close, math.sqrt(squares / max(known, 1.0))


@njit
def align(
    field: Field,
    surfaces: Floats,
    count: int,
    mean: Floats,
    prior: Floats,
    rule: MatchRule,
    out_pose: Floats,
    out_H: Floats,
) -> tuple[float, float, float, int]:
    """Gauss-Newton from out_pose (3,), which it moves.

    ours: A1, A3. Returns known, close and residual as `accumulate`, and the iterations.
    prior (3, 3): information [1/m2, 1/(m rad), 1/rad2] of a pose `mean` (3,) known beforehand,
    which holds the directions that the scan does not see; out_H is left without it.
    """
    b, dx = out_H[3], out_H[4]
    known, close, residual = 0.0, 0.0, 0.0
    used = 0
    total = np.empty((3, 3))
    robust = 3.0 * rule.robust
    for _ in range(rule.iterations):
        known, close, residual = accumulate(
            field, surfaces, count, out_pose, rule, robust, out_H, b
        )
        tighter = min(max(ANNEAL * residual, rule.robust), robust)
        turn = wrap_angle(mean[2] - out_pose[2])
        off = Pose2(mean[0] - out_pose[0], mean[1] - out_pose[1], turn)
        add_prior(out_H, prior, 1.0, off, total, b)
        used += 1
        if not solve3(total, b, dx):
            break
        out_pose[0] += dx[0]
        out_pose[1] += dx[1]
        out_pose[2] += dx[2]
        small = dx[0] * dx[0] + dx[1] * dx[1] < rule.stop_translation * rule.stop_translation
        if small and abs(dx[2]) < rule.stop_rotation and tighter > 0.9 * robust:
            break
        if dx[0] * dx[0] + dx[1] * dx[1] < SETTLED * SETTLED * robust * robust:
            robust = tighter
    return known, close, residual, used


@njit
def explain(
    field: Field, surfaces: Floats, count: int, pose: Floats, robust: float
) -> tuple[float, float, float, float]:
    """What the field makes of a scan at a pose: elements known, close, against, and their rms.

    ours: evidence. Known have a distance there, close count by how near zero it is (robust [m]);
    against are those that stand where beams passed and no surface ever was.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    known, close, against, squares = 0.0, 0.0, 0.0, 0.0
    scale = 1.0 / (robust * robust)
    for k in range(count):
        nx = c * surfaces[k, 2] - s * surfaces[k, 3]
        ny = s * surfaces[k, 2] + c * surfaces[k, 3]
        x = pose[0] + c * surfaces[k, 0] - s * surfaces[k, 1]
        y = pose[1] + s * surfaces[k, 0] + c * surfaces[k, 1]
        v, _, _ = read_field(field, facing(nx, ny), x, y)
        if v == v:
            known += 1.0
            squares += v * v
            close += 1.0 / (1.0 + v * v * scale)
        elif seen_at(field, x, y) == PASSED:
            against += 1.0
    return known, close, against, math.sqrt(squares / max(known, 1.0))


@njit(fastmath=FAST, inner=True)
def agreement(field: Field, layer: int, x: float, y: float, scale: float) -> float:
    """How well an element at (x, y) agrees, 0 to 1; -1 where nothing was ever seen. ours.

    Where beams passed and there is no surface it disagrees; scale [1/m2].
    """
    v, _, _ = read_field(field, layer, x, y)
    if v == v:
        return 1.0 / (1.0 + v * v * scale)
    return 0.0 if seen_at(field, x, y) else -1.0


@njit
def leads_along(
    field: Field,
    surfaces: Floats,
    count: int,
    beams: Beams,
    pose: Floats,
    offsets: Floats,
    rule: MatchRule,
    out: Floats,
) -> tuple[float, float]:
    """How much better a scan agrees with the field at a pose moved by offsets (n, 2) [m]. ours.

    out (n, 2): the sum over the elements of what each agrees more there than at the pose, and of
    the squares of that. Where nothing was ever seen an element says nothing. Hits so sparse that
    the map has gaps between them are left out: gaps move with the robot. Returns how many elements
    lie where beams were before, at the pose itself, and how many of those agree.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    scale = 1.0 / (rule.robust * rule.robust)
    seen, agree = 0.0, 0.0
    for i in range(offsets.shape[0]):
        out[i, 0], out[i, 1] = 0.0, 0.0
    for k in range(count):
        rx, ry = beams.mount_x - surfaces[k, 0], beams.mount_y - surfaces[k, 1]
        facing_it = rx * surfaces[k, 2] + ry * surfaces[k, 3]
        if (rx * rx + ry * ry) * abs(beams.angle_increment) > SPARSE * field.cell * facing_it:
            continue
        nx = c * surfaces[k, 2] - s * surfaces[k, 3]
        ny = s * surfaces[k, 2] + c * surfaces[k, 3]
        layer = facing(nx, ny)
        x0 = pose[0] + c * surfaces[k, 0] - s * surfaces[k, 1]
        y0 = pose[1] + s * surfaces[k, 0] + c * surfaces[k, 1]
        here = agreement(field, layer, x0, y0, scale)
        if here < 0.0:
            continue
        seen, agree = seen + 1.0, agree + here
        for i in range(offsets.shape[0]):
            there = agreement(field, layer, x0 + offsets[i, 0], y0 + offsets[i, 1], scale)
            if there >= 0.0:
                out[i, 0] += there - here
                out[i, 1] += (there - here) * (there - here)
    return seen, agree
