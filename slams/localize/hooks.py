"""What an algorithm has to offer, beside `Slam`, to localize in a map that stays as it is."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from slams.types import Pose2, Scan, Slam


@runtime_checkable
class Localizes(Slam, Protocol):
    """A `Slam` that takes a given pose, and a map that is finished.

    1. `insert_at(scan, pose)`: the base is at `pose` in the map when `scan` is taken. Nothing is
       matched. The scan enters the map at that pose, whatever the way since the last one, unless
       `frozen`. It counts as the scan before the next update, and `pose` as its pose: the next
       prediction starts there with this scan's stamp, odometry and yaw, and at rest. It may be the
       very first call; then the map's frame is that of `pose`.
    2. `frozen`: False in a new instance, free to be set at any time. While it is True no update
       changes the map, and matching, recovery and the pose go on as ever. An algorithm with
       particles keeps them on one map, gives them all the pose of `insert_at`, and may go on with
       one of them.
    3. Stamps of inserted scans rise; lasers may change from one to the next (contract of `update`,
       clause 8): the scans that build a map see all around.
    """

    frozen: bool

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Take a scan whose pose is known; see the class."""
        ...


def check_localizes(slam: object, label: str) -> Localizes:
    """The algorithm, if it offers the hooks.

    Raises:
        TypeError: it does not.
    """
    if not isinstance(slam, Localizes):
        raise TypeError(
            f"{label} cannot localize in a map that is given: it has no insert_at and frozen; "
            "expected an algorithm that is a slams.localize.Localizes"
        )
    return slam
