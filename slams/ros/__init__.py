"""What ROS nodes are set up with: launch and parameter files, taken over to our parameters."""
