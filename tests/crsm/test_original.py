"""The published program: kernels against naive twins and hand examples, and against its traces."""

import math

import numpy as np
import pytest

import slams
from crsm.original import Original, OriginalParams
from crsm.original import map_kernels as byte_map
from crsm.original import match_kernels as lattice
from crsm.original import scan_kernels as picker
from crsm.original.map import FOOTPRINT_VALUE, ByteMap
from crsm.original.scan import RayPicker
from slams.jit import njit
from slams.types import IDENTITY, Pose2
from tests.crsm import naive
from tests.rooms import ROOM, cast, laser

LASER = laser(361)


def test_the_robots_footprint_is_free_at_the_start():
    grid = ByteMap(OriginalParams(robot_width=0.4, robot_length=0.6))
    grid.draw_footprint(Pose2(0.2, 0.0, 0.0))
    rows, columns = np.nonzero(grid.cells == FOOTPRINT_VALUE)
    x, y = (int(v) for v in grid.origin)
    w, h, back = (int(v / grid.params.cell / 2 + 1e-9) for v in (0.6, 0.4, 0.4))
    assert (columns.min(), columns.max()) == (x - back - w, x - back + w - 1)
    assert (rows.min(), rows.max()) == (y - h, y + h - 1)


@pytest.mark.parametrize("level", [100.0, 5.0, -3.0])
def test_published_rays_equal_the_naive_selection(level):
    rng = np.random.default_rng(1)
    d = cast(ROOM, IDENTITY, LASER) + rng.normal(0.0, 0.01, LASER.n_beams)
    d[100:104] = 0.0
    picked = np.zeros(len(d), np.bool_)
    density, longest = picker.range_changes(d, 0.3, 29.95, picked)
    count = picker.pick_between(d, level, 29.5, longest, picked)
    picker.fill_gaps(25, picked)
    rays, expected, mean = naive.critical_rays(d, 30.0, 0.3, level)
    assert np.flatnonzero(picked).tolist() == rays
    assert count == expected
    assert density == pytest.approx(mean)


@pytest.mark.parametrize("disparity", [40, 43])
def test_fast_search_takes_the_step_of_the_published_loop(disparity):
    rng = np.random.default_rng(5)
    grid = rng.integers(0, 256, (300, 300)).astype(np.uint8)
    ends = rng.integers(-80, 80, (40, 2))
    draws = rng.integers(0, disparity, (3000, 3)).astype(np.int16)
    table, step = np.zeros(grid.shape, np.int16), np.zeros(3)
    lattice.score_table(grid, (0, 0, 300, 300), table)
    slam = Original(OriginalParams(disparity=disparity))
    slam._allocate(RayPicker(slam.params, laser(40)))
    start = (3.0, -2.0, 0.3, 150.0, 150.0)
    ends32, buffers = ends.astype(np.float32), slam._buffers
    f = lattice.hill_climb(table, ends32, 40, start, draws, disparity, buffers, step)

    def score(s):
        return naive.fitness(grid, ends, (3 + s[0], -2 + s[1], 0.3 + s[2]), (150, 150))

    expected, best = naive.hill_climb(score, draws, disparity)
    assert step == pytest.approx(expected, abs=1e-6)
    assert f == pytest.approx(best, abs=1e-5)
    lattice.hill_climb.py_func(table, ends32, 40, start, draws, disparity, buffers, step)


@pytest.mark.parametrize("lidar", [LASER, laser(1440, fov=2.0 * math.pi * 1439 / 1440)])
def test_published_map_update_equals_the_naive_one(lidar):
    d = cast(ROOM, IDENTITY, lidar)
    d[7] = 0.0
    ends, clean = np.zeros((len(d), 2), np.int64), np.zeros(len(d))
    picker.clean(d.astype(np.float32), lidar.directions, (0.1, 30.0, 0.02), clean, ends)
    grid = np.full((700, 700), 127, np.uint8)
    tables = np.zeros((3, 256), np.int64)
    byte_map.intensity_tables(0.2, 40.0, 120.0, tables)
    a = lidar.angles + 0.1
    directions = np.stack((np.cos(a), np.sin(a)), axis=1)
    expected = grid
    for _ in range(2):
        expected = naive.draw(expected, clean, lidar.angles, (300, 310, 0.1), 0.02, 0.2, 40, 3)
        byte_map.draw(
            clean, ends, directions, lidar.angle_increment, (300.0, 310.0), 0.02, tables, grid
        )
    assert (grid == expected).all()


class LibcRandom:
    """The draws of a C program that never seeds rand(): additive feedback, r31 + r3."""

    def __init__(self):
        r = [1]
        for _ in range(30):
            r.append(16807 * r[-1] % (2**31 - 1))
        self._ring, self._at = np.array([*r, *r[:3]], np.int64), np.full(1, 34)
        self.integers(0, 1, 310)

    def integers(self, low, high, shape, dtype=np.int64):
        out = np.zeros(shape, dtype)
        libc_draws(self._ring, self._at, high, out.reshape(-1))
        return out


@njit(inner=True)
def libc_draws(ring, at, high, out):
    for k in range(out.size):
        i = at[0]
        ring[i % 34] = (ring[(i - 31) % 34] + ring[(i - 3) % 34]) & 0xFFFFFFFF
        out[k] = (ring[i % 34] >> 1) % high
        at[0] = i + 1


def test_original_takes_the_steps_of_the_program_with_its_random_numbers(shared_data):
    path = shared_data("reference/robocup/crsm_s1.csv.gz")
    expected = np.loadtxt(path, delimiter=",", usecols=(1, 2, 3))
    log = slams.load(shared_data("data/robocup/robocup.npz")).select(100, odometry=False)
    slam = Original(OriginalParams())
    slam._rng = LibcRandom()
    poses = np.array([slam.update(scan) for scan in log])
    assert np.abs(poses[40:]).max() > 0.2  # it has left the start
    assert np.abs(poses - expected[: len(poses)]).max() < 1e-6
