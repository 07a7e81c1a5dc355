"""What the parameters of slam_gmapping mean here; the mapped names stand at the fields."""

import dataclasses

from slams.params import RosNames

CLIMB = "the default matches to a distance field, not by hill climbing"
TRACKED = "the noise is that of the tracked way, not of odometry"
INERT = "no effect in slam_gmapping either"

ORIGINAL = RosNames(
    package="gmapping",
    nodes=("slam_gmapping", "slam_gmapping_node", "slam_gmapping_replay"),
    ignored=dict.fromkeys(("xmin", "ymin", "xmax", "ymax"), "the map grows as needed")
    | dict.fromkeys(("llsamplerange", "llsamplestep", "lasamplerange", "lasamplestep"), INERT)
    | {
        "kernelSize": "a window of 3 x 3 cells, the default there",
        "lskip": "every beam counts, the default there",
        "temporalUpdate": "keyframes come with the way alone, the default there",
        "tf_delay": "a log has no delay",
        "inverted_laser": "the log has the laser's mount",
    },
    refused={"throttle_scans": ("1", "say --every instead")},
)
ROS = dataclasses.replace(
    ORIGINAL,
    original_only=dict.fromkeys(
        ("sigma", "lsigma", "lstep", "astep", "iterations", "ogain", "minimumScore"), CLIMB
    )
    | dict.fromkeys(("srr", "srt", "str", "stt"), TRACKED),
)
