"""Pre-registration by random pairs of oriented points: hypotheses and their three scores."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import njit
from slams.types import Floats
from tsd.original.map_kernels import Grid, interpolate
from tsd.original.match_kernels import Buckets, nearest
from tsd.original.scan_kernels import HALF, Ints, Mask


class BeamModel(NamedTuple):
    """Weights and widths of the beam model of mode "pdf", and limits of all modes."""

    hit: float
    short: float
    beyond: float
    random: float
    sigma: float
    decay: float
    range_max: float
    max_angle: float
    share: float
    hit_distance: float


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

    Original code: TSD_PDFMatching. Stops when it can no longer win (S5).
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
def score_beams(
    model_range: Floats,
    angles: Floats,
    control: Floats,
    n_control: int,
    motion: Floats,
    beam_model: BeamModel,
) -> float:
    """Product of beam probabilities. Original code: PDFMatching.

    model_range (n,) holds, for every beam, range and angle error of the closest model beam:
    model_range (n, 2); angles (2,): of the first beam and between beams.
    """
    c, s = math.cos(motion[2]), math.sin(motion[2])
    peak = beam_model.hit / (math.sqrt(2.0 * math.pi) * beam_model.sigma)
    score, near = 1.0, 0
    n = model_range.shape[0]
    for k in range(n_control):
        x = motion[0] + c * control[k, 0] - s * control[k, 1]
        y = motion[1] + s * control[k, 0] + c * control[k, 1]
        r = math.sqrt(x * x + y * y)
        beam = math.floor((math.atan2(y, x) - angles[0]) / angles[1] + 0.5)
        j = int(min(max(beam, 0.0), n - 1.0))
        m, error = model_range[j, 0], model_range[j, 1] + abs(beam - j) * abs(angles[1])
        near += error < beam_model.max_angle
        p = beam_model.beyond
        if r < beam_model.range_max:
            e = (m - r) / beam_model.sigma
            p = peak * math.exp(-0.5 * e * e) + beam_model.random / beam_model.range_max
        if r < m:
            decay = beam_model.decay
            p += beam_model.short * decay * math.exp(-decay * r) / (1.0 - math.exp(-decay * m))
        score *= p
    return score if near > beam_model.share * n_control else 0.0


@njit(inner=True)
def score_normals(
    buckets: Buckets,
    model_phi: Floats,
    control: Floats,
    n_control: int,
    motion: Floats,
    frustum: Floats,
    hit_distance: float,
) -> tuple[int, float, float]:
    """Hits, share of hits in the field of view and error. Original code: RandomNormalMatching."""
    c, s = math.cos(motion[2]), math.sin(motion[2])
    hits, seen, error = 0, 0, 0.0
    for k in range(n_control):
        x = motion[0] + c * control[k, 0] - s * control[k, 1]
        y = motion[1] + s * control[k, 0] + c * control[k, 1]
        theta = math.atan2(y, x)
        if theta < frustum[0] or theta > frustum[1]:
            continue
        seen += 1
        m, d2, _ = nearest(buckets, x, y, hit_distance, -1)
        e = 1.33
        if m >= 0:
            turn = math.cos(model_phi[m] - control[k, 2] - motion[2])
            e = d2 / (hit_distance * hit_distance)
            if turn == turn:
                e += 0.165 * (1.0 - turn)
        error += e
        hits += e < 1.0
    return hits, hits / max(seen, 1), error


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


@njit
def ransac_pdf(
    model_range: Floats,
    angles: Floats,
    scans: Scans,
    control: Floats,
    beam_model: BeamModel,
    out_motion: Floats,
) -> float:
    """Best of all hypotheses by the beam model; mode "pdf". Original code."""
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
                score = score_beams(model_range, angles, control, len(control), motion, beam_model)
                if score > best:
                    best = score
                    keep(motion, out_motion)
    return best


@njit
def ransac_exp(
    buckets: Buckets,
    phi: Floats,
    frustum: Floats,
    scans: Scans,
    control: Floats,
    hit_distance: float,
    out_motion: Floats,
) -> float:
    """Best of all hypotheses by nearest points and normals; mode "exp". Original code."""
    motion = out_motion.copy()
    best, best_hits, best_error = 0.0, 0, math.inf
    for m in scans.trials:
        for i in range(max(m - scans.span, HALF), min(m + scans.span, scans.kept.shape[0] - HALF)):
            if not (
                scans.kept[i]
                and make_hypothesis(
                    scans.model[m],
                    scans.model_phi[m],
                    scans.scene[i],
                    scans.scene_phi[i],
                    scans.phi_max,
                    motion,
                )
            ):
                continue
            hits, ratio, error = score_normals(
                buckets, phi, control, len(control), motion, frustum, hit_distance
            )
            if hits <= len(control) // 3:
                continue
            better = ratio - best > 1e-5 and hits > best_hits
            similar = ratio < best + 1e-5 and hits == best_hits and error < best_error
            if better or similar:
                best, best_hits, best_error = ratio, hits, error
                keep(motion, out_motion)
    return best


@njit
def closest_beams(points: Floats, mask: Mask, increment: float, out: Floats) -> None:
    """For every beam the range of the closest valid model beam and the angle to it. ours: S5.

    out (n, 2) [m, rad]; replaces the linear search of the original code.
    """
    n = mask.shape[0]
    for direction in range(2):
        last = -1
        for step in range(n):
            i = step if direction == 0 else n - 1 - step
            if mask[i]:
                last = i
            gap = math.inf if last < 0 else abs(i - last) * abs(increment)
            if direction == 0 or gap < out[i, 1]:
                out[i, 1] = gap
                out[i, 0] = math.hypot(points[last, 0], points[last, 1]) if last >= 0 else math.inf
