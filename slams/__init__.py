"""Classic 2D laser SLAM behind one interface.

    >>> import slams
    >>> log = slams.load("scans.npz")
    >>> slam = slams.create("hector")
    >>> for scan in log:
    ...     pose = slam.update(scan)

The names below are imported when first used, so that `--help` starts at once and numba is loaded
by the algorithm that needs it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slams.formats.source import load
    from slams.live.estimate import Estimate
    from slams.live.slam import LiveSlam
    from slams.params import Params, param
    from slams.player import Run, replay
    from slams.registry import create, find, names
    from slams.scanlog import ScanLog
    from slams.state import load_state
    from slams.types import Laser, OccupancyGrid, Pose2, Scan, Slam

__version__ = "0.1.0"

_HOME = {
    "Estimate": "live.estimate",
    "LiveSlam": "live.slam",
    "Params": "params",
    "param": "params",
    "create": "registry",
    "find": "registry",
    "names": "registry",
    "Run": "player",
    "replay": "player",
    "ScanLog": "scanlog",
    "load": "formats.source",
    "load_state": "state",
    "Laser": "types",
    "OccupancyGrid": "types",
    "Pose2": "types",
    "Scan": "types",
    "Slam": "types",
}

__all__ = [
    "Estimate",
    "Laser",
    "LiveSlam",
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
    "load_state",
    "names",
    "param",
    "replay",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'slams' has no attribute {name!r}")
    module = import_module(f"slams.{_HOME[name]}")
    value = getattr(module, name)
    globals()[name] = value
    return value
