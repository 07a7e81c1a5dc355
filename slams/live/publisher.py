"""The publisher of a node: transform, pose and state per scan, map and path less often."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from slams import metrics
from slams.live.estimate import STATES, Estimate
from slams.live.options import NODE_TOPICS, NodeOptions
from slams.ros.maker import Maker
from slams.ros.messages import typestore
from slams.types import Floats, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from slams.live.transport import Transport

PUBLISHED = ("/map", "/path", "/tf", "/pose", "/slam/state")
PATH_SPACING = 0.2  # m between two poses of a published path: finer than a screen shows


class NodePublisher:
    """Publishes the results of a node.

    Args:
        transport: the network.
        options: topics and frames.
        record: called with topic, time [ns] and bytes of every published message.

    `unsent` counts messages that the network did not accept.
    """

    def __init__(
        self, transport: Transport, options: NodeOptions, record: Callable[[str, int, bytes], None]
    ) -> None:
        self._options, self._record, self._make = options, record, Maker()
        self.unsent = 0
        self._publishers = {
            name: transport.advertise(options.names[name], *NODE_TOPICS[name]) for name in PUBLISHED
        }

    def publish_pose(self, stamp: int, estimate: Estimate, edge: tuple[str, Pose2] | None) -> None:
        """Publish the pose, and the transform from the map to a child frame.

        Args:
            stamp: of the scan [ns].
            estimate: with the pose.
            edge: the child frame and its pose in the map; None: no transform.
        """
        frame, ahead = self._options.map_frame, round(1e9 * self._options.tf_ahead)
        if edge is not None:
            self._send("/tf", self._make.transforms(stamp + ahead, [(frame, *edge)]))
        pose, covariance = estimate.pose, estimate.covariance
        self._send("/pose", self._make.pose_with_covariance(stamp, pose, covariance, frame))

    def publish_state(self, stamp: int, estimate: Estimate, counts: Mapping[str, int]) -> None:
        """Publish the state after a scan, with counts."""
        values = {"quality": _text(estimate.quality), "explained": _text(estimate.explained)}
        values |= {"seconds_lost": f"{estimate.seconds_lost:.3f}"}
        values |= {name: str(count) for name, count in counts.items()}
        level = STATES.index(estimate.state)
        self._send("/slam/state", self._make.status(stamp, level, estimate.state, values))

    def publish_map(self, stamp: int, grid: OccupancyGrid) -> None:
        """Publish the map."""
        self._send("/map", self._make.grid(stamp, grid, self._options.map_frame))

    def publish_path(self, stamps: Sequence[int], poses: Floats) -> None:
        """Publish the path, stamps (n,) [ns] and poses (n, 3), thinned to `PATH_SPACING`."""
        _, kept = np.unique(np.floor(metrics.driven(poses) / PATH_SPACING), return_index=True)
        thinned = [stamps[i] for i in kept], poses[kept]
        self._send("/path", self._make.path(*thinned, self._options.map_frame))

    def _send(self, topic: str, message: Any) -> None:
        data = bytes(typestore().serialize_cdr(message, message.__msgtype__))
        try:
            self._publishers[topic].publish(data)
        except OSError:
            self.unsent += 1
        self._record(self._options.names[topic], time.time_ns(), data)


def _text(value: float) -> str:
    """A share 0..1 as text; empty for nan."""
    return "" if math.isnan(value) else f"{value:.3f}"
