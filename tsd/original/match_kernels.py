"""What the published registration sums: closed form of the ICP, and the scores of RANSAC."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import njit
from slams.types import Floats, Pose2
from tsd.original.map_kernels import Grid, interpolate
from tsd.original.scan_kernels import HALF, Ints, Mask


@njit
def closed_form(model: Floats, scene: Floats) -> tuple[float, float, float]:
    """Rigid motion (x, y, theta) of least squared distance of pairs (n, 2). Original code."""
    n = model.shape[0]
    mx, my, sx, sy = 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        mx, my = mx + model[k, 0], my + model[k, 1]
        sx, sy = sx + scene[k, 0], sy + scene[k, 1]
    mx, my, sx, sy = mx / n, my / n, sx / n, sy / n
    cross, dot = 0.0, 0.0
    for k in range(n):
        ax, ay = model[k, 0] - mx, model[k, 1] - my
        bx, by = scene[k, 0] - sx, scene[k, 1] - sy
        cross += ay * bx - ax * by
        dot += ax * bx + ay * by
    theta = math.atan2(cross, dot)
    c, s = math.cos(theta), math.sin(theta)
    return mx - (c * sx - s * sy), my - (s * sx + c * sy), theta


@njit
def move(points: Floats, step: Pose2) -> None:
    """Move points (n, 2) in place. ours."""
    c, s = math.cos(step.theta), math.sin(step.theta)
    for k in range(points.shape[0]):
        px, py = points[k, 0], points[k, 1]
        points[k, 0] = step.x + c * px - s * py
        points[k, 1] = step.y + s * px + c * py


@njit(inner=True)
def score_pdf(
    grid: Grid,
    control: Floats,
    n_control: int,
    motion: Floats,
    pose: Floats,
    z_random: float,
    best: float,
) -> float:
    """Sum over the control points of log(1 - (1 - zrand) |tsd|), unknown = log zrand.

    Original code: TSD_PDFMatching. ours: stops when it can no longer win.
    """
    c, s = math.cos(motion[2]), math.sin(motion[2])
    cp, sp = math.cos(pose[2]), math.sin(pose[2])
    score = 1.0
    for k in range(n_control):
        x = motion[0] + c * control[k, 0] - s * control[k, 1]
        y = motion[1] + s * control[k, 0] + c * control[k, 1]
        v = interpolate(grid, pose[0] + cp * x - sp * y, pose[1] + sp * x + cp * y)
        score *= z_random if v != v else 1.0 - (1.0 - z_random) * abs(v)
        if score <= best:
            break
    return score


@njit(inner=True)
def make_hypothesis(
    model: Floats,
    phi_model: float,
    scene: Floats,
    phi_scene: float,
    phi_max: float,
    out_motion: Floats,
) -> bool:
    """The motion (x, y, theta) that lays a scene point with its normal on a model point.

    Original code: one pair of oriented points is a full hypothesis.
    """
    turn = phi_model - phi_scene
    turn -= 2.0 * math.pi * math.ceil((turn - math.pi) / (2.0 * math.pi))
    if not abs(turn) < phi_max:
        return False
    c, s = math.cos(turn), math.sin(turn)
    out_motion[0] = model[0] - (c * scene[0] - s * scene[1])
    out_motion[1] = model[1] - (s * scene[0] + c * scene[1])
    out_motion[2] = turn
    return True


@njit(inner=True)
def keep(motion: Floats, out_motion: Floats) -> None:
    """Copy (x, y, theta). ours: compiling a slice assignment takes seconds."""
    for i in range(3):
        out_motion[i] = motion[i]


class Scans(NamedTuple):
    """Both scans in beam order: points (n, 2), normals' directions (n,), scene points kept."""

    model: Floats
    model_phi: Floats
    scene: Floats
    scene_phi: Floats
    kept: Mask
    trials: Ints
    span: int
    phi_max: float


@njit
def ransac_tsd(
    grid: Grid, scans: Scans, control: Floats, pose: Floats, z_random: float, out_motion: Floats
) -> float:
    """Best of all hypotheses by the field's own score; mode "tsd". Original code."""
    motion = out_motion.copy()
    best = 0.0
    for m in scans.trials:
        for i in range(max(m - scans.span, HALF), min(m + scans.span, scans.kept.shape[0] - HALF)):
            if scans.kept[i] and make_hypothesis(
                scans.model[m],
                scans.model_phi[m],
                scans.scene[i],
                scans.scene_phi[i],
                scans.phi_max,
                motion,
            ):
                score = score_pdf(grid, control, len(control), motion, pose, z_random, best)
                if score > best:
                    best = score
                    keep(motion, out_motion)
    return best
