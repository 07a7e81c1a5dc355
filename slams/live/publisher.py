"""The topics of a node: transform, pose and state with every scan, the map at its own pace."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from slams import metrics
from slams.live.estimate import STATES, Estimate
from slams.live.options import TOPICS, NodeOptions
from slams.ros.maker import Maker
from slams.ros.messages import store
from slams.types import Floats, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from slams.live.transport import Transport

PUBLISHED = ("/map", "/path", "/tf", "/pose", "/slam/state")
PATH_STEP = 0.2  # [m] between two poses of a path: finer than a line on a screen shows


class NodePublisher:
    """Publishes what a node knows.

    Args:
        transport: the network.
        options: topics and frames.
        record: gets topic, time [ns] and bytes of every message that goes out.

    `unsent` counts messages that the network did not take.
    """

    def __init__(
        self,
        transport: Transport,
        options: NodeOptions,
        record: Callable[[str, int, bytes], None],
    ) -> None:
        self._options, self._record, self._make = options, record, Maker()
        self.unsent = 0
        self._publishers = {
            name: transport.advertise(options.names[name], *TOPICS[name]) for name in PUBLISHED
        }

    def publish_pose(self, stamp: int, estimate: Estimate, edge: tuple[str, Pose2] | None) -> None:
        """Publish the pose, and the transform of a frame in the map.

        Args:
            stamp: of the scan [ns].
            estimate: with the pose.
            edge: the frame that is placed in the map, and where; None for none.
        """
        frame, ahead = self._options.map_frame, round(1e9 * self._options.tf_ahead)
        if edge is not None:
            moved = self._make.transforms(stamp + ahead, [(frame, *edge)])
            self._send("/tf", moved)
        posed = self._make.posed(stamp, estimate.pose, estimate.covariance, frame)
        self._send("/pose", posed)

    def publish_state(self, stamp: int, estimate: Estimate, counts: Mapping[str, int]) -> None:
        """Publish how a scan went, with some counts."""
        values = {"quality": _share(estimate.quality), "explained": _share(estimate.explained)}
        values |= {"seconds_lost": f"{estimate.seconds_lost:.3f}"}
        values |= {name: str(count) for name, count in counts.items()}
        level = STATES.index(estimate.state)
        message = self._make.status(stamp, "slams", level, estimate.state, values)
        self._send("/slam/state", message)

    def publish_map(self, stamp: int, grid: OccupancyGrid) -> None:
        """Publish the map."""
        message = self._make.grid(stamp, grid, self._options.map_frame)
        self._send("/map", message)

    def publish_path(self, stamps: Sequence[int], poses: Floats) -> None:
        """Publish the way so far, stamps (n,) [ns] and poses (n, 3), a pose every `PATH_STEP`."""
        _, kept = np.unique(np.floor(metrics.driven(poses) / PATH_STEP), return_index=True)
        named = [stamps[i] for i in kept], poses[kept]
        self._send("/path", self._make.path(*named, self._options.map_frame))

    def _send(self, topic: str, message: Any) -> None:
        data = bytes(store().serialize_cdr(message, message.__msgtype__))
        try:
            self._publishers[topic].publish(data)
        except OSError:
            self.unsent += 1
        self._record(self._options.names[topic], time.time_ns(), data)


def _share(value: float) -> str:
    """0..1 as text; nothing where it is not known."""
    return "" if math.isnan(value) else f"{value:.3f}"
