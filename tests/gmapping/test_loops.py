"""Loops, places that only look alike, and corridors whose walls lie between the axes of the map."""

import math

import numpy as np
import pytest

from gmapping import GMappingParams
from gmapping.map_kernels import layer_of
from gmapping.particles import survivors_in_place
from gmapping.render import Renderer
from gmapping.surfaces import (
    CHANCE_SHARE,
    COMPLETE_SHARE,
    MIN_LOOP_PATH_LENGTH,
    PLACE_SHARE,
    SurfaceMatcher,
    _wall_heading,
)
from slams.test_world import box, cast, laser, scan_at
from slams.types import IDENTITY, Laser, Pose2, Scan
from tests.gmapping.scenes import (
    GAUSS_NEWTON,
    NO_CANDIDATES,
    climb,
    linearized,
    mapped,
    matcher_of,
    posterior,
    run,
    surface_of,
    view_of,
)

LENGTH, HEIGHT, WIDTH = 24.0, 15.0, 2.0  # m: a ring of bare corridors
STEP, BEYOND = 0.3, 40  # m between scans; scans after the way around
SENSOR = laser(181, math.pi, range_max=6.0)


def around(seed):
    """True poses of a way around the ring and on, and scans with wheels that drift."""
    rng, d = np.random.default_rng(seed), 0.5 * WIDTH
    walls = np.array(
        box(-d, -d, LENGTH + d, HEIGHT + d) + box(d, d, LENGTH - d, HEIGHT - d), np.float64
    )
    truth = [Pose2(0.5 * LENGTH, 0.0, 0.0)]
    for side in (0.5 * LENGTH, HEIGHT, LENGTH, HEIGHT, 0.5 * LENGTH + STEP * BEYOND):
        for _ in range(round(side / STEP)):
            truth.append(truth[-1] @ Pose2(STEP, 0.0, 0.0))
        truth += [truth[-1] @ Pose2(0.0, 0.0, 0.25 * math.pi * k) for k in (1, 2)]
    scale, drift = 1.03 + 0.02 * rng.random(), rng.choice((-0.02, 0.02))
    wheels, scans = IDENTITY, []
    for i, at in enumerate(truth):
        way = truth[max(i - 1, 0)].between(at)
        wheels = wheels @ Pose2(scale * way.x, 0.0, way.theta + drift * way.x)
        ranges = (cast(walls, at, SENSOR) + rng.normal(0.0, 0.02, 181)).astype(np.float32)
        ranges[ranges > SENSOR.range_max] = np.inf
        ranges.flags.writeable = False
        scans.append(Scan(0.3 * i, ranges, SENSOR, wheels))
    return [truth[0].between(at) for at in truth], scans


def revisit(poses, truth, i):
    """How far scan i is [m] from where the map of the first visit has its place."""
    k = int(np.argmin(np.hypot(*(np.array(truth)[:100, :2] - truth[i][:2]).T)))
    expected = Pose2(*poses[k]) @ truth[k].between(truth[i])
    return math.dist(expected[:2], poses[i][:2])


@pytest.mark.parametrize(
    ("seed", "drifts"), [(0, False), (1, False), (3, False), (8, True), (19, True), (22, False)]
)
def test_a_robot_that_comes_back_closes_the_loop(seed, drifts):
    """Where it has drifted; else it closes none."""
    truth, scans = around(seed)
    slam, poses = run(scans)
    off = np.array([revisit(poses, truth, i) for i in range(len(poses) - BEYOND, len(poses))])
    assert (off[:20].max() > 0.25) == drifts  # .8 to 2 m
    assert off[-3:].max() < 0.2  # .001 to .1 m
    assert (slam.report()["closed"] >= 1) == drifts


# m driven; the map is of the first meter
OLDER, YOUNGER = 1.0 + MIN_LOOP_PATH_LENGTH + 0.1, 1.0 + MIN_LOOP_PATH_LENGTH - 0.1
APART, SURE = np.array([[0.55, -0.5, 0.05]]), 1e6 * np.eye(3)


def seen(view):
    """Counts of what beams came by and ended at, from 0."""
    renderer = Renderer(0.05, 0.25, 1 << 20)
    for _ in range(3):
        renderer.add_keyframe(view.ray, IDENTITY)
    return renderer.counts


