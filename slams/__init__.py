"""Classic 2D laser SLAM behind one interface.

    >>> import slams
    >>> log = slams.load("scans.npz")
    >>> slam = slams.create("hector")
    >>> for scan in log:
    ...     pose = slam.update(scan)

Importing this package does not import numba; an algorithm does, when it is created.
"""

from slams.params import Params, param
from slams.registry import create, find, names
from slams.replay import Run, replay
from slams.scanlog import ScanLog, load
from slams.types import Laser, OccupancyGrid, Pose2, Scan, Slam

__version__ = "0.1.0"

__all__ = [
    "Laser",
    "OccupancyGrid",
    "Params",
    "Pose2",
    "Run",
    "Scan",
    "ScanLog",
    "Slam",
    "create",
    "find",
    "load",
    "names",
    "param",
    "replay",
]
