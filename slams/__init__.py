"""Classic 2D laser SLAM behind one interface.

    >>> import slams
    >>> log = slams.load("scans.npz")
    >>> slam = slams.create("hector")
    >>> for scan in log:
    ...     pose = slam.update(scan)

The names below are imported at first use: `--help` starts at once, and only an algorithm that
needs numba loads it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slams.formats.source import load as load
    from slams.live.estimate import Estimate as Estimate
    from slams.live.slam import LiveSlam as LiveSlam
    from slams.params import Params as Params
    from slams.params import param as param
    from slams.player import Run as Run
    from slams.player import replay as replay
    from slams.registry import create as create
    from slams.registry import find as find
    from slams.registry import names as names
    from slams.scanlog import ScanLog as ScanLog
    from slams.state import load_state as load_state
    from slams.types import Laser as Laser
    from slams.types import OccupancyGrid as OccupancyGrid
    from slams.types import Pose2 as Pose2
    from slams.types import Scan as Scan
    from slams.types import Slam as Slam

__version__ = "0.1.0"

_EXPORTS = {
    "formats.source": "load",
    "live.estimate": "Estimate",
    "live.slam": "LiveSlam",
    "params": "Params param",
    "player": "Run replay",
    "registry": "create find names",
    "scanlog": "ScanLog",
    "state": "load_state",
    "types": "Laser OccupancyGrid Pose2 Scan Slam",
}
_MODULE_OF = {name: module for module, text in _EXPORTS.items() for name in text.split()}

__all__ = [*_MODULE_OF]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'slams' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f"slams.{_MODULE_OF[name]}"), name)
    return value