@pytest.mark.parametrize(
    ("way", "place", "free", "closes"),
    [
        (OLDER, Pose2(0.04, 0.03, 0.0), False, True),
        (YOUNGER, Pose2(0.04, 0.03, 0.0), False, False),
        (OLDER, Pose2(2.0, 0.0, 0.0), False, False),
        (OLDER, Pose2(0.0, 2.0, 0.0), False, False),
        (OLDER, Pose2(0.04, 0.03, 0.5 * math.pi), False, False),
        (OLDER, Pose2(0.04, 0.03, 0.0), True, False),
    ],
)
def test_particles_move_to_where_old_surfaces_match_more_of_a_scan(way, place, free, closes):
    """Not where a fifth of the scan ends in what was seen `free` then."""
    matcher, view = matcher_of(IDENTITY), view_of(IDENTITY)
    counts = seen(view)
    if free:  # as if people stood there now
        view.pieces[: len(view.pieces) // 5, :2] *= 0.6
    matcher._path_length = way
    found = matcher.propose(view, APART, SURE, [place], counts)
    assert found.closes_loop.tolist() == [closes]
    np.testing.assert_allclose(found.peaks, 0.0 if closes else APART, atol=0.02)


@pytest.mark.parametrize(("elsewhere", "closes"), [(0.45, True), (0.65, False)])
def test_a_loop_has_nearly_half_of_the_scan_on_old_surfaces(elsewhere, closes):
    """The rest is where nothing was seen: a door that is open now, or another place."""
    matcher, view = matcher_of(IDENTITY), view_of(IDENTITY)
    counts, beams = seen(view), np.cumsum(view.pieces[:, 4])
    view.pieces[beams < elsewhere * beams[-1], :2] *= 5.0
    matcher._path_length = OLDER
    found = matcher.propose(view, APART, SURE, [Pose2(0.02, 0.01, 0.0)], counts)
    assert found.closes_loop.tolist() == [closes]


def test_only_old_surfaces_weigh_a_particle_and_only_beyond_what_parallel_walls_explain():
    poses = np.array([[0.0, 0.0, 0.0], [0.06, 0.0, 0.0]])
    matcher, view = matcher_of(*poses), view_of(IDENTITY, quietest=0.01)
    sure, at = 4e7 * np.eye(3), np.zeros((2, 3))
    matcher.insert(view, poses, YOUNGER)
    np.testing.assert_array_equal(matcher.propose(view, at, sure, *NO_CANDIDATES).log_w, 0.0)
    matcher.insert(view, poses, OLDER)
    found, p = matcher.propose(view, at, sure, *NO_CANDIDATES), matcher._params
    width, full = p.width, p.width**2 * view.beams
    old_score = linearized(matcher.tiles.tiles, found.peaks[0], view.pieces, width, 1.0 + 0.1)[5]
    score = min(old_score, COMPLETE_SHARE * full) - CHANCE_SHARE * full
    worth = min(1.0, p.independent / view.beams) / p.range_noise**2
    assert found.log_w[0] == pytest.approx(0.5 * PLACE_SHARE * worth * score, rel=1e-3)
    assert found.log_w[0] > found.log_w[1] + 1.0  # its map is elsewhere


def test_a_surviving_particle_keeps_its_index():
    rng = np.random.default_rng(4)
    for _ in range(100):
        ancestors = np.sort(rng.integers(0, 9, 9))
        out = survivors_in_place(ancestors)
        np.testing.assert_array_equal(np.sort(out), ancestors)
        np.testing.assert_array_equal(out[out], out)


BEFORE = 15  # scans, while the robot turns until it looks along the corridor
STAMPS = [0.2, 0.16, 0.2, 0.16, 0.36, 0.002]  # s between two of them: a busy computer reads them


def corridor(rng):
    """2.1 m wide, 40 m long, open at its far end; doors stand 6 to 15 cm behind its walls."""
    walls = [(-6.0, -1.3, -6.0, 1.3)]
    for side in (-1.0, 1.0):
        x, y = -6.0, 1.05 * side
        while x < 34.0:
            begin = x + rng.uniform(0.8, 4.0)
            behind, end = y + side * rng.uniform(0.06, 0.15), begin + rng.uniform(0.8, 1.0)
            walls += [(x, y, begin, y), (begin, y, begin, behind)]
            walls += [(begin, behind, end, behind), (end, behind, end, y)]
            x = end
    return np.array(walls)


def along(seed, turned):
    """A drive of 20 m along it, begun `turned` [rad] away: true poses from there on, and scans."""
    rng, lidar, begin = np.random.default_rng(seed), laser(181, math.pi), Pose2(0.0, 0.0, turned)
    walls, at, speed, t, scans, truth = corridor(rng), begin, 0.0, 0.0, [], []
    for i in range(260):
        dt = STAMPS[i % len(STAMPS)] if i else 0.0
        t += dt
        if i < BEFORE:
            at = Pose2(0.0, 0.0, turned * (1.0 - i / (BEFORE - 1)))
        else:
            speed = min(0.5, speed + 0.3 * dt)
            heading = 0.06 * math.sin(0.5 * t)
            x, y = at.x + speed * dt * math.cos(heading), at.y + speed * dt * math.sin(heading)
            at = Pose2(x, y, heading)
        truth.append(begin.between(at))
        scans.append(scan_at(at, lidar, walls, noise=0.01, rng=rng, t=t))
    return np.array(truth), scans


def test_layers_are_told_apart_by_the_walls_of_the_first_scan():
    view, params = view_of(IDENTITY), GMappingParams(n_particles=1, max_tiles=5000)
    matcher = SurfaceMatcher(params)
    for heading in (0.7, 0.2):  # the second scan turns nothing any more
        assert matcher.insert(view, np.array([[0.0, 0.0, heading]]), 1.0)
        tiles = matcher.tiles.tiles
        assert math.atan2(tiles.axis_y, tiles.axis_x) == pytest.approx(0.7, abs=0.05)
    at = [layer_of(tiles, math.cos(a), math.sin(a)) for a in 0.7 + 0.5 * math.pi * np.arange(4)]
    assert at == [0, 1, 2, 3]


def test_few_hits_at_the_end_of_a_corridor_are_no_outliers_before_they_have_moved_the_pose():
    walls = np.array([[-50.0, 1.0, 50.0, 1.0], [50.0, -1.0, -50.0, -1.0], [5.0, -0.15, 5.0, 0.15]])
    surface = surface_of(IDENTITY, Laser(-math.pi / 2, math.radians(1.0), 181, 0.1, 6.0), walls)
    start = [(0.11, 0.0, 0.0)]
    of = posterior(mapped(surface).tiles, surface, start, 100.0)
    poses, _, _ = climb(of, start, GAUSS_NEWTON._replace(hold_steps=5))
    assert abs(poses[0, 0]) < 0.03


@pytest.mark.parametrize("seed", [5, 10, 15, 16, 21])
def test_door_frames_do_not_hold_the_robot_in_a_map_that_was_begun_askew(seed):
    truth, scans = along(seed, math.pi / 4.0)
    poses = run(scans)[1]
    assert np.hypot(*(poses[:, :2] - truth[:, :2]).T).max() < 0.4


def test_the_heading_of_a_building_is_that_of_most_of_its_walls():
    """Neither small things near the laser, of many beams and pieces, nor walls askew turn it."""

    def wall(x, y, heading, length, beams, apart=0.1):
        along = np.linspace(0.0, length, round(length / apart) + 1)
        c, s, one = math.cos(heading), math.sin(heading), np.ones(len(along))
        return np.column_stack([x - s * along, y + c * along, c * one, s * one, beams * one])

    building = [wall(4.0, 0.0, 0.3, 3.0, 1.0), wall(-2.0, 1.0, 0.3 + 0.5 * math.pi, 2.0, 1.0)]
    askew = [wall(0.5, 0.0, 0.95, 0.3, 60.0, 0.004), wall(-3.0, -2.0, 0.75, 3.0, 1.0)]
    heading = _wall_heading(np.vstack([*building, *askew]))
    assert math.remainder(heading - 0.3, 0.5 * math.pi) == pytest.approx(0.0, abs=0.02)


def test_where_none_is_to_wait_the_scale_falls_at_every_step():
    """So that what they cost can be compared."""
    surface, elsewhere = surface_of(IDENTITY), (60.0, 0.0, 0.0)
    settings = GAUSS_NEWTON._replace(
        max_steps=2
    )  # wide at the first one, which is long, half as wide at the second
    of = posterior(mapped(surface).tiles, surface, [(50.0, 0.0, 0.0)], 1.0)
    out = climb(of, [elsewhere], settings)[2]
    assert out[0, 3] == pytest.approx(surface[:, 4].sum() * (0.5 * settings.first_scale) ** 2)
