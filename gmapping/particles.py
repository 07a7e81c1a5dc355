"""Particles: poses, weights and the tree of their histories."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats, Pose2, wrap_angle


class Proposals(NamedTuple):
    """The Gaussians that particles are drawn from, and the factors of their weights.

    Peaks (n, 3), lower triangles L (n, 3, 3) of the information L L^T, log weights (n,), and
    whether each particle has moved to a loop closure candidate (n,).
    """

    peaks: Floats
    factors: Floats
    log_w: Floats
    closes_loop: NDArray[np.bool_]


def normalize(log_w: Floats, temper: float) -> tuple[Floats, float]:
    """Weights that sum to 1, from log weights divided by `temper`, and n_eff = 1 / sum w^2."""
    w = np.exp((log_w - log_w.max()) / temper)
    w /= w.sum()
    return w, 1.0 / float(np.sum(w * w))


def systematic(w: Floats, u: float) -> NDArray[np.int64]:
    """Ancestors by systematic resampling with one draw u in [0, 1): N w offspring on average."""
    arrows = (u + np.arange(len(w))) / len(w)
    ancestors = np.searchsorted(np.cumsum(w), arrows, side="right")
    last = np.flatnonzero(w)[-1]  # rounding may leave the sum below 1
    return np.asarray(np.minimum(ancestors, last), np.int64)


def survivors_in_place(ancestors: NDArray[np.int64]) -> NDArray[np.int64]:
    """Reorder ancestors so that every particle with offspring is its own ancestor."""
    n = len(ancestors)
    children = np.bincount(ancestors, minlength=n)
    out = np.arange(n)
    out[children == 0] = np.repeat(out, np.maximum(children - 1, 0))
    return out


class Particles:
    """Robot poses (n, 3) with log weights, each at the end of a history of its own.

    `log_w` sums log weights since the last resampling, `lifetime` since the start. `output` is the
    index of the particle whose pose and map are the result. The histories form one tree, whose
    nodes point to their parents. ours: if `keep_output`, resampling never drops that particle.
    """

    def __init__(self, n: int, keep_output: bool = False) -> None:
        self._keep_output = keep_output
        self.poses = np.zeros((n, 3))
        self.log_w = np.zeros(n)
        self.lifetime = np.zeros(n)
        self.w = np.full(n, 1.0 / n)
        self.n_eff = float(n)
        self.output = 0
        self._leaves = np.full(n, -1, np.int64)
        self._parents: list[NDArray[np.int64]] = []
        self._nodes: list[Floats] = []

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def output_pose(self) -> Pose2:
        """Pose of the output particle."""
        x, y, theta = self.poses[self.output].tolist()
        return Pose2(x, y, float(wrap_angle(theta)))

    def move(self, steps: Floats) -> None:
        """Compose every pose with a step of its own, (n, 3), or with one for all, (3,)."""
        steps = np.broadcast_to(steps, self.poses.shape)
        c, s = np.cos(self.poses[:, 2]), np.sin(self.poses[:, 2])
        self.poses[:, 0] += c * steps[:, 0] - s * steps[:, 1]
        self.poses[:, 1] += s * steps[:, 0] + c * steps[:, 1]
        self.poses[:, 2] += steps[:, 2]

    def spread(self) -> Floats:
        """Covariance (3, 3) of the poses around that of the output particle [m, rad]."""
        offsets = self.poses - self.poses[self.output]
        offsets[:, 2] = wrap_angle(offsets[:, 2])
        covariance: Floats = offsets.T @ offsets / len(offsets)
        return covariance

    def weigh(self, log_w: Floats, temper: float) -> None:
        """Multiply the weights by the likelihood of a scan, given as logarithms (n,)."""
        self.log_w += log_w
        self.lifetime += log_w - log_w.max()
        self.w, self.n_eff = normalize(self.log_w, temper)

    def draw(self, proposals: Proposals, normals: Floats) -> None:
        """Draw the poses from their proposals, with standard normal deviates (n, 3)."""
        upper = proposals.factors.transpose(0, 2, 1)
        self.poses[:] = proposals.peaks + np.linalg.solve(upper, normals[..., None])[..., 0]
        self.poses[:, 2] = wrap_angle(self.poses[:, 2])

    def draw_ancestors(self, u: float) -> NDArray[np.int64]:
        """Ancestors of the next generation by systematic resampling with one draw u."""
        ancestors = systematic(self.w, u)
        if self._keep_output and self.output not in ancestors:  # in place of a twin
            twins = np.flatnonzero(ancestors == np.bincount(ancestors).argmax())
            ancestors[twins[-1]] = self.output
        return survivors_in_place(ancestors)

    def inherit(self, ancestors: NDArray[np.int64]) -> None:
        """Replace every particle by a copy of its ancestor (n,), all with equal weights."""
        self.poses = self.poses[ancestors]
        self.lifetime = self.lifetime[ancestors]
        self._leaves = self._leaves[ancestors]
        self.log_w[:] = 0.0
        self.w = np.full(len(self), 1.0 / len(self))
        children = np.flatnonzero(ancestors == self.output)
        self.output = int(children[0]) if len(children) else int(np.argmax(self.lifetime))

    def best(self) -> int:
        """Index of the particle with the greatest lifetime weight; of equals the output one."""
        best = int(np.argmax(self.lifetime))
        return best if self.lifetime[best] > self.lifetime[self.output] else self.output

    def append_to_history(self) -> None:
        """Add the present poses to the particles' histories."""
        self._parents.append(self._leaves)
        self._nodes.append(self.poses.copy())
        self._leaves = np.arange(len(self))

    def history(self, particle: int) -> Floats:
        """Poses (k, 3) of a particle at every keyframe so far."""
        poses, leaf = [], int(self._leaves[particle])
        for parents, nodes in zip(reversed(self._parents), reversed(self._nodes), strict=True):
            poses.append(nodes[leaf])
            leaf = int(parents[leaf])
        return np.array(poses[::-1]).reshape(-1, 3)
