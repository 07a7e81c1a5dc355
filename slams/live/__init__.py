"""SLAM on a robot: scans pushed one by one, or taken from the network by `python -m slams.live`."""

from slams.live.estimate import Estimate
from slams.live.slam import LATE_IN_A_ROW, LiveSlam

__all__ = ["LATE_IN_A_ROW", "Estimate", "LiveSlam"]
