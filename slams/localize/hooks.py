"""Localizes: the methods that an algorithm needs to localize in a given map."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from slams.types import Pose2, Scan, Slam


@runtime_checkable
class Localizes(Slam, Protocol):
    """A `Slam` that accepts a given pose and a finished map.

    1. `insert_at(scan, pose)`: the base is at `pose` in the map when `scan` is taken. Nothing is
       matched. The scan enters the map at this pose, at any distance from the last one, unless
       `frozen`. The next prediction starts at `pose` with this scan's stamp, odometry and yaw, at
       rest. If it is the first call, the map's frame is that of `pose`.
    2. `frozen`: False in a new instance, may be set at any time. While it is True no update changes
       the map; matching, recovery and the pose continue. An algorithm with particles keeps them on
       one map, sets all of them to the pose of `insert_at`, and may continue with one of them.
    3. Stamps of inserted scans rise. The laser may change from scan to scan (contract of `update`,
       clause 8): a map is built from scans of 360 degrees.
    """

    frozen: bool

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Insert a scan whose pose is known; see the class."""
        ...


def check_localizes(slam: object, label: str) -> Localizes:
    """The algorithm, if it implements `Localizes`.

    Raises:
        TypeError: it does not.
    """
    if not isinstance(slam, Localizes):
        raise TypeError(
            f"{label} cannot localize in a map that is given: it has no insert_at and frozen; "
            "expected an algorithm that is a slams.localize.Localizes"
        )
    return slam
