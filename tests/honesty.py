"""Whether covariances are honest: errors of poses, normalized by what was said of them.

    python -m tests.honesty 20

prints, of so many seeded drives of 15 s in a maze at 5 Hz, what `normalized` comes to.
"""

import sys

import numpy as np

from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from slams import metrics
from slams.player import replay
from slams.registry import create
from slams.types import Pose2, wrap_angle

NAMES = ["hector", "tsd", "crsm"]


def drive(seed, odometry, size=9.0, duration=15.0):
    log = simulate(Setting(size=size, duration=duration, seed=seed))
    return log.select(every=8, odometry=odometry)


def normalized(name, log):
    """Mean squared error per degree of freedom, in units of the covariance: in two frames.

    In that of the map where it lies best on the truth, as for the ATE: a covariance is that of a
    pose against the map. And in that of the first pose, where the first scan's error counts in
    every pose, though no covariance can know of it.
    """
    slam, said = create(name), []
    run = replay(slam, log, watch=lambda scan, pose: said.append(slam.covariance.copy()))
    truth = log.truth_at(run.t)
    fitted = metrics.align(truth, run.poses)
    first = Pose2(*run.poses[0]) @ Pose2(*truth[0]).inverse()
    return [mean_square(run.poses[1:], truth[1:], said[1:], frame) for frame in (fitted, first)]


def mean_square(poses, truth, covariances, frame):
    squares = []
    for pose, true, covariance in zip(poses, truth, covariances, strict=True):
        error = pose - np.array(frame @ Pose2(*true))
        error[2] = wrap_angle(error[2])
        squares.append(error @ np.linalg.solve(covariance, error))
    return np.mean(squares) / 3.0


def main(drives):
    for odometry in (True, False):
        logs = [drive(seed, odometry) for seed in range(drives)]
        for name in NAMES:
            fitted, first = np.mean([normalized(name, log) for log in logs], axis=0)
            with_or_without = "with odometry" if odometry else "laser alone"
            print(
                f"{name:8} {with_or_without:14} {fitted:.2f}, in the first pose's frame {first:.2f}"
            )


if __name__ == "__main__":
    main(int(sys.argv[1]))
