"""Parameters of slam_gmapping here; the parameter fields have the mapped names."""

import dataclasses

from slams.params import RosNames

CLIMB_ONLY = "the default matches by Gauss-Newton, not by hill climbing"
ODOMETRY_NOISE_ONLY = "the noise is that of the tracked motion, not of odometry"
NO_EFFECT = "no effect in slam_gmapping either"

ORIGINAL_ROS_NAMES = RosNames(
    package="gmapping",
    nodes=("slam_gmapping", "slam_gmapping_node", "slam_gmapping_replay"),
    ignored=dict.fromkeys(("xmin", "ymin", "xmax", "ymax"), "the map grows as needed")
    | dict.fromkeys(("llsamplerange", "llsamplestep", "lasamplerange", "lasamplestep"), NO_EFFECT)
    | {
        "kernelSize": "a window of 3 x 3 cells, the default there",
        "lskip": "every beam is used, the default there",
        "temporalUpdate": "keyframes depend on the motion alone, the default there",
        "tf_delay": "a log has no delay",
        "inverted_laser": "the log has the laser's mount",
    },
    refused={"throttle_scans": ("1", "say --every instead")},
)
ROS_NAMES = dataclasses.replace(
    ORIGINAL_ROS_NAMES,
    original_only=dict.fromkeys(
        ("sigma", "lsigma", "lstep", "astep", "iterations", "ogain", "minimumScore"), CLIMB_ONLY
    )
    | dict.fromkeys(("srr", "srt", "str", "stt"), ODOMETRY_NOISE_ONLY),
)
