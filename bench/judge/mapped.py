"""Maps that a first drive leaves for a second one, and where their frames are in the truth."""

from __future__ import annotations

from typing import NamedTuple

from slams.localize.hooks import check_localizes
from slams.localize.source import Given
from slams.metrics import absolute_errors, align
from slams.player import replay
from slams.registry import Entry, label_of
from slams.scanlog import ScanLog
from slams.types import Pose2

EVERY = 8  # scans of a drive, one of which enters a map at its true pose: 5 Hz


class Mapped(NamedTuple):
    """A map to localize in, and where its frame is in the truth.

    By the first scan alone (`began`), whose error turns and shifts the map as a whole, and by all
    of the first drive (`fitted`); `off` [m] is what that drive's poses, which the map is made of,
    are off in the latter.
    """

    kind: str
    given: Given
    began: Pose2
    fitted: Pose2
    off: float


def own_map(log: ScanLog, entry: Entry) -> Mapped:
    """The algorithm's own map of a drive."""
    slam, truth = entry.cls(entry.params()), log.truth_at(log.t)
    assert truth is not None
    poses = replay(slam, log).poses
    given = Given(slam.map(), slam, label_of(entry.cls))
    off = float(absolute_errors(poses, truth).mean())
    return Mapped("first drive", given, Pose2(*truth[0]), align(poses, truth), off)


def true_map(log: ScanLog, entry: Entry) -> Mapped:
    """What a drive's scans make of a map at their true poses: left is what a localizer does."""
    slam, truth = check_localizes(entry.cls(entry.params()), entry.label), log.truth_at(log.t)
    assert truth is not None
    began = Pose2(*truth[0])
    for scan, pose in list(zip(log, truth, strict=True))[::EVERY]:
        slam.insert_at(scan, began.between(Pose2(*pose)))
    given = Given(slam.map(), slam, label_of(entry.cls))
    return Mapped("first drive at true poses", given, began, began, 0.0)
