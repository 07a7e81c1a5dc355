"""PoseGraph: poses of keyframes, optimized over the steps between them and over loop closures.

[Olson08] E. Olson: Robust and Efficient Robotic Mapping. PhD thesis, MIT 2008. [Grisetti10] G.
Grisetti, R. Kuemmerle, C. Stachniss, W. Burgard: A Tutorial on Graph-Based SLAM. IEEE ITS Magazine
2(4), 2010.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import splu

from slams.loops.graph_kernels import propagate
from slams.types import Floats, Pose2, wrap_angle

HEADING_LEVER_ARM = 10.0  # m: a heading error counts as the position error at this distance


def position_distance(one: Pose2, other: Pose2) -> float:
    """Distance between two positions [m]."""
    return math.hypot(one.x - other.x, one.y - other.y)


def pose_distance(one: Pose2, other: Pose2) -> float:
    """Distance between two positions plus that of their headings at the lever arm [m]."""
    rotation = abs(wrap_angle(one.theta - other.theta))
    return position_distance(one, other) + HEADING_LEVER_ARM * rotation


# of m loops: indices of keyframes (m, 2), poses (m, 3), information and covariances (m, 3, 3)
Stacked = tuple[NDArray[np.int64], Floats, Floats, Floats]


class LoopEdge(NamedTuple):
    """The pose of keyframe `later` in the frame of `earlier`, with its information (3, 3)."""

    earlier: int
    later: int
    pose: Pose2
    information: Floats = np.zeros((3, 3))


class PoseGraph:
    """A chain of keyframes, with a step between each two neighbors and loop edges.

    `poses` (n, 3) x, y [m], theta [rad] in the map frame; `path` (n,) path length [m] up to each.
    Edges may be appended to the list `loops`; the next `iterate` uses them.
    """

    def __init__(self) -> None:
        self.poses, self.path = np.zeros((0, 3)), np.zeros(0)
        self.loops: list[LoopEdge] = []
        self._steps, self._variances = np.zeros((0, 3)), np.zeros((0, 3))
        self._stacked = self._stack()

    @property
    def n(self) -> int:
        """Number of keyframes."""
        return len(self.poses)

    def pose(self, k: int) -> Pose2:
        """The pose of keyframe `k` in the map frame."""
        return Pose2(*self.poses[k].tolist())

    def append(self, step: Pose2, variances: Floats) -> None:
        """Add a keyframe at `step` [m, rad] from the last one; the first keyframe is at `step`.

        `variances` (3,) [m^2, rad^2] of the step, in the frame of the last keyframe.
        """
        pose, path = step, 0.0
        if self.n:
            pose, path = self.pose(-1) @ step, self.path[-1] + math.hypot(step.x, step.y)
        self.poses, self.path = np.vstack([self.poses, pose]), np.append(self.path, path)
        self._steps = np.vstack([self._steps, step])
        self._variances = np.vstack([self._variances, variances])

    def step(self, earlier: int, later: int) -> Pose2:
        """The pose of one keyframe in the frame of another."""
        return self.pose(earlier).between(self.pose(later))

    def uncertainty(self, root: int) -> Floats:
        """Covariance (n, 3, 3) of all poses relative to keyframe `root`, in the map's axes.

        Each covariance is summed along the path of least variance through steps and loops, the
        "Dijkstra projection" of [Olson08].
        """
        n, (loops, _, _, noise) = self.n, self._stacked_loops()
        k, variances = np.arange(n - 1), self._variances[1:]
        pairs, first = np.unique(loops @ (n, 1), return_index=True)  # csr_array adds equal edges
        loops, noise = loops[first], noise[first]
        weights = np.array((1.0, 1.0, HEADING_LEVER_ARM**2))
        costs = variances @ weights, np.diagonal(noise, axis1=1, axis2=2) @ weights
        rows, columns = np.append(k, loops[:, 0]), np.append(k + 1, loops[:, 1])
        edges = csr_array((np.concatenate(costs), (rows, columns)), shape=(n, n))
        distance, parents = dijkstra(
            edges, directed=False, indices=np.array(root), return_predecessors=True
        )
        order = np.argsort(distance, kind="stable")[1:]
        parents = parents[order]
        earlier, later = np.minimum(order, parents), np.maximum(order, parents)
        added = np.zeros((n - 1, 3, 3))  # covariance of the edge from the parent
        added[:, range(3), range(3)] = self._variances[later]
        is_loop = later - earlier > 1
        added[is_loop] = noise[np.searchsorted(pairs, (earlier * n + later)[is_loop])]
        out = np.zeros((n, 3, 3))
        propagate(self.poses, order, parents, added, out)
        return out

    def iterate(self) -> float:
        """One Gauss-Newton iteration on all steps and loops; returns the largest change [m, rad].

        [Grisetti10] sec. III. A residual is the difference of position and heading, in the frame
        of the earlier keyframe.
        """
        n, poses, (loops, loop_poses, information, _) = self.n, self.poses, self._stacked_loops()
        k = np.arange(n - 1)
        i, j = np.append(k, loops[:, 0]), np.append(k + 1, loops[:, 1])
        measured = np.concatenate([self._steps[1:], loop_poses])
        W = np.zeros((len(i), 3, 3))
        W[: n - 1, range(3), range(3)] = 1.0 / self._variances[1:]
        W[n - 1 :] = information
        r, A, B = _linearized(poses[i], poses[j], measured)
        m = len(i)
        blocks = np.stack([i, j], axis=1).ravel(), np.arange(0, 2 * m + 1, 2)
        J, WJ = (
            bsr_array((np.stack(both, axis=1).reshape(-1, 3, 3), *blocks), shape=(3 * m, 3 * n))
            for both in ((A, B), (W @ A, W @ B))
        )
        H = (J.T @ WJ).tocsc()
        H[range(3), range(3)] += 1e12  # the first keyframe fixes the map frame
        # the blocks are small: to factor one column at a time takes half the time of wider panels
        solver = splu(
            H,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            relax=1,
            panel_size=1,
            options={"SymmetricMode": True},
        )
        change = solver.solve(-(WJ.T @ r.ravel())).reshape(n, 3)
        poses += change
        poses[:, 2] = wrap_angle(poses[:, 2])
        return float(np.abs(change).max())

    def _stacked_loops(self) -> Stacked:
        """All loops as arrays; they are stacked anew after a loop was added."""
        if len(self._stacked[0]) != len(self.loops):
            self._stacked = self._stack()
        return self._stacked

    def _stack(self) -> Stacked:
        keyframes = [(edge.earlier, edge.later) for edge in self.loops]
        poses = np.array([edge.pose for edge in self.loops], np.float64)
        information = np.array([edge.information for edge in self.loops]).reshape(-1, 3, 3)
        indices = np.array(keyframes, np.int64).reshape(-1, 2)
        return indices, poses.reshape(-1, 3), information, np.asarray(np.linalg.inv(information))


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
