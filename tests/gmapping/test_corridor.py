"""Corridors whose walls lie between the axes of the map, and door frames in them."""

import math

import numpy as np
import pytest

from gmapping import GMappingParams
from gmapping.map_kernels import facing
from gmapping.surfaces import SurfaceMatcher, _heading
from slams.test_world import laser, scan_at
from slams.types import IDENTITY, Laser, Pose2
from tests.gmapping.scenes import HOW, climb, mapped, one, run, surface_of, view_of

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
    at = [facing(tiles, math.cos(a), math.sin(a)) for a in 0.7 + 0.5 * math.pi * np.arange(4)]
    assert at == [0, 1, 2, 3]


def test_the_heading_of_a_building_is_that_of_most_of_its_walls():
    """Neither small things near the laser, of many beams and pieces, nor walls askew turn it."""

    def wall(x, y, heading, length, beams, apart=0.1):
        along = np.linspace(0.0, length, round(length / apart) + 1)
        c, s, one = math.cos(heading), math.sin(heading), np.ones(len(along))
        return np.column_stack([x - s * along, y + c * along, c * one, s * one, beams * one])

    building = [wall(4.0, 0.0, 0.3, 3.0, 1.0), wall(-2.0, 1.0, 0.3 + 0.5 * math.pi, 2.0, 1.0)]
    askew = [wall(0.5, 0.0, 0.95, 0.3, 60.0, 0.004), wall(-3.0, -2.0, 0.75, 3.0, 1.0)]
    heading = _heading(np.vstack([*building, *askew]))
    assert math.remainder(heading - 0.3, 0.5 * math.pi) == pytest.approx(0.0, abs=0.02)


def test_few_hits_at_the_end_of_a_corridor_are_no_outliers_before_they_have_moved_the_pose():
    walls = np.array([[-50.0, 1.0, 50.0, 1.0], [50.0, -1.0, -50.0, -1.0], [5.0, -0.15, 5.0, 0.15]])
    surface = surface_of(IDENTITY, Laser(-math.pi / 2, math.radians(1.0), 181, 0.1, 6.0), walls)
    start = (0.11, 0.0, 0.0)
    poses, _, _ = climb(
        mapped(surface).tiles, surface, one(start, 100.0), [start], HOW._replace(wait=5)
    )
    assert abs(poses[0, 0]) < 0.03


def test_where_none_is_to_wait_the_scale_falls_at_every_step():
    """So that what they cost can be compared."""
    surface, elsewhere = surface_of(IDENTITY), (60.0, 0.0, 0.0)
    how = HOW._replace(steps=2)  # wide at the first one, which is long, half as wide at the second
    out = climb(mapped(surface).tiles, surface, one((50.0, 0.0, 0.0), 1.0), [elsewhere], how)[2]
    assert out[0, 3] == pytest.approx(surface[:, 4].sum() * (0.5 * how.wide) ** 2)


@pytest.mark.parametrize("seed", [5, 10, 15, 16, 21])
def test_door_frames_do_not_hold_the_robot_in_a_map_that_was_begun_askew(seed):
    truth, scans = along(seed, math.pi / 4.0)
    poses = run(scans)[1]
    assert np.hypot(*(poses[:, :2] - truth[:, :2]).T).max() < 0.4
