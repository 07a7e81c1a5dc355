"""TimeSeries: a recorded signal, interpolated at other times."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from slams.types import Floats, wrap_angle

MAX_ATTITUDE_GAP = 0.5  # s between two attitudes; none is interpolated in a longer gap
MAX_GAP, MAX_GAP_PERIODS = 1.0, 5.0  # s, median periods; a longer gap of the truth is not bridged


@dataclass(frozen=True)
class TimeSeries:
    """Stamps t (k,) [s] and values as recorded: poses (k, 3), rates (k,), roll and pitch (k, 2).

    Stamps may jump back; they are sorted for interpolation.
    """

    t: Floats
    values: Floats

    @cached_property
    def in_order(self) -> tuple[Floats, Floats]:
        """Stamps and values sorted by stamp, equal stamps in the order of recording."""
        order = np.argsort(self.t, kind="stable")
        return self.t[order], self.values[order]

    def poses_at(self, t: Floats) -> Floats:
        """Poses (n, 3) at the stamps t (n,): linear in x, y and the unwrapped angle.

        There is no extrapolation: outside the recorded time a row is nan.
        """
        stamps, values = self.in_order
        columns = (values[:, 0], values[:, 1], np.unwrap(values[:, 2]))
        poses = np.stack([_between(t, stamps, column) for column in columns], axis=1)
        poses[:, 2] = wrap_angle(poses[:, 2])
        return poses

    def known_poses_at(self, t: Floats) -> Floats:
        """Poses as `poses_at`, nan also in gaps of the recording."""
        poses, stamps = self.poses_at(t), np.unique(self.t)
        if len(stamps) > 1:
            steps = np.diff(stamps)
            wide = steps > max(MAX_GAP, MAX_GAP_PERIODS * float(np.median(steps)))
            before = np.clip(np.searchsorted(stamps, t) - 1, 0, len(steps) - 1)
            poses[wide[before] & ~np.isin(t, stamps)] = np.nan
        return poses

    def attitudes_at(self, t: Floats) -> Floats:
        """Roll and pitch (n, 2) [rad] at the stamps t (n,); nan outside and in gaps."""
        stamps, values = self.in_order
        found = np.stack([_between(t, stamps, column) for column in values.T], axis=1)
        after = np.clip(np.searchsorted(stamps, t), 1, max(len(stamps) - 1, 1))
        if len(stamps) > 1:
            found[stamps[after] - stamps[after - 1] > MAX_ATTITUDE_GAP] = np.nan
        return found

    def integral_at(self, t: Floats) -> Floats:
        """The integral (n,) of a rate from its first stamp to the stamps t (n,); nan outside."""
        stamps, rate = self.in_order
        steps = np.diff(stamps) * 0.5 * (rate[1:] + rate[:-1])
        total = np.concatenate([[0.0], np.cumsum(steps)])
        return _between(t, stamps, total)


def _between(t: Floats, stamps: Floats, values: Floats) -> Floats:
    return np.interp(t, stamps, values, left=np.nan, right=np.nan)
