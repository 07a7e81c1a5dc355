"""Parameters of the loop closure around an algorithm."""

from __future__ import annotations

from dataclasses import dataclass

from slams.params import Params, param


@dataclass(frozen=True)
class LoopParams(Params):
    """Keyframes of the pose graph, and how far its steps are trusted."""

    keyframe_distance: float = param(
        0.5, "m", "distance between two keyframes of the graph", source="ours: a doorway", low=0.05
    )
    keyframe_rotation: float = param(
        0.35, "rad", "rotation between two keyframes of the graph", source="ours: 20 deg", low=0.05
    )
    drift: float = param(
        0.02,
        "m",
        "deviation of the algorithm's steps after one meter; ten times as much after a hundred",
        source="ours: without a loop 0.1 to 1 m are off after 100 m on public logs",
        low=1e-4,
    )
    heading_drift: float = param(
        0.003,
        "rad",
        "the same of the heading, after one meter or one radian",
        source="ours: public logs",
        low=1e-5,
    )
    loop_path: float = param(
        10.0,
        "m",
        "path between two visits of a place, at least: the map itself holds nearer ones",
        source="ours: larger than a room",
        low=1.0,
    )
