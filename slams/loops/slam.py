"""Looped: any algorithm, with a pose graph that closes loops.

After the algorithm's own update a keyframe is added to the graph, if due. Then one piece of work
is done: an iteration of the optimization, matches with loop closure candidates, or keyframes are
inserted into a new map. Once that map is complete, the algorithm continues in it.
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
from slams.loops.graph import PoseGraph, pose_distance, position_distance
from slams.loops.matching import Keyframe, keyframe
from slams.loops.params import LoopParams
from slams.params import Params
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, against_map

BASE_STEP_STD = 0.01, 0.01, 0.002  # m, m, rad: of each step, in addition to drift
MIN_CORRECTION = 0.05  # m of pose distance by which a keyframe has to move before a redraw
MIN_POSE_JUMP = 0.2  # m between a step and its prediction: the algorithm has closed a loop itself
CANDIDATES_PER_KEYFRAME = 4  # matched beside a new keyframe; beside any other scan one
FORWARDED_ATTRIBUTES = "state", "quality", "covariance", "local_covariance", "snapshot"


class Redraw:
    """A new instance of an algorithm, into which keyframes are inserted, a few beside each scan.

    `poses`: those at which keyframes were inserted so far.
    """

    def __init__(self, slam: Localizes, keyframes: list[Keyframe]) -> None:
        self.slam = slam
        self._keyframes = keyframes
        self.poses: list[Pose2] = []

    def is_outdated(self, graph: PoseGraph) -> bool:
        """Whether the graph has moved a keyframe since it was inserted."""
        last = len(self.poses) - 1
        return last >= 0 and pose_distance(self.poses[last], graph.pose(last)) > MIN_CORRECTION

    def insert(self, count: int, graph: PoseGraph) -> bool:
        """Insert the next `count` keyframes at their present poses; whether all are in now."""
        first = len(self.poses)
        for k in range(first, min(first + count, len(self._keyframes))):
            self.poses.append(graph.pose(k))
            self.slam.insert_at(self._keyframes[k].scan, self.poses[k])
        return len(self.poses) == len(self._keyframes)


class Looped:
    """An algorithm and its pose graph; poses are the algorithm's, in the map of the last closure.

    `slam` is the algorithm, `graph` the pose graph, `keyframes` its scans. While `frozen`, the map
    stays unchanged and no loop is closed.
    """

    Params: ClassVar[type[Params]] = LoopParams
    algorithm: ClassVar[type[Any]]

    def __init__(self, params: Any) -> None:
        self.params = params
        self.slam: Localizes = self._new_instance()
        self.graph = PoseGraph()
        self.keyframes: list[Keyframe] = []
        self._detector = LoopDetector(self.graph, self.keyframes, params.loop_path)
        self._redraw: Redraw | None = None
        self._pause = 0  # scans until the next redraw may start
        self._is_optimizing = False
        self._previous: tuple[Scan, Pose2] | None = None
        self._previous_step = IDENTITY
        self._map_poses: list[Pose2] = []  # of all keyframes, in the algorithm's map
        self._keyframe_pose = IDENTITY  # of the last keyframe, in the algorithm's map
        self._keyframe_covariance = np.zeros((3, 3))  # of the last keyframe's pose in the map
        self._jump = np.zeros(2)  # m, sum of the pose jumps since the last keyframe
        self._steps: list[tuple[int, Pose2]] = []  # of each scan from keyframe k; -1: from the map
        self._n_redrawn = 0

    def update(self, scan: Scan) -> Pose2:
        """The algorithm's update, and a piece of work on the graph."""
        pose = self.slam.update(scan)
        if self.frozen:
            self._steps.append((-1, pose))
        else:
            self._follow(scan, pose)
            n_before = self.graph.n
            self._add_keyframe(scan, pose)
            self._steps.append((self.graph.n - 1, self._keyframe_pose.between(pose)))
            if self.graph.n > 0:
                is_new = self.graph.n > n_before
                pose = self._work(scan, pose, CANDIDATES_PER_KEYFRAME if is_new else 1)
        self._previous = scan, pose
        return pose

    @property
    def frozen(self) -> bool:
        """Whether the map stays unchanged."""
        return self.slam.frozen

    @frozen.setter
    def frozen(self, frozen: bool) -> None:
        """Keep the map unchanged, or not."""
        self.slam.frozen = frozen

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Insert a scan into the map at a known pose; it becomes no keyframe of the graph."""
        self.slam.insert_at(scan, pose)
        self._previous = None

    def map(self) -> OccupancyGrid:
        """The algorithm's map."""
        return self.slam.map()

    def report(self) -> dict[str, Any]:
        """The algorithm's counts, and `keyframes` of the graph, `loops` closed, maps `redrawn`."""
        counts = {"keyframes": self.graph.n, "loops": len(self.graph.loops)}
        return self.slam.report() | counts | {"redrawn": self._n_redrawn}

    def __getattr__(self, name: str) -> Any:
        """One of `FORWARDED_ATTRIBUTES` of the algorithm, if the algorithm has it."""
        if name in FORWARDED_ATTRIBUTES:
            return getattr(self.slam, name)
        raise AttributeError(name)

    def corrected(self) -> Floats:
        """Poses (n, 3) of all scans so far, by the present poses of the graph."""
        poses = [self.graph.pose(k) @ step if k >= 0 else step for k, step in self._steps]
        return np.array(poses).reshape(-1, 3)

    def _new_instance(self) -> Localizes:
        names = self.algorithm.Params.specs()
        values = {name: getattr(self.params, name) for name in names}
        slam: Localizes = self.algorithm(self.algorithm.Params(**values))
        return slam

    def _follow(self, scan: Scan, pose: Pose2) -> None:
        """Track jumps of the algorithm's pose.

        A jump that is verified as a loop becomes a loop edge; the step is then that of the wheels.
        """
        if self._previous is None:
            return
        previous_scan, previous = self._previous
        predicted, self._previous_step = self._previous_step, previous.between(pose)
        expected = predicted
        if previous_scan.odometry is not None and scan.odometry is not None:
            expected = previous_scan.odometry.between(scan.odometry)
        jump = position_distance(expected, self._previous_step)
        if jump <= MIN_POSE_JUMP:
            return
        # the last keyframe's pose, if the expected step led to the present pose
        moved = pose @ self._keyframe_pose.between(previous @ expected).inverse()
        edge = None
        is_measured = expected is not predicted and len(self._map_poses) > 0
        if is_measured and position_distance(expected, predicted) <= MIN_POSE_JUMP:
            edge = self._detector.verify_jump(self._map_poses, moved)
        if edge is None:
            reached = previous @ expected
            self._jump += (pose.x - reached.x, pose.y - reached.y)  # a delayed scan jumps back
        else:
            self.graph.loops.append(edge)
            self._keyframe_pose, self._is_optimizing = moved, True

    def _covariance(self) -> Floats:
        """Covariance (3, 3) of the pose against the map; 0 if the algorithm has none."""
        covariance = against_map(self.slam)
        if covariance is None or not np.isfinite(covariance).all():
            return np.zeros((3, 3))
        return np.array(covariance)

    def _add_keyframe(self, scan: Scan, pose: Pose2) -> None:
        """Add a keyframe, if one is due and the scan has enough end points.

        The variances of its step follow from its distance and from the algorithm's covariance.
        """
        step, p = self._keyframe_pose.between(pose), self.params
        distance = math.hypot(step.x, step.y)
        is_due = distance >= p.keyframe_distance or abs(step.theta) >= p.keyframe_rotation
        if self.graph.n > 0 and not is_due:
            return
        key = keyframe(scan, self._twist(scan, pose))
        if key.ends.shape[1] < 20:  # end points, too few to be matched
            return
        variances = np.array(BASE_STEP_STD) ** 2
        variances[:2] += p.drift**2 * distance + float(self._jump @ self._jump)
        variances[2] += p.heading_drift**2 * (distance + abs(step.theta))
        covariance = self._covariance()
        # a match with an older part of the map moves the pose as far as these deviations fall
        change = covariance - self._keyframe_covariance
        variances += np.abs(_variances(change, self._keyframe_pose.theta))
        self.graph.append(step, variances)
        self.keyframes.append(key)
        self._map_poses.append(pose)
        self._keyframe_pose, self._keyframe_covariance = pose, covariance
        self._jump = np.zeros(2)

    def _twist(self, scan: Scan, pose: Pose2) -> Pose2:
        """The body twist since the previous scan [m/s, rad/s]."""
        if self._previous is None or not scan.t > self._previous[0].t:
            return IDENTITY
        dt = scan.t - self._previous[0].t
        return Pose2(*(v / dt for v in self._previous[1].between(pose)))

    def _work(self, scan: Scan, pose: Pose2, n_candidates: int) -> Pose2:
        """Optimize by one iteration, else match candidates, else redraw; returns the pose."""
        if self._is_optimizing:
            self._is_optimizing = self.graph.iterate() > 1e-4  # m, rad
            return pose
        loops = self._detector.work(n_candidates)
        if loops:
            self.graph.loops += loops
            errors = [pose_distance(self.graph.step(*edge[:2]), edge.pose) for edge in loops]
            self._is_optimizing = max(errors) > MIN_CORRECTION
            if not self._is_optimizing:
                self._detector.skip()
            return pose
        self._pause -= 1
        if self._redraw is None:
            correction = pose_distance(self.graph.pose(-1), self._keyframe_pose)
            is_due = self._pause < 0 and correction > MIN_CORRECTION
        else:
            is_due = self._redraw.is_outdated(self.graph)
        if is_due:
            self._redraw = Redraw(self._new_instance(), self.keyframes)
        if self._redraw is None:
            return pose
        is_done = self._redraw.insert(4, self.graph)  # keyframes beside each scan
        return self._switch_map(self._redraw, scan, pose) if is_done else pose

    def _switch_map(self, redraw: Redraw, scan: Scan, pose: Pose2) -> Pose2:
        """Continue in the new map; returns the corrected pose."""
        new = redraw.slam
        corrected = self.graph.pose(-1) @ self._keyframe_pose.between(pose)
        if hasattr(self.slam, "adopt"):
            self.slam.adopt(new, corrected)
        else:
            new.insert_at(scan, corrected)
            self.slam = new
        self._map_poses, self._redraw = redraw.poses, None
        self._keyframe_pose = self._map_poses[-1]
        self._pause = 5 * self.graph.n  # scans, more than the redraw took
        self._n_redrawn += 1
        return corrected


