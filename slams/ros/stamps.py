"""Stamps of ROS messages as seconds."""

from __future__ import annotations

from typing import Any


def seconds(stamp: Any) -> float:
    """A ROS stamp, of ROS 2 (sec, nanosec) or ROS 1 (secs, nsecs), or a number [s]."""
    if hasattr(stamp, "nanosec"):
        return float(stamp.sec + 1e-9 * stamp.nanosec)
    if hasattr(stamp, "nsecs"):
        return float(stamp.secs + 1e-9 * stamp.nsecs)
    return float(stamp)
