"""Parameters of the loop closure around an algorithm."""

from __future__ import annotations

from dataclasses import dataclass

from slams.params import Params, param


@dataclass(frozen=True)
class LoopParams(Params):
    """Spacing of the keyframes in the pose graph, and drift of the steps between them."""

    keyframe_distance: float = param(
        0.5, "m", "distance between two keyframes of the graph", source="ours: a doorway", low=0.05
    )
    keyframe_rotation: float = param(
        0.35, "rad", "rotation between two keyframes of the graph", source="ours: 20 deg", low=0.05
    )
    drift: float = param(
        0.02,
        "m",
        "standard deviation of a step after one meter; it grows with the square root of distance",
        source="ours: errors of 0.1 to 1 m after 100 m without a loop on public logs",
        low=1e-4,
    )
    heading_drift: float = param(
        0.003,
        "rad",
        "standard deviation of a step's heading after one meter or one radian",
        source="ours: public logs",
        low=1e-5,
    )
    loop_path: float = param(
        10.0,
        "m",
        "least path length between two visits of a place: the map itself spans shorter ones",
        source="ours: larger than a room",
        low=1.0,
    )
