"""Worlds and exact ray casting; tilted bodies, whose attitudes bring the walls back."""

import math

import cv2
import numpy as np
import pytest

from bench.sim.degrade import degrade
from bench.sim.drive import Drive
from bench.sim.maze import rescue_arena
from bench.sim.measuring import Measuring
from bench.sim.ramps import RAMP_LENGTH, Ramps
from bench.sim.sensors import SENSORS
from bench.sim.setting import Setting
from bench.sim.simulation import simulate, world_of
from bench.sim.swing import LASER_HEIGHT, Swing
from bench.sim.world import World, read_world
from slams.scan.end_points import EndPoints
from slams.scan.params import ScanParams
from slams.types import IDENTITY, Pose2

CELL = 0.05


def world_from(text, resolution=CELL, origin=(0.0, 0.0)):
    """A world drawn with # for walls and ? for unknown, first line on top."""
    cells = np.array([list(line) for line in text.split()])[::-1]
    return World(cells == "#", cells == "?", resolution, origin)


def test_grazing_a_wall_sees_past_it_and_touching_it_does_not():
    world = world_from(".......... ....##.... ..........", resolution=1.0)
    just_above, just_below = 2.0 + 1e-9, 2.0 - 1e-9
    grazing = world.cast(np.array([[0.5, just_above, 0.0], [0.5, just_below, 0.0]]))
    assert grazing[0] == math.inf
    assert grazing[1] == pytest.approx(3.5, abs=1e-12)


def test_no_ray_slips_through_the_very_corner():
    occupied = np.eye(40, dtype=bool)[::-1]
    world = World(occupied, np.zeros_like(occupied), 1.0, (0.0, 0.0))
    rng = np.random.default_rng(0)
    start = rng.uniform(0.0, 18.0, (5000, 2))
    corner = rng.integers(5, 36, 5000)[:, None]
    to = np.hstack([corner, 40 - corner]) - start
    rays = np.column_stack([start, np.arctan2(to[:, 1], to[:, 0])])
    assert np.isfinite(world.cast(rays)).all()


def test_inside_a_wall_beyond_the_map_in_an_empty_one_and_through_unknown_cells():
    occupied = np.ones((40, 60), bool)
    occupied[2:-2, 2:-2] = False
    world = World(occupied, np.zeros_like(occupied), CELL, (-1.0, -0.5))
    assert world.cast(np.array([[-0.99, 0.0, 0.3], [-5.0, 0.0, 0.3]])).tolist() == [0.0, math.inf]
    empty = World(np.zeros((4, 4), bool), np.zeros((4, 4), bool), CELL, (0.0, 0.0))
    assert empty.cast(np.array([[0.1, 0.1, 1.0]]))[0] == math.inf
    world = world_from("..?.# ..?.# ..?.#", resolution=1.0)
    assert world.cast(np.array([[0.5, 1.5, 0.0]]))[0] == pytest.approx(3.5)


def naive_cast(occupied, resolution, origin, ray):
    """Nearest entry into any occupied square, by the slab method over all of them."""
    iy, ix = np.nonzero(occupied)
    best = math.inf
    for low_x, low_y in zip(origin[0] + ix * resolution, origin[1] + iy * resolution, strict=True):
        best = min(best, _entry(ray, low_x, low_y, resolution))
    return best


def _entry(ray, low_x, low_y, edge):
    x, y, angle = ray
    enter, leave = 0.0, math.inf
    for start, step, low in ((x, math.cos(angle), low_x), (y, math.sin(angle), low_y)):
        if step == 0.0:
            if not low <= start <= low + edge:
                return math.inf
            continue
        a, b = sorted(((low - start) / step, (low + edge - start) / step))
        enter, leave = max(enter, a), min(leave, b)
    return enter if enter <= leave else math.inf


@pytest.mark.parametrize("density", [0.005, 0.05, 0.4])
def test_cast_rays_equals_its_naive_twin(density):
    rng = np.random.default_rng(7)
    occupied = rng.random((30, 40)) < density
    world = World(occupied, np.zeros_like(occupied), CELL, (0.31, -2.07))
    limits = ((0.32, 2.3), (-2.06, -0.58), (-4, 4))  # of x, y and the angle
    rays = np.column_stack([rng.uniform(*of, 200) for of in limits])
    rays[:40, 2] = 0.25 * math.pi * np.arange(40)  # along the axes and the diagonals
    expected = [naive_cast(occupied, CELL, world.origin, ray) for ray in rays]
    np.testing.assert_allclose(world.cast(rays), expected, rtol=0, atol=1e-9)


def test_grid_is_the_true_map():
    grid = world_from("#.? ..#", origin=(1.0, 2.0)).grid()
    np.testing.assert_array_equal(grid.p, [[0.0, 0.0, 1.0], [1.0, 0.0, np.nan]])
    assert (grid.resolution, grid.origin) == (CELL, (1.0, 2.0))


