"""PoseGraph: keyframes, the steps between them, loops, and the poses that fit both best.

[Olson08] E. Olson: Robust and Efficient Robotic Mapping. PhD thesis, MIT 2008. [Grisetti10] G.
Grisetti, R. Kuemmerle, C. Stachniss, W. Burgard: A Tutorial on Graph-Based SLAM. IEEE ITS Magazine
2(4), 2010.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import splu

from slams.loops.graph_kernels import propagate
from slams.types import Floats, Pose2, wrap_angle

LEVER = 10.0  # m a radian counts for, where the surest path is looked for
ROOT_INFORMATION = 1e12  # holds the first keyframe where it is
Indices = NDArray[np.int64]


class LoopEdge(NamedTuple):
    """The pose of keyframe `later` in the frame of `earlier`, with its information (3, 3)."""

    earlier: int
    later: int
    pose: Pose2
    information: Floats = np.zeros((3, 3))


class PoseGraph:
    """Keyframes in a chain of steps, and loops between them.

    `poses` (n, 3) x, y [m], theta [rad] in the map; `path` (n,) [m] driven so far.
    """

    def __init__(self) -> None:
        self.n = 0
        self.loops: list[LoopEdge] = []
        self._poses, self._path = np.zeros((64, 3)), np.zeros(64)
        self._steps, self._variances = np.zeros((64, 3)), np.ones((64, 3))

    @property
    def poses(self) -> Floats:
        """Of all keyframes (n, 3), to be read only."""
        return self._poses[: self.n]

    @property
    def path(self) -> Floats:
        """Path driven up to each keyframe (n,) [m]."""
        return self._path[: self.n]

    def pose(self, k: int) -> Pose2:
        """Of one keyframe."""
        return Pose2(*self._poses[k].tolist())

    def append(self, step: Pose2, variances: Floats) -> None:
        """A keyframe one step behind the last, in whose frame the variances (3,) are.

        The first keyframe is at `step`.
        """
        k = self.n
        if k == len(self._poses):
            for name in ("_poses", "_path", "_steps", "_variances"):
                old = getattr(self, name)
                setattr(self, name, np.concatenate([old, np.ones_like(old)]))
        self._poses[k] = self.pose(k - 1) @ step if k else step
        self._path[k] = self._path[k - 1] + math.hypot(step.x, step.y) if k else 0.0
        self._steps[k], self._variances[k] = step, variances
        self.n = k + 1

    def step(self, earlier: int, later: int) -> Pose2:
        """The pose of one keyframe in the frame of another."""
        return self.pose(earlier).between(self.pose(later))

    def uncertainty(self, root: int) -> Floats:
        """Covariance (n, 3, 3) of all poses relative to that of `root`.

        In the map's axes, along the surest path through steps and loops [Olson08].
        """
        n, steps = self.n, self.n - 1
        ends, noise = self._edges()
        cost = noise[:, 0, 0] + noise[:, 1, 1] + LEVER**2 * noise[:, 2, 2]
        links = csr_array((cost, (ends[:, 0], ends[:, 1])), shape=(n, n))
        distance, parents = dijkstra(
            links, directed=False, indices=np.array(root), return_predecessors=True
        )
        order = np.argsort(distance, kind="stable")[1:]
        edges = np.maximum(np.maximum(np.arange(n), parents) - 1, 0)  # of a step
        known = {tuple(pair): steps + k for k, pair in enumerate(ends[steps:].tolist())}
        for child in np.flatnonzero(np.abs(parents - np.arange(n)) > 1).tolist():
            if child != root:
                edges[child] = known[min(child, parents[child]), max(child, parents[child])]
        out = np.zeros((n, 3, 3))
        propagate(self.poses, order, parents, edges, noise, out)
        return out

    def _edges(self) -> tuple[Indices, Floats]:
        """Both ends (m, 2) and covariances (m, 3, 3) in the map's axes: steps, then loops."""
        k = np.arange(self.n - 1)
        ends = np.array([(edge.earlier, edge.later) for edge in self.loops], np.int64)
        ends = np.concatenate([np.stack([k, k + 1], axis=1), ends.reshape(-1, 2)])
        noise = np.zeros((len(ends), 3, 3))
        noise[: len(k), range(3), range(3)] = self._variances[1 : self.n]
        if self.loops:
            noise[len(k) :] = np.linalg.inv(np.array([edge.information for edge in self.loops]))
        c, s = np.cos(self.poses[ends[:, 0], 2]), np.sin(self.poses[ends[:, 0], 2])
        R = np.zeros_like(noise)
        R[:, 0, 0], R[:, 0, 1], R[:, 1, 0], R[:, 1, 1], R[:, 2, 2] = c, -s, s, c, 1.0
        return ends, R @ noise @ R.transpose(0, 2, 1)

    def iterate(self) -> float:
        """One Gauss-Newton iteration on all steps and loops; the largest move [m, rad].

        [Grisetti10] sec. III with residuals in the frame of the earlier keyframe: the difference of
        positions, and of headings.
        """
        n, poses = self.n, self.poses
        k = np.arange(n - 1)
        i = np.concatenate([k, [edge.earlier for edge in self.loops]]).astype(np.int64)
        j = np.concatenate([k + 1, [edge.later for edge in self.loops]]).astype(np.int64)
        measured = np.concatenate(
            [self._steps[1:n], np.array([e.pose for e in self.loops]).reshape(-1, 3)]
        )
        W = np.zeros((len(i), 3, 3))
        W[: n - 1, range(3), range(3)] = 1.0 / self._variances[1:n]
        if self.loops:
            W[n - 1 :] = [edge.information for edge in self.loops]
        r, A, B = _linearized(poses[i], poses[j], measured)
        AW, BW = A.transpose(0, 2, 1) @ W, B.transpose(0, 2, 1) @ W
        blocks = (i, i, AW @ A), (i, j, AW @ B), (j, i, BW @ A), (j, j, BW @ B)
        H = _assembled(blocks, n)
        b = np.zeros((n, 3))
        np.add.at(b, i, -(AW @ r[:, :, None])[:, :, 0])
        np.add.at(b, j, -(BW @ r[:, :, None])[:, :, 0])
        solver = splu(
            H, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
        move = solver.solve(b.ravel()).reshape(n, 3)
        poses += move
        poses[:, 2] = wrap_angle(poses[:, 2])
        return float(np.abs(move).max())


def _linearized(a: Floats, b: Floats, measured: Floats) -> tuple[Floats, Floats, Floats]:
    """Residuals (m, 3) of edges from poses a to b (m, 3), and their derivatives (m, 3, 3)."""
    m = len(a)
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    dx, dy = b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]
    x, y = c * dx + s * dy, c * dy - s * dx
    r = np.stack([x, y, b[:, 2] - a[:, 2]], axis=1) - measured
    r[:, 2] = wrap_angle(r[:, 2])
    A, B = np.zeros((m, 3, 3)), np.zeros((m, 3, 3))
    B[:, 0, 0] = B[:, 1, 1] = c
    B[:, 0, 1], B[:, 1, 0] = s, -s
    B[:, 2, 2] = 1.0
    A[:, :, :2] = -B[:, :, :2]
    A[:, 0, 2], A[:, 1, 2], A[:, 2, 2] = y, -x, -1.0
    return r, A, B


def _assembled(blocks: Sequence[tuple[Indices, Indices, Floats]], n: int) -> csc_array:
    """The sparse matrix (3 n, 3 n) of blocks (rows, columns, (m, 3, 3)), the first pose held."""
    three = np.arange(3)
    rows = np.concatenate(
        [np.repeat(3 * i[:, None] + three, 3, axis=1).ravel() for i, _, _ in blocks]
    )
    columns = np.concatenate([np.tile(3 * j[:, None] + three, 3).ravel() for _, j, _ in blocks])
    values = np.concatenate([block.ravel() for _, _, block in blocks])
    held = np.arange(3)
    rows, columns = np.concatenate([rows, held]), np.concatenate([columns, held])
    values = np.concatenate([values, np.full(3, ROOT_INFORMATION)])
    return coo_array((values, (rows, columns)), shape=(3 * n, 3 * n)).tocsc()
