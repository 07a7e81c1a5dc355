"""Kernels of the published registration: closed form of ICP, hypotheses and scores of RANSAC."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import njit
from slams.types import Floats, Pose2
from tsd.original.map_kernels import Grid, interpolate
from tsd.original.scan_kernels import NORMAL_HALF_WINDOW, Ints, Mask


@njit
def closed_form(model: Floats, scene: Floats) -> tuple[float, float, float]:
    """Least squares rigid motion (x, y, theta) of scene to model (n, 2). Original code."""
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
    """Product over the control points of 1 - (1 - zrand) |tsd|; zrand in unknown cells.

    Original code: TSD_PDFMatching. ours: stops when it can no longer exceed `best`.
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
    """Motion (x, y, theta) that aligns a scene point and its normal with a model point.

    Original code: one pair of oriented points is a full hypothesis.
    """
    rotation = phi_model - phi_scene
    rotation -= 2.0 * math.pi * math.ceil((rotation - math.pi) / (2.0 * math.pi))
    if not abs(rotation) < phi_max:
        return False
    c, s = math.cos(rotation), math.sin(rotation)
    out_motion[0] = model[0] - (c * scene[0] - s * scene[1])
    out_motion[1] = model[1] - (s * scene[0] + c * scene[1])
    out_motion[2] = rotation
    return True


@njit(inner=True)
def copy_motion(motion: Floats, out_motion: Floats) -> None:
    """Copy (x, y, theta). ours: a slice assignment takes seconds to compile."""
    for i in range(3):
        out_motion[i] = motion[i]


class Scans(NamedTuple):
    """Points (n, 2) [m] and directions of normals (n,) [rad] of model and scene, in beam order.

    Pairs are of `kept` scene and `trials` model points, at most `span` beams, `phi_max` rad apart.
    """

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
    """Best hypothesis by the score in the field, mode "tsd"; returns its score. Original code."""
    motion = out_motion.copy()
    first, end, best = NORMAL_HALF_WINDOW, scans.kept.shape[0] - NORMAL_HALF_WINDOW, 0.0
    for m in scans.trials:
        for i in range(max(m - scans.span, first), min(m + scans.span, end)):
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
                    copy_motion(motion, out_motion)
    return best