def test_picture(tmp_path):
    pixels = np.array([[0, 254, 205], [254, 254, 80]], np.uint8)
    cv2.imwrite(str(tmp_path / "map.pgm"), pixels)
    world = read_world(tmp_path / "map.pgm", 0.03)
    np.testing.assert_array_equal(world.occupied, [[0, 0, 1], [1, 0, 0]])
    np.testing.assert_array_equal(world.unknown, [[0, 0, 0], [0, 0, 1]])
    with pytest.raises(ValueError, match="--resolution"):
        read_world(tmp_path / "map.pgm")


@pytest.mark.parametrize(("seed", "resolution"), [(0, 0.02), (1, 0.025), (2, 0.03), (3, 0.04)])
def test_arena_has_no_seams(seed, resolution):
    """No gap between walls is one or two cells wide, every wall is at least two cells thick."""
    world = rescue_arena(np.random.default_rng(seed), size=12.0, resolution=resolution)
    walls = world.occupied.astype(np.uint8)
    closed = cv2.morphologyEx(walls, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) > 0
    inside = closed & ~world.unknown
    np.testing.assert_array_equal(inside, world.occupied)
    thin = [walls & ~np.roll(walls, 1, axis) & ~np.roll(walls, -1, axis) for axis in (0, 1)]
    assert sum(int((one & 1).sum()) for one in thin) < 0.002 * walls.sum()  # tips of slants


def test_a_swing_reaches_its_level_and_no_more():
    swing = Swing(10.0, np.random.default_rng(0))
    most = np.abs(swing.at(np.arange(0.0, 60.0, 0.01))).max(axis=0)
    np.testing.assert_allclose(most, math.radians(10.0), rtol=1e-3)


def test_a_beam_meets_the_next_ridge_or_passes_it():
    ramps = Ramps(20.0, np.random.default_rng(1))
    valley = RAMP_LENGTH * (1.0 - ramps.phases)
    rays = np.array([[*valley, 0.0]] * 3)
    ridge = ramps.slope * RAMP_LENGTH
    height, rise_by = np.array([0.5 * ridge, 1.1 * ridge, 0.2]), np.array([0.0, 0.0, -0.1])
    found = ramps.meet(rays, np.full(3, 6.0), rise_by, height)
    assert found[0] == pytest.approx(0.5 * RAMP_LENGTH, abs=0.01) and found[1] == math.inf
    assert found[2] == pytest.approx(0.2 / (ramps.slope + 0.1), abs=0.01)


def test_a_beam_that_leaves_an_open_world_is_followed_as_far_as_the_laser_sees():
    class Followed(Ramps):
        def meet(self, rays, walls, rise, height):
            self.walls = walls
            return super().meet(rays, np.minimum(walls, 100.0), rise, height)

    nothing = np.zeros((20, 20), bool)
    world, sensor = World(nothing, nothing, 0.1, (-1.0, -1.0)), SENSORS["utm30lx"]
    ramps = Followed(0.0, np.random.default_rng(0))
    still = Drive(np.array([0.0, 1.0]), np.zeros((2, 3)), np.zeros((2, 2)))
    chance = {"ranges": np.random.default_rng(0)}
    ranges = Measuring(Setting(), sensor, world, still, chance, ramps).scans(np.zeros(1), True)
    assert ramps.walls.max() == sensor.range_max and np.isinf(ranges).all()


def off_the_walls(log, world, leveled):
    """Distance [m] from the walls that nine of ten end points keep within."""
    points, found = EndPoints(ScanParams()), []
    for scan in log.rows(slice(None, None, 40)):
        if not leveled:
            object.__setattr__(scan, "attitude", None)
        points.read(scan, IDENTITY)
        pose = Pose2(*log.truth_at(np.array([scan.t]))[0])
        ends = pose.transform(points.points[:2, : points.n].T)
        found.append(world.gap[world.cells_of(ends)] * world.resolution)
    return float(np.percentile(np.concatenate(found), 90))


@pytest.mark.parametrize("made", ["tilt", "ramps", "degraded"])
def test_leveled_scans_lie_on_the_walls_of_the_world(made):
    tilts = {} if made == "degraded" else {made: 12.0}
    log = simulate(Setting(size=10.0, duration=20.0, **tilts)).select(every=4)
    log = log if tilts else degrade(log, "tilt", 12.0, 1)
    height = LASER_HEIGHT if tilts else 0.0
    assert (log.laser.mount_z, log.laser.above_floor) == (height, LASER_HEIGHT)
    points = EndPoints(ScanParams())
    for scan in log:
        points.read(scan, Pose2(0.3, 0.0, 0.0))
    assert points.counts["leveled"] == len(log), "no attitude is called wrong"
    world = world_of(log)
    assert off_the_walls(log, world, True) < 0.05 < 0.2 < off_the_walls(log, world, False)


def test_what_is_measured_is_good_to_a_third_of_a_degree():
    level = simulate(Setting(size=10.0, duration=20.0, sensor="lds01"))
    log = degrade(level, "tilt", 0.0, 1)
    assert 0.1 < np.degrees(log.attitude.values).std() < 0.5
    np.testing.assert_allclose(log.ranges, level.ranges)
    assert degrade(level, "tilt_unmeasured", 6.0, 1).attitude is None
