"""What ROS says: its messages, and the launch and parameter files of its nodes."""
