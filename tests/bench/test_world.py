"""Worlds, their maps and pictures, the arena builder, and exact ray casting."""

import math

import cv2
import numpy as np
import pytest

from bench.sim.maze import _blocks, rescue_arena
from bench.sim.world import World, read_world
from tests.bench import naive_world

CELL = 0.05


def world_from(text, resolution=CELL, origin=(0.0, 0.0)):
    """A world drawn with # for walls and ? for unknown, first line on top."""
    cells = np.array([list(line) for line in text.split()])[::-1]
    return World(cells == "#", cells == "?", resolution, origin)


def box_room(nx=60, ny=40, wall=2):
    occupied = np.ones((ny, nx), bool)
    occupied[wall:-wall, wall:-wall] = False
    return World(occupied, np.zeros_like(occupied), CELL, (-1.0, -0.5))


def rays_from(x, y, angles):
    return np.column_stack([np.full(len(angles), x), np.full(len(angles), y), angles])


def test_distances_in_a_box_room_are_analytic():
    world = box_room()
    x, y = 0.123, 0.456
    angles = np.linspace(-math.pi, math.pi, 2000, endpoint=False) + 1e-3
    with np.errstate(divide="ignore"):
        to_x = (np.where(np.cos(angles) > 0, -1.0 + 58 * CELL, -1.0 + 2 * CELL) - x) / np.cos(
            angles
        )
        to_y = (np.where(np.sin(angles) > 0, -0.5 + 38 * CELL, -0.5 + 2 * CELL) - y) / np.sin(
            angles
        )
    expected = np.minimum(to_x, to_y)
    np.testing.assert_allclose(world.cast(rays_from(x, y, angles)), expected, rtol=0, atol=1e-12)


def test_along_the_axes_and_the_diagonal():
    world = box_room()
    angles = np.array([0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi])
    expected = [1.9 - 0.4, 1.4 - 0.4, 0.4 + 0.9, 0.4 + 0.4]
    np.testing.assert_allclose(world.cast(rays_from(0.4, 0.4, angles)), expected, atol=1e-12)
    into_the_corner = world.cast(np.array([[-0.4, 0.1, -0.75 * math.pi]]))  # corner at -0.9, -0.4
    np.testing.assert_allclose(into_the_corner, [0.5 * math.sqrt(2.0)], atol=1e-12)


def test_grazing_a_wall_sees_past_it_and_touching_it_does_not():
    world = world_from(".......... ....##.... ..........", resolution=1.0)
    just_above, just_below = 2.0 + 1e-9, 2.0 - 1e-9
    grazing = world.cast(np.array([[0.5, just_above, 0.0], [0.5, just_below, 0.0]]))
    assert grazing[0] == math.inf
    assert grazing[1] == pytest.approx(3.5, abs=1e-12)


def test_no_ray_slips_between_squares_that_meet_at_a_corner():
    world = world_from("....# ...#. ..#.. .#... #....", resolution=1.0)
    starts = np.linspace(0.05, 0.95, 37)
    rays = np.column_stack([2.0 - starts, 2.0 - starts + 1.9, np.full(37, -0.25 * math.pi)])
    assert np.isfinite(world.cast(rays)).all()
    exactly = world.cast(np.array([[1.0, 3.0, -0.25 * math.pi], [0.0, 4.0, -0.25 * math.pi]]))
    np.testing.assert_allclose(exactly, [math.sqrt(2.0), 2.0 * math.sqrt(2.0)], atol=1e-9)


def test_no_ray_slips_through_the_very_corner():
    occupied = np.eye(40, dtype=bool)[::-1]
    world = World(occupied, np.zeros_like(occupied), 1.0, (0.0, 0.0))
    rng = np.random.default_rng(0)
    start = rng.uniform(0.0, 18.0, (5000, 2))
    corner = rng.integers(5, 36, 5000)[:, None]
    to = np.hstack([corner, 40 - corner]) - start
    rays = np.column_stack([start, np.arctan2(to[:, 1], to[:, 0])])
    assert np.isfinite(world.cast(rays)).all()


def test_from_inside_a_wall_nothing_lies_between_and_beyond_the_map_nothing_at_all():
    world = box_room()
    assert world.cast(np.array([[-0.99, 0.0, 0.3]]))[0] == 0.0
    assert world.cast(np.array([[-5.0, 0.0, 0.3]]))[0] == math.inf
    empty = World(np.zeros((4, 4), bool), np.zeros((4, 4), bool), CELL, (0.0, 0.0))
    assert empty.cast(np.array([[0.1, 0.1, 1.0]]))[0] == math.inf


def test_unknown_cells_let_a_ray_pass():
    world = world_from("..?.# ..?.# ..?.#", resolution=1.0)
    assert world.cast(np.array([[0.5, 1.5, 0.0]]))[0] == pytest.approx(3.5)


@pytest.mark.parametrize("density", [0.005, 0.05, 0.4])
def test_cast_rays_equals_its_naive_twin(density):
    rng = np.random.default_rng(7)
    occupied = rng.random((30, 40)) < density
    world = World(occupied, np.zeros_like(occupied), CELL, (0.31, -2.07))
    rays = np.column_stack(
        [rng.uniform(0.32, 2.3, 200), rng.uniform(-2.06, -0.58, 200), rng.uniform(-4, 4, 200)]
    )
    expected = [naive_world.cast(occupied, CELL, world.origin, ray) for ray in rays]
    np.testing.assert_allclose(world.cast(rays), expected, rtol=0, atol=1e-9)


