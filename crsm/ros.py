"""What the parameters of crsm_slam mean here; the mapped names stand at the fields."""

import dataclasses

from slams.params import RosNames

WALLS = "the default's cells are weighted means with sub-cell walls, not bytes"
SEARCH = "the default's climbs begin with 16 mm and its restarts with 128 mm, on any map"

ORIGINAL = RosNames(
    package="crsm_slam",
    nodes=("crsm_slam", "crsm_slam_node"),
    ignored=dict.fromkeys(
        ("occupancy_grid_map_freq", "robot_pose_tf_freq", "trajectory_freq"),
        "read but not used by crsm_slam either",
    ),
    defaults={"map_update_density": 30.0, "robot_width": 0.5, "robot_length": 0.6},
)
ROS = dataclasses.replace(
    ORIGINAL,
    original_only={
        "slam_occupancy_grid_dimentionality": WALLS,
        "map_update_density": WALLS,
        "map_update_obstacle_density": WALLS,
        "slam_container_size": "the map grows as needed",
        "hill_climbing_disparity": SEARCH,
        "max_hill_climbing_iterations": SEARCH,
        "desired_number_of_picked_rays": "the default looks at as many on any laser",
        "scan_density_lower_boundary": "the default finds jumps by the beams' spacing",
        "robot_width": "the default frees nothing unseen",
        "robot_length": "the default frees nothing unseen",
    },
    defaults={},
)
