"""What a node tells the network: transform, pose and state for every scan, the map now and then."""

from __future__ import annotations

import math
import time
from typing import Any

from slams.formats.bag import POSE_COV, TF
from slams.formats.ros_maker import Maker
from slams.formats.ros_store import store
from slams.live.estimate import STATES, Estimate
from slams.live.options import NodeOptions
from slams.live.recorder import Recorder
from slams.live.wire import MAP, STATUS, Outlet, Quality, Wire
from slams.types import OccupancyGrid


class Publisher:
    """The topics a node publishes; what goes out is recorded, too."""

    def __init__(self, wire: Wire, options: NodeOptions, recorder: Recorder | None) -> None:
        topics = options.topics
        self._options, self._recorder, self._make = options, recorder, Maker()
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
        self, stamp: int, estimate: Estimate, base: str | None, counts: dict[str, int]
    ) -> None:
        """Publish what is known after a scan.

        Args:
            stamp: of the scan [ns].
            estimate: what is known.
            base: the base's frame, where there is no odometry: then map -> base is published.
            counts: what the state tells beside.
        """
        frame, ahead = self._options.map_frame, round(1e9 * self._options.tf_ahead)
        edge = None
        if estimate.map_to_odom is not None:
            edge = (frame, self._options.odom_frame, estimate.map_to_odom)
        elif base is not None:
            edge = (frame, base, estimate.pose)
        if edge is not None:
            moved = self._make.transforms(stamp + ahead, [edge])
            self._send(self._options.topics.tf, moved)
        posed = self._make.posed(stamp, estimate.pose, estimate.covariance, frame)
        self._send(self._options.topics.pose, posed)
        self._send(self._options.topics.state, self._state(stamp, estimate, counts))

    def show(self, stamp: int, grid: OccupancyGrid) -> None:
        """Publish the map."""
        message = self._make.grid(stamp, grid, self._options.map_frame)
        self._send(self._options.topics.map, message)

    def _state(self, stamp: int, estimate: Estimate, counts: dict[str, int]) -> Any:
        quality = "" if math.isnan(estimate.quality) else f"{estimate.quality:.3f}"
        values = {"quality": quality, "seconds_lost": f"{estimate.seconds_lost:.3f}"}
        values |= {name: str(count) for name, count in counts.items()}
        level = STATES.index(estimate.state)
        return self._make.status(stamp, "slams", level, estimate.state, values)

    def _send(self, topic: str, message: Any) -> None:
        data = bytes(store().serialize_cdr(message, self._types[topic][0]))
        self._outlets[topic].send(data)
        if self._recorder is not None:
            self._recorder.put(topic, time.time_ns(), data)
