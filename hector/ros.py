"""Names of hector_mapping's parameters that no field has, and where its values come from."""

import dataclasses

from slams.params import RosNames

CODE = "original code"
LAUNCH = "original code, mapping_default.launch"

ORIGINAL_ROS_NAMES = RosNames(
    package="hector_mapping",
    nodes=("hector_mapping", "hector_slam", "hector_mapping_node"),
    words={"use_tf_pose_start_estimate": {"true": "auto", "1": "auto", "false": None, "0": None}},
    ignored={
        "map_start_x": "the map grows as needed, or is centered on the start",
        "map_start_y": "the map grows as needed, or is centered on the start",
        "use_tf_scan_transformation": "the log has the laser's mount",
        "laser_z_min_value": "a log is planar",
        "laser_z_max_value": "a log is planar",
        "output_timing": "the summary has the times",
        "pub_drawings": "--mcap writes scans, poses and maps",
    },
    refused={
        "map_with_known_poses": ("false", "there is no mapping without matching"),
    },
    defaults={
        "map_resolution": 0.025,
        "map_size": 1024,
        "map_multi_res_levels": 3,
        "map_update_angle_thresh": 0.9,
    },
)
ROS_NAMES = dataclasses.replace(
    ORIGINAL_ROS_NAMES,
    words={},
    original_only={
        "map_size": "the map grows as needed",
        "use_tf_pose_start_estimate": "wheels, gyro and velocity are fused where a scan has them",
    },
    defaults={},
)
