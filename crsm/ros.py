"""Names of crsm_slam's parameters that no field has, and where its values come from."""

import dataclasses

from slams.params import RosNames

CODE = "original code"
NO_BYTES = "the default's cells are weighted means with sub-cell walls, not bytes"
NO_LATTICE = "the default's climbs begin with 16 mm and its restarts with 128 mm, on any map"

ORIGINAL_ROS_NAMES = RosNames(
    package="crsm_slam",
    nodes=("crsm_slam", "crsm_slam_node"),
    ignored=dict.fromkeys(
        ("occupancy_grid_map_freq", "robot_pose_tf_freq", "trajectory_freq"),
        "crsm_slam reads it without effect",
    ),
    defaults={"map_update_density": 30.0, "robot_width": 0.5, "robot_length": 0.6},
)
ROS_NAMES = dataclasses.replace(
    ORIGINAL_ROS_NAMES,
    original_only={
        "slam_occupancy_grid_dimentionality": NO_BYTES,
        "map_update_density": NO_BYTES,
        "map_update_obstacle_density": NO_BYTES,
        "slam_container_size": "the map grows as needed",
        "hill_climbing_disparity": NO_LATTICE,
        "max_hill_climbing_iterations": NO_LATTICE,
        "desired_number_of_picked_rays": "the default takes as many rays of any laser",
        "scan_density_lower_boundary": "the default detects jumps by the spacing of the beams",
        "robot_width": "the default marks no unobserved cell as free",
        "robot_length": "the default marks no unobserved cell as free",
    },
    defaults={},
)
