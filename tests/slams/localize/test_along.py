"""After a gap the robot is farther along a corridor than its walls tell; its end tells."""

import math

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from bench.judge import metrics
from bench.sim.degrade import degrade
from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from slams.localize.along import SURE, _lead, farther_along
from slams.localize.chart import Chart
from slams.localize.chart_kernels import EXPLAINED, OPEN, REFUTED, UNKNOWN
from slams.localize.places import ends_of
from slams.localize.relocator import Relocator
from slams.motion.params import MotionParams
from slams.motion.track import Track
from slams.player import replay
from slams.registry import create
from slams.types import IDENTITY, Pose2
from tests.floors import grid_of
from tests.rooms import box, laser, scan_at

LIDAR = laser(541, range_max=30.0)
HALL = np.array(box(-8.0, -1.0, 8.0, 1.0))
CHART = Chart(grid_of(HALL))
ALONG = np.array((1.0, 0.0))
HERE = Pose2(3.0, 0.2, 0.1)


def ends(pose=HERE, segments=HALL, noise=0.01, seed=0):
    return ends_of(scan_at(pose, LIDAR, segments, noise, np.random.default_rng(seed)))


def off(by, pose=HERE):
    return Pose2(pose.x + by, pose.y, pose.theta)


@pytest.mark.parametrize("by", [-2.6, -1.3, -0.4, 0.5, 2.0])
@pytest.mark.parametrize("along", [ALONG, -ALONG])
def test_the_end_of_a_corridor_tells_how_far_along_it_is(by, along):
    found = farther_along(CHART, ends(), off(by), along)
    assert found is not None and found == pytest.approx(HERE, abs=0.04)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("by", [0.0, 0.1])
def test_who_is_right_or_nearly_so_stays(seed, by):
    assert farther_along(CHART, ends(noise=0.02, seed=seed), off(by), ALONG) is None


def test_where_no_end_is_in_sight_nothing_tells():
    near = ends()
    near = near[np.hypot(near[:, 0], near[:, 1]) < 4.0]
    assert farther_along(CHART, near, off(-0.6), ALONG) is None


def test_a_few_beams_prove_nothing():
    points = ends()
    ahead = np.flatnonzero(HERE.transform(points)[:, 0] > 7.9)
    assert len(ahead) > 20
    beside = np.delete(points, ahead, axis=0)
    few = np.concatenate([beside, points[ahead[:5]]])
    assert farther_along(CHART, few, off(-0.6), ALONG) is None
    assert farther_along(CHART, np.concatenate([beside, points[ahead]]), off(-0.6), ALONG)


