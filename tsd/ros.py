"""How parameters of ohm_tsd_slam are used here; fields of `params` list the mapped names."""

import dataclasses

from slams.params import RosNames

OWN_SETTINGS_REASON = "ICP and RANSAC of the default have their own parameters"
OTHER_MODES_REASON = "belongs to registration modes 1 and 2, which are not implemented"
UNUSED_REASON = "ohm_tsd_slam reads it and does not use it"

ORIGINAL_ROS_NAMES = RosNames(
    package="ohm_tsd_slam",
    nodes=("slam_node", "tsd_slam", "tsd_slam_node", "ohm_tsd_slam_node", "slam"),
    units={"truncation_radius": "cell", "reg_sin_rot_max": "sin", "ransac_phi_max": "deg"},
    words={"registration_mode": {"0": "icp", "3": "tsd"}},
    ignored={
        "x_offset": "moves only the image of the map",
        "y_offset": "moves only the image of the map",
        "local_offset_x": "the first pose is the origin",
        "local_offset_y": "the first pose is the origin",
        "local_offset_yaw": "the first pose is the origin",
        "footprint_height": "the area marked as free is square",
        "min_range": "the log contains the laser's limit",
        "use_object_inflation": "the map's image is not inflated",
        "object_inflation_factor": "the map's image is not inflated",
    }
    | dict.fromkeys(
        (
            *("x_off_factor", "y_off_factor", "zphi", "rangemax", "sigphi", "maxAnglePenalty"),
            *("epsTresh", "ransac_trials", "ransac_eps_thresh", "ransac_ctrlset_size"),
            *("max_velocity_lin", "max_velocity_rot", "ude_odom_rescue", "wait_for_odom_tf"),
        ),
        UNUSED_REASON,
    )
    | dict.fromkeys(
        (
            *("epsThresh", "zhit", "zshort", "zmax", "sighit", "lamshort"),
            *("maxAngleDiff", "percentagePointsInC"),
        ),
        OTHER_MODES_REASON,
    ),
    refused={"robot_nbr": ("1", "one robot, one laser; a log per robot")},
    defaults={
        "registration_mode": 0,
        "icp_iterations": 25,
        "dist_filter_max": 1.0,
        "dist_filter_min": 0.1,
        "reg_trs_max": 0.25,
        "reg_sin_rot_max": 0.17,
        "sizeControlSet": 140,
        "ransac_phi_max": 30.0,
        "zrand": 0.25,
        "truncation_radius": 3,
    },
)
ROS_NAMES = dataclasses.replace(
    ORIGINAL_ROS_NAMES,
    units={"truncation_radius": "cell"},
    words={},
    original_only={
        "registration_mode": "the default always runs ICP, and RANSAC if ICP is uncertain",
        "map_size": "the map grows as needed",
        "low_reflectivity_range": "the default ignores beams without a return",
        "footprint_width": "the default marks only observed cells as free",
        "footprint_x_offset": "the default marks only observed cells as free",
    }
    | dict.fromkeys(
        (
            *("icp_iterations", "dist_filter_max", "dist_filter_min", "reg_trs_max"),
            *("reg_sin_rot_max", "trials", "sizeControlSet", "ransac_phi_max", "zrand"),
        ),
        OWN_SETTINGS_REASON,
    ),
    defaults={},
)
