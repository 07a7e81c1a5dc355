"""SLAM on a robot: a library class fed scan by scan, and the ROS 2 node `slams live`."""
