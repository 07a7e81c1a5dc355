"""SLAM on a robot: scans pushed one by one, or taken from the network by `slams live`."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slams.live.estimate import Estimate
    from slams.live.slam import LiveSlam

_HOME = {"Estimate": "estimate", "LiveSlam": "slam"}

__all__ = ["Estimate", "LiveSlam"]


def __getattr__(name: str) -> Any:
    """Import a name when it is first used, so that `--help` starts at once."""
    if name not in _HOME:
        raise AttributeError(f"module 'slams.live' has no attribute {name!r}")
    return getattr(import_module(f"slams.live.{_HOME[name]}"), name)
