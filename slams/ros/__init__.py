"""ROS messages, and the launch and parameter files of ROS nodes, without ROS."""
