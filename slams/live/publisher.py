"""What a node tells the network: transform, pose and state for every scan, the map now and then."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

from slams.formats.bag import POSE_COV, TF
from slams.formats.ros_maker import Maker
from slams.formats.ros_store import store
from slams.live.estimate import STATES, Estimate
from slams.live.options import NodeOptions
from slams.live.wire import MAP, STATUS, Outlet, Quality, Wire
from slams.types import OccupancyGrid, Pose2

Keep = Callable[[str, int, bytes], None]
Counts = Mapping[str, int]


class Publisher:
    """The topics a node publishes; `keep` gets topic, time [ns] and bytes of what goes out.

    `unsent` counts what the network did not take: it goes on without.
    """

    def __init__(self, wire: Wire, options: NodeOptions, keep: Keep) -> None:
        topics = options.topics
        self._options, self._keep, self._make = options, keep, Maker()
        self.unsent = 0
        self._types = {
            topics.map: (MAP, Quality.LATCHED),
            topics.tf: (TF, Quality.RELIABLE),
            topics.pose: (POSE_COV, Quality.RELIABLE),
            topics.state: (STATUS, Quality.RELIABLE),
        }
        self._outlets: dict[str, Outlet] = {
            topic: wire.advertise(topic, *kind) for topic, kind in self._types.items()
        }

    def tell(
        self, stamp: int, estimate: Estimate, edge: tuple[str, Pose2] | None, counts: Counts
    ) -> None:
        """Publish what is known after a scan.

        Args:
            stamp: of the scan [ns].
            estimate: what is known.
            edge: the frame that is placed in the map, and where; None for none.
            counts: what the state tells beside.
        """
        frame, ahead = self._options.map_frame, round(1e9 * self._options.tf_ahead)
        if edge is not None:
            moved = self._make.transforms(stamp + ahead, [(frame, *edge)])
            self._send(self._options.topics.tf, moved)
        posed = self._make.posed(stamp, estimate.pose, estimate.covariance, frame)
        self._send(self._options.topics.pose, posed)
        self.tell_state(stamp, estimate, counts)

    def tell_state(self, stamp: int, estimate: Estimate, counts: Counts) -> None:
        """Publish how a scan went, without a pose: alone where the place is still sought."""
        self._send(self._options.topics.state, self._state(stamp, estimate, counts))

    def show(self, stamp: int, grid: OccupancyGrid) -> None:
        """Publish the map."""
        message = self._make.grid(stamp, grid, self._options.map_frame)
        self._send(self._options.topics.map, message)

    def _state(self, stamp: int, estimate: Estimate, counts: Counts) -> Any:
        values = {"quality": _share(estimate.quality), "explained": _share(estimate.explained)}
        values |= {"seconds_lost": f"{estimate.seconds_lost:.3f}"}
        values |= {name: str(count) for name, count in counts.items()}
        level = STATES.index(estimate.state)
        return self._make.status(stamp, "slams", level, estimate.state, values)

    def _send(self, topic: str, message: Any) -> None:
        data = bytes(store().serialize_cdr(message, self._types[topic][0]))
        try:
            self._outlets[topic].send(data)
        except OSError:
            self.unsent += 1
        self._keep(topic, time.time_ns(), data)


def _share(value: float) -> str:
    """0..1 as text; nothing where it is not known."""
    return "" if math.isnan(value) else f"{value:.3f}"