def _variances(covariance: Floats, theta: float) -> Floats:
    """Variances (3,) by a covariance (3, 3): along a heading [rad], across it, of the yaw."""
    (xx, xy, _), (_, yy, _), (_, _, yaw) = covariance.tolist()
    c, s = math.cos(theta), math.sin(theta)
    along = c * c * xx + 2.0 * c * s * xy + s * s * yy
    return np.array((along, xx + yy - along, yaw))


@cache
def looped(algorithm: type[Any]) -> type[Looped]:
    """The class of an algorithm with loops; its parameters are those of both.

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
    module = algorithm.__module__  # where a saved state looks classes up by name

    def pickled(self: Any) -> Any:
        return _params_of, (algorithm, self.as_dict())

    fields = {"PRESETS": presets, "__module__": module, "__reduce__": pickled}
    params: Any = dataclass(frozen=True)(type(f"Looped{own.__name__}", (LoopParams, own), fields))
    attributes = {"Params": params, "algorithm": algorithm, "__module__": module}
    cls = type(f"Looped{name}", (Looped,), attributes)
    for kind in (params, cls):
        setattr(sys.modules[module], kind.__name__, kind)
    return cls


def _params_of(algorithm: Any, values: dict[str, Any]) -> Params:
    """Parameters of an algorithm with loops, unpickled in a process that has no such class yet."""
    return looped(algorithm).Params(**values)