def test_a_scan_of_elsewhere_proves_nothing():
    points = ends()
    hidden = points.copy()
    hidden[: len(points) // 2 : 2] *= 0.5  # somebody in the way of every other beam of one half
    hidden[: len(points) // 2 : 2] -= (0.0, 0.05)
    assert farther_along(CHART, points, off(-0.6), ALONG) is not None
    assert farther_along(CHART, hidden, off(-0.6), ALONG) is None


def test_a_place_that_explains_too_little_is_none():
    """The end of the corridor is where it was, what stands beside it is not."""
    points = ends()
    beside = np.flatnonzero(np.abs(HERE.transform(points)[:, 0]) < 7.0)
    few, many = points.copy(), points.copy()
    for some, every in ((few, 20), (many, 3)):
        some[beside[::every]] *= 0.5  # somebody stands there
    assert farther_along(CHART, few, off(-0.6), ALONG) is not None
    assert farther_along(CHART, many, off(-0.6), ALONG) is None


def test_what_is_unknown_here_or_there_counts_neither_way():
    here = np.array([OPEN, OPEN, EXPLAINED, UNKNOWN, UNKNOWN, REFUTED], np.int8)
    there = np.array([EXPLAINED, OPEN, OPEN, EXPLAINED, REFUTED, UNKNOWN], np.int8)
    lead = _lead(np.tile(there, (2, 1)), here)
    np.testing.assert_allclose(lead, (1 - 1) - SURE * math.sqrt(2.0))


def test_beams_of_two_minds_prove_nothing():
    """As many as say that it is farther along say that it is where it was taken to be."""
    points, shifted = ends(), off(-0.6)
    wall = HERE.transform(points)
    others = shifted.inverse().transform(wall[wall[:, 0] > 7.9])
    both = np.concatenate([points, others])
    assert farther_along(CHART, points, shifted, ALONG) is not None
    assert farther_along(CHART, both, shifted, ALONG) is None


def test_of_places_that_are_alike_none_is_chosen():
    niches = [box(x, 0.7, x + 0.4, 1.0) for x in np.arange(-7.5, 7.0, 1.2)]
    segments = np.concatenate([np.array(HALL), *map(np.array, niches)])
    chart = Chart(grid_of(segments))
    points = ends(segments=segments)
    points = points[np.abs(HERE.transform(points)[:, 0]) < 7.5]  # not the ends
    assert farther_along(chart, points, off(-0.6), ALONG) is None


def test_only_what_is_not_explained_is_asked_everywhere(monkeypatch):
    """A cycle of a scanner pays for it: who is right has his beams looked at once."""
    asked, judged = [], Chart.judged
    monkeypatch.setattr(
        Chart, "judged", lambda c, of, at: asked.append(len(of)) or judged(c, of, at)
    )
    assert farther_along(CHART, ends(noise=0.02), HERE, ALONG) is None
    assert sum(asked) < 2 * len(ends())
    asked.clear()
    assert farther_along(CHART, ends(), off(-0.6), ALONG) is not None
    assert sum(asked) < 0.5 * 61 * len(ends())


def test_distances_are_those_between_the_centers_of_cells():
    points, at = (
        np.random.default_rng(0).uniform(-7.9, 7.9, (200, 2)) * (1.0, 0.12),
        Pose2(0.1, 0.0, 0.0),
    )
    x, y = ((at.transform(points) - CHART.origin) / CHART.resolution - 0.5).T
    cells = CHART.cells.distance.astype(float)
    expected = map_coordinates(cells, (y, x), order=1, mode="nearest") * CHART.resolution
    found = CHART.distances(points, at)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert found.min() < 0.1 < 0.5 < found.max()
    outside, border = CHART.distances(np.array([[99.0, 0.0], [8.5, 0.0]]), IDENTITY)
    assert outside == border


def track_off(by):
    """A track that matches `by` too far along, after a gap of 9 s; the next scan."""
    track = Track(MotionParams())
    for t in (*(0.1 * k for k in range(15)), 10.5):
        scan = scan_at(HERE, LIDAR, HALL, 0.01, np.random.default_rng(int(10 * t)), t=t)
        track.predict(scan)
        track.matched(HERE if t < 9.0 else off(by), 1e6 * np.eye(3), scan)
    assert track.unproven
    return track, scan


def test_a_match_after_a_gap_is_moved_along_and_has_to_stand_there():
    track, scan = track_off(-0.6)
    relocator, lost = Relocator(track, True), track.lost
    relocator.update(scan, lambda: grid_of(HALL))
    assert track.pose == pytest.approx(HERE, abs=0.04) and relocator.found == 1
    assert track.state == "lost" and track.proving and track.lost == lost
    for k in range(1, 12):
        scan = scan_at(HERE, LIDAR, HALL, 0.01, np.random.default_rng(k), t=10.5 + 0.1 * k)
        track.predict(scan)
        track.matched(HERE, 1e6 * np.eye(3), scan)
        relocator.update(scan, lambda: grid_of(HALL))
    assert track.state == "matched" and relocator.found == 1


def test_the_laser_is_where_it_is_mounted():
    mounted = laser(541, range_max=30.0, mount=Pose2(0.3, 0.0, math.pi / 2))
    track, _ = track_off(-0.6)
    scan = scan_at(HERE, mounted, HALL, 0.01, np.random.default_rng(3), t=10.5)
    Relocator(track, True).update(scan, lambda: grid_of(HALL))
    assert track.pose == pytest.approx(HERE, abs=0.04)


@pytest.mark.parametrize("name", ["hector", "tsd", "crsm", "gmapping"])
def test_who_saw_nothing_for_seconds_goes_on_where_he_is(name):
    log = degrade(simulate(Setting("ring", seed=24, duration=20.0)), "blind", 3.0, 24)
    log = log.select(every=4, odometry=False)
    run = replay(create(name), log)
    truth = metrics.common_with(log, run.t, run.poses)
    last = np.hypot(*(truth.estimate - truth.truth)[-10:, :2].T)
    assert last.max() < 0.05
