"""Motion: what is known of the robot's next step before its scan is looked at.

`slams.motion.model` fuses wheels, gyro and the motion so far, with a covariance; `track` keeps the
pose by it from scan to scan, `sight` tells what a scan cannot see.
"""
