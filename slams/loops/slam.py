"""Looped: any algorithm with a pose graph behind it that closes loops.

Per scan: the algorithm's own update; a keyframe of the graph, if it is due; then one piece of work:
a candidate for a loop is matched, the graph is optimized by one iteration, or keyframes enter the
new map. Once that map is complete the algorithm goes on in it, from its corrected pose.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np

from slams.localize.hooks import Localizes
from slams.loops.detector import LoopDetector
from slams.loops.graph import LEVER, PoseGraph
from slams.loops.matching import Keyframe, keyframe
from slams.loops.params import LoopParams
from slams.params import Params
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, against_map, wrap_angle

STEP_NOISE = 0.01, 0.01, 0.002  # m, m, rad: of every step between keyframes
MOVED = 0.05  # m, and as many times 0.1 rad, that a keyframe has to move, or the map stays
MIN_ENDS = 20  # end points of a keyframe
JUMP = 0.2  # m that the algorithm may be off its own last step or the wheels': it closed a loop
TRIES = 4  # candidates that are matched beside a keyframe; beside any other scan one
REDRAWN = 4  # keyframes that enter the new map beside one scan
PAUSE = 5  # scans to each keyframe of a map that was drawn anew, until the next
SETTLED = 1e-4  # m, rad: the last iteration moves no pose by more
PASSED = "state", "quality", "covariance", "local_covariance", "snapshot"


def apart(one: Pose2, other: Pose2) -> float:
    """Of two poses [m]."""
    return math.hypot(one.x - other.x, one.y - other.y)


def gap(one: Pose2, other: Pose2) -> float:
    """Distance of two poses [m], as walls `LEVER` away show it."""
    return apart(one, other) + LEVER * abs(wrap_angle(one.theta - other.theta))


class Redraw:
    """A new instance of an algorithm into which keyframes enter, a few for each scan.

    `done` once it has all that the graph has; `poses` at which keyframes are in the map.
    """

    def __init__(self, slam: Localizes, keyframes: list[Keyframe]) -> None:
        self.slam = slam
        self._keyframes = keyframes
        self.poses: list[Pose2] = []

    @property
    def done(self) -> bool:
        """Whether every keyframe is in the map."""
        return len(self.poses) == len(self._keyframes)

    def is_outdated(self, graph: PoseGraph) -> bool:
        """Whether keyframes that are in the map have moved."""
        last = len(self.poses) - 1
        return last >= 0 and gap(self.poses[last], graph.pose(last)) > MOVED

    def insert(self, count: int, graph: PoseGraph) -> None:
        """Let the next `count` keyframes enter."""
        first = len(self.poses)
        for k in range(first, min(first + count, len(self._keyframes))):
            self.poses.append(graph.pose(k))
            self.slam.insert_at(self._keyframes[k].scan, self.poses[k])


class Looped:
    """An algorithm and its pose graph; the pose is the algorithm's, in the map of the last closure.

    `frozen`: nothing enters the map, and no loop is closed. `slam` is the algorithm, `graph` the
    pose graph, `keyframes` its scans.
    """

    Params: ClassVar[type[Params]] = LoopParams
    algorithm: ClassVar[type[Any]]

    def __init__(self, params: Any) -> None:
        self.params = params
        self.slam: Localizes = self._make()
        self.graph = PoseGraph()
        self.keyframes: list[Keyframe] = []
        self._detector = LoopDetector(self.graph, self.keyframes, params.loop_path)
        self._redraw: Redraw | None = None
        self._pause = 0
        self._moving = False
        self._last: tuple[Scan, Pose2] | None = None
        self._step = IDENTITY  # of the last scan
        self._drawn: list[Pose2] = []  # keyframes in the algorithm's map
        self._at = IDENTITY  # of the last one there
        self._known = self._greatest = np.zeros(3)  # variances at the last keyframe, and since
        self._jumps = 0.0  # m^2, since the last keyframe
        self._scans: list[tuple[int, Pose2]] = []  # keyframe before it, -1: none, and step from it
        self._redrawn = 0

    def update(self, scan: Scan) -> Pose2:
        """The algorithm's update, and a piece of work on the graph."""
        pose = self.slam.update(scan)
        if self.frozen:
            self._scans.append((-1, pose))
        else:
            self._follow(scan, pose)
            before = self.graph.n
            self._add(scan, pose)
            self._scans.append((self.graph.n - 1, self._at.between(pose)))
            if self.graph.n > 0:
                pose = self._work(scan, pose, TRIES if self.graph.n > before else 1)
        self._last = scan, pose
        return pose

    @property
    def frozen(self) -> bool:
        """Whether the map stays as it is."""
        return self.slam.frozen

    @frozen.setter
    def frozen(self, frozen: bool) -> None:
        """Let the map stay as it is, or not."""
        self.slam.frozen = frozen

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Let a scan enter the map at a known pose; it is no keyframe of the graph."""
        self.slam.insert_at(scan, pose)
        self._last = None

    def map(self) -> OccupancyGrid:
        """The algorithm's."""
        return self.slam.map()

    def report(self) -> dict[str, Any]:
        """The algorithm's counts, and those of loops.

        `keyframes` of the graph, `loops` closed, maps `redrawn`.
        """
        counts = {"keyframes": self.graph.n, "loops": len(self.graph.loops)}
        return self.slam.report() | counts | {"redrawn": self._redrawn}

    def __getattr__(self, name: str) -> Any:
        """The algorithm's, if it has it and it is one of `PASSED`."""
        if name in PASSED:
            return getattr(self.slam, name)
        raise AttributeError(name)

    def corrected(self) -> Floats:
        """Poses (n, 3) of all scans so far, as the graph has them now."""
        poses = [self.graph.pose(k) @ step if k >= 0 else step for k, step in self._scans]
        return np.array(poses).reshape(-1, 3)

    # the graph

    def _make(self) -> Localizes:
        known = self.algorithm.Params.specs()
        values = {name: getattr(self.params, name) for name in known}
        slam: Localizes = self.algorithm(self.algorithm.Params(**values))
        return slam

    def _follow(self, scan: Scan, pose: Pose2) -> None:
        """How uncertain the step since the last keyframe has become.

        Where the algorithm has closed a loop by itself, that is a loop of the graph, and the step
        is that of the wheels.
        """
        self._greatest = np.maximum(self._greatest, self._variances(pose.theta))
        if self._last is None:
            return
        last, before = self._last
        usual, self._step = self._step, before.between(pose)
        driven = usual
        if last.odometry is not None and scan.odometry is not None:
            driven = last.odometry.between(scan.odometry)
        off = apart(driven, self._step)
        if off <= JUMP:
            return
        at = pose @ self._at.between(before @ driven).inverse()  # by wheels, from where it is now
        is_jump = driven is not usual and apart(driven, usual) <= JUMP
        edge = self._detector.claimed(self._drawn, at) if is_jump and self._drawn else None
        if edge is None:
            self._jumps += off * off
        else:
            self.graph.loops.append(edge)
            self._at, self._moving = at, True

    def _variances(self, theta: float) -> Floats:
        """Variances (3,) of the algorithm's pose along a heading, across it, and of its own."""
        covariance = against_map(self.slam)
        if covariance is None or not np.isfinite(covariance).all():
            return np.zeros(3)
        c, s = math.cos(theta), math.sin(theta)
        xx, xy, yy, turn = covariance[0, 0], covariance[0, 1], covariance[1, 1], covariance[2, 2]
        along = c * c * xx + 2.0 * c * s * xy + s * s * yy
        return np.array((along, xx + yy - along, turn))

    def _add(self, scan: Scan, pose: Pose2) -> None:
        """A keyframe, if due; its step is as uncertain as distance and covariance meanwhile say.

        A scan with few end points is none.
        """
        step, p = self._at.between(pose), self.params
        distance = math.hypot(step.x, step.y)
        far = distance >= p.keyframe_distance or abs(step.theta) >= p.keyframe_rotation
        if self.graph.n > 0 and not far:
            return
        key = keyframe(scan, self._twist(scan, pose))
        if key.ends.shape[1] < MIN_ENDS:
            return
        noise = np.array(STEP_NOISE) ** 2
        noise[:2] += p.drift**2 * distance + self._jumps
        noise[2] += p.heading_drift**2 * (distance + abs(step.theta))
        now = self._variances(pose.theta)
        # what was lost since, and what a match with older ground has gained: a shift of that much
        noise += 2.0 * self._greatest - self._known - now
        self.graph.append(step, noise)
        self.keyframes.append(key)
        self._drawn.append(pose)
        self._at, self._jumps = pose, 0.0
        self._known = self._greatest = now

    def _twist(self, scan: Scan, pose: Pose2) -> Pose2:
        """The body twist between the scan before and this [m/s, rad/s]."""
        if self._last is None or not scan.t > self._last[0].t:
            return IDENTITY
        dt = scan.t - self._last[0].t
        return Pose2(*(v / dt for v in self._last[1].between(pose)))

    def _work(self, scan: Scan, pose: Pose2, tries: int) -> Pose2:
        """A piece of work: an iteration of the graph, or candidates; keyframes of the new map."""
        if self._moving:
            self._moving = self.graph.iterate() > SETTLED
            return pose
        loops = self._detector.work(tries)
        if loops:
            self.graph.loops += loops
            self._moving = any(
                gap(self.graph.step(edge.earlier, edge.later), edge.pose) > MOVED for edge in loops
            )
            return pose
        self._pause -= 1
        if self._redraw is None:
            is_due = self._pause < 0 and gap(self.graph.pose(-1), self._at) > MOVED
        else:
            is_due = self._redraw.is_outdated(self.graph)
        if is_due:
            self._redraw = Redraw(self._make(), self.keyframes)
        if self._redraw is None:
            return pose
        self._redraw.insert(REDRAWN, self.graph)
        return self._in_new_map(self._redraw, scan, pose) if self._redraw.done else pose

    def _in_new_map(self, redraw: Redraw, scan: Scan, pose: Pose2) -> Pose2:
        """Go on in the new map, from the corrected pose."""
        new = redraw.slam
        corrected = self.graph.pose(-1) @ self._at.between(pose)
        if hasattr(self.slam, "adopt"):
            self.slam.adopt(new, corrected)
        else:
            new.insert_at(scan, corrected)
            self.slam = new
        self._drawn, self._redraw = redraw.poses, None
        self._at = self._drawn[-1]
        self._pause = PAUSE * self.graph.n
        self._redrawn += 1
        return corrected


@cache
def looped(algorithm: type[Any]) -> type[Looped]:
    """The class of an algorithm with loops; its parameters are the algorithm's and `LoopParams`.

    Raises:
        TypeError: the algorithm lacks `insert_at`.
    """
    name, own = algorithm.__name__, algorithm.Params
    if not hasattr(algorithm, "insert_at"):
        raise TypeError(
            f"{name} cannot close loops: it has no insert_at and frozen; expected an "
            "algorithm that is a slams.localize.Localizes"
        )
    presets = {key: value for key, value in own.PRESETS.items() if not isinstance(value, str)}
    module = algorithm.__module__  # classes are found by their names when a state is read
    fields = {"PRESETS": presets, "__module__": module}
    params: Any = dataclass(frozen=True)(type(f"Looped{own.__name__}", (LoopParams, own), fields))
    known = {"Params": params, "algorithm": algorithm, "__module__": module}
    cls = type(f"Looped{name}", (Looped,), known)
    for kind in (params, cls):
        setattr(sys.modules[module], kind.__name__, kind)
    return cls
