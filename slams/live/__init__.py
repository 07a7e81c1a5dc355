"""SLAM on a robot: scans pushed one by one, or taken from the network by `slams live`."""