def test_gap_is_the_chebyshev_distance():
    occupied = np.random.default_rng(3).random((25, 31)) < 0.01
    world = World(occupied, np.zeros_like(occupied), CELL, (0.0, 0.0))
    np.testing.assert_array_equal(world.gap, naive_world.gap(occupied))


def test_occlude_meets_the_near_side_of_a_disc():
    from bench.sim.world_kernels import occlude

    rays = np.array([[0, 0, 0.0], [0, 0.05, 0.0], [0, 0, 0.5], [0, 0, math.pi], [2.0, 0, 0.0]])
    discs = np.array([[[2.0, 0.0]], [[1.0, 0.0]]])  # at tick 0 and at tick 1
    out = np.full(5, 9.0)
    occlude(rays, np.array([0, 1, 0, 0, 0], np.int32), discs, 0.1, out)
    np.testing.assert_allclose(out, [1.9, 1.0 - math.sqrt(0.01 - 0.0025), 9.0, 9.0, 9.0])


def test_grid_is_the_true_map():
    grid = world_from("#.? ..#", origin=(1.0, 2.0)).grid()
    np.testing.assert_array_equal(grid.p, [[0.0, 0.0, 1.0], [1.0, 0.0, np.nan]])
    assert (grid.resolution, grid.origin) == (CELL, (1.0, 2.0))


def write_map(folder, pixels, head):
    cv2.imwrite(str(folder / "map.pgm"), np.array(pixels, np.uint8))
    (folder / "map.yaml").write_text(f"image: map.pgm\n{head}")
    return folder / "map.yaml"


HEAD = """resolution: 0.1
origin: [-1.0, 2.0, 0.0]
negate: {}
occupied_thresh: 0.65
free_thresh: 0.196
"""
PIXELS = [[0, 254, 205], [254, 254, 80]]


def test_map_server_map(tmp_path):
    world = read_world(write_map(tmp_path, PIXELS, HEAD.format(0)))
    np.testing.assert_array_equal(world.occupied, [[0, 0, 1], [1, 0, 0]])
    np.testing.assert_array_equal(world.unknown, [[0, 0, 0], [0, 0, 1]])
    assert (world.resolution, world.origin) == (0.1, (-1.0, 2.0))


def test_negated_map(tmp_path):
    pixels = 255 - np.array(PIXELS)
    world = read_world(write_map(tmp_path, pixels, HEAD.format(1)))
    np.testing.assert_array_equal(world.occupied, [[0, 0, 1], [1, 0, 0]])


def test_picture(tmp_path):
    write_map(tmp_path, PIXELS, "")
    world = read_world(tmp_path / "map.pgm", 0.03)
    np.testing.assert_array_equal(world.occupied, [[0, 0, 1], [1, 0, 0]])
    with pytest.raises(ValueError, match="--resolution"):
        read_world(tmp_path / "map.pgm")


@pytest.mark.parametrize(
    ("head", "message"),
    [
        ("resolution: 0.1\n", "no origin"),
        ("resolution: x\norigin: [0, 0, 0]\n", "not a number"),
        ("resolution: 0.1\norigin: [0, 0, 1.5]\n", "yaw 0"),
        ("resolution: -1\norigin: [0, 0, 0]\n", "expected a resolution above 0"),
        ("resolution: 0.1\norigin: [0, 0, 0]\nfree_thresh: low\n", "not a number"),
        ("origin: [0, 0\n", "not a YAML file"),
    ],
)
def test_a_bad_map_is_refused_in_one_line(tmp_path, head, message):
    with pytest.raises(ValueError, match=message) as caught:
        read_world(write_map(tmp_path, PIXELS, head))
    assert "\n" not in str(caught.value)


def test_a_file_that_is_no_picture_is_refused(tmp_path):
    (tmp_path / "map.png").write_text("no picture")
    with pytest.raises(ValueError, match="not a picture"):
        read_world(tmp_path / "map.png", 0.05)


def arena(seed, **options):
    return rescue_arena(np.random.default_rng(seed), **options)


@pytest.mark.parametrize(("seed", "resolution"), [(0, 0.02), (1, 0.025), (2, 0.03), (3, 0.04)])
def test_arena_has_no_seams(seed, resolution):
    """No gap between walls is one or two cells wide, every wall is at least two cells thick."""
    world = arena(seed, size=12.0, resolution=resolution)
    walls = world.occupied.astype(np.uint8)
    closed = cv2.morphologyEx(walls, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) > 0
    inside = closed & ~world.unknown
    np.testing.assert_array_equal(inside, world.occupied)
    thin = [walls & ~np.roll(walls, 1, axis) & ~np.roll(walls, -1, axis) for axis in (0, 1)]
    assert sum(int((one & 1).sum()) for one in thin) < 0.002 * walls.sum()  # tips of slants


@pytest.mark.parametrize("seed", range(5))
def test_blocks_never_part_the_lanes(seed):
    lane = np.ones((1, 60), bool)
    left = lane & ~_blocks(lane, np.random.default_rng(seed))
    assert cv2.connectedComponents(left.astype(np.uint8), connectivity=4)[0] == 2


def test_arena_looks_like_one():
    """Mostly lanes, a tenth or so of walls and elements."""
    world = arena(0)
    share = world.occupied.sum() / (world.occupied | world.free).sum()
    assert 0.08 < share < 0.3
