"""Parameters of the published program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from gmapping.ros import ORIGINAL_ROS_NAMES
from slams.grid_bounds import max_cells
from slams.params import Params, RosNames, param

ORIGINAL = "original code"


@dataclass(frozen=True)
class OriginalParams(Params):
    """gmapping's own parameters and values, as slam_gmapping sets them."""

    ROS: ClassVar[RosNames | None] = ORIGINAL_ROS_NAMES

    n_particles: int = param(
        30, "1", "number of particles", source=ORIGINAL, low=1, high=20_000, ros=("particles",)
    )
    resolution: float = param(
        0.05, "m", "edge of a cell", source=ORIGINAL, low=0.01, high=1.0, ros=("delta",)
    )
    linear_update: float = param(
        1.0, "m", "distance between keyframes", source=ORIGINAL, low=0.0, ros=("linearUpdate",)
    )
    angular_update: float = param(
        0.5, "rad", "rotation between keyframes", source=ORIGINAL, low=0.0, ros=("angularUpdate",)
    )
    resample_threshold: float = param(
        0.5,
        "1",
        "n_eff over n_particles below which particles are resampled",
        source="[Grisetti07] adaptive resampling: N / 2",
        low=0.0,
        high=1.0,
        ros=("resampleThreshold",),
    )
    way_per_way: float = param(
        0.1, "1", "translation noise per translation", source=ORIGINAL, low=0.0, ros=("srr",)
    )
    turn_per_way: float = param(
        0.2, "1", "rotation noise [rad] per translation [m]", source=ORIGINAL, low=0.0, ros=("srt",)
    )
    way_per_turn: float = param(
        0.1, "1", "translation noise [m] per rotation [rad]", source=ORIGINAL, low=0.0, ros=("str",)
    )
    turn_per_turn: float = param(
        0.2, "1", "rotation noise per rotation", source=ORIGINAL, low=0.0, ros=("stt",)
    )
    beam_offset: float = param(
        -0.5,
        "1",
        "beam widths by which the beams are turned",
        source="original code: half a beam off the true angles",
    )
    max_range: float = param(
        80.0,
        "m",
        "longer ranges are not used",
        source=ORIGINAL,
        low=0.1,
        ros=("maxRange", "maxUrange"),
    )
    max_cells: int = max_cells()
    max_tiles: int = param(
        200_000,
        "1",
        "tiles of 4 kB at most, over all particles",
        source="ours: memory",
        low=100,
        high=1 << 20,
    )
    score_sigma: float = param(
        0.05, "1", "score divisor [m^2]", source=ORIGINAL, low=1e-6, ros=("sigma",)
    )
    likelihood_sigma: float = param(
        0.075, "1", "likelihood divisor [m^2]", source=ORIGINAL, low=1e-6, ros=("lsigma",)
    )
    linear_step: float = param(
        0.05, "m", "first step of the climb", source=ORIGINAL, low=1e-4, ros=("lstep",)
    )
    angular_step: float = param(
        0.05, "rad", "first step of the climb", source=ORIGINAL, low=1e-4, ros=("astep",)
    )
    iterations: int = param(
        5,
        "1",
        "halvings of the step of the climb",
        source=ORIGINAL,
        low=1,
        high=100,
        ros=("iterations",),
    )
    gain: float = param(
        3.0, "1", "log weights are divided by gain * N", source=ORIGINAL, low=0.01, ros=("ogain",)
    )
    minimum_score: float = param(
        0.0, "1", "score a match must exceed", source=ORIGINAL, low=0.0, ros=("minimumScore",)
    )
    missed: float = param(
        0.5, "1", "squared distance of a beam without a hit nearby [m^2]", source=ORIGINAL, low=0.0
    )
    occupied: float = param(
        0.25,
        "1",
        "share of hits above which a cell of the map is a wall",
        source=ORIGINAL,
        low=0.01,
        high=0.99,
        ros=("occ_thresh",),
    )
