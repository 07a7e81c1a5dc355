"""A room, scans in it, and maps of it."""

import math

import numpy as np

from gmapping import GMappingParams
from gmapping.map import TileMap
from gmapping.map_kernels import N_SURFACE_LAYERS, N_SURFACE_VALUES, SurfaceUpdate, insert
from gmapping.match_kernels import GaussNewton, Posterior, linearize, register
from gmapping.original.match_kernels import ClimbModel
from gmapping.render import Renderer
from gmapping.scan import View
from gmapping.scan_kernels import pieces
from gmapping.surfaces import SurfaceMatcher
from slams.types import IDENTITY, Laser, Pose2
from tests.rooms import box, made, scan_at

LASER = Laser(-0.75 * math.pi, math.radians(0.75), 361, 0.1, 30.0)
ROOM = np.array(  # segments x0, y0, x1, y1 [m]
    [
        *box(-2.0, -1.5, 4.0, 2.5),
        [1.5, 0.8, 2.2, 1.2],
        [2.2, 1.2, 1.9, 1.8],
        [1.9, 1.8, 1.5, 0.8],
    ]
)
UPDATE = SurfaceUpdate(2, 100.0, 1.001)  # a path length that is no float32
GAUSS_NEWTON = GaussNewton(0.1, 0.03, 12, 0.02**2, 0.0)  # no surface is old
NO_CANDIDATES = [], Renderer(0.05, 0.25, 1 << 20).counts
CLIMB = ClimbModel(0.05, 0.075, 0.05, 0.05, 5, 0.5, 0.0)


def seen(pose, laser=LASER, walls=ROOM, **known):
    """A scan of the room, without noise unless a generator is known."""
    return scan_at(pose, laser, walls, **{"noise": 0.01} | known)


def drive(n):
    """True poses on an arc and their scans; odometry stretches every step."""
    rng = np.random.default_rng(7)
    truth, wheels = [IDENTITY], [Pose2(5.0, -3.0, 1.0)]
    for i in range(n - 1):
        step = Pose2(0.02, 0.0, 0.03 * math.cos(0.05 * i))
        truth.append(truth[-1] @ step)
        wheels.append(wheels[-1] @ Pose2(1.05 * step.x, 0.0, 0.95 * step.theta))
    moves = enumerate(zip(truth, wheels, strict=True))
    return truth, [seen(at, rng=rng, t=0.1 * i, odometry=by) for i, (at, by) in moves]


def run(scans, preset="default", **changes):
    slam = made(f"gmapping@{preset}", **changes)
    return slam, np.array([slam.update(scan) for scan in scans])


def position_error(poses, truth):
    return np.hypot(*(poses[:, :2] - np.array(truth)[:, :2]).T)


def pieces_of(points, normals, mount=IDENTITY, grain=0.0, weight=1.0):
    """Pieces (k, 5) of end points (n, 2) with normals (n, 2), in the order of the scan."""
    points, normals = np.vstack([points.T, np.full((2, len(points)), weight)]), normals.T.copy()
    out = np.zeros((points.shape[1], 5))
    return out[: pieces(points, normals, points.shape[1], mount, grain, out)]


def surface_of(pose, laser=LASER, walls=ROOM):
    """Pieces of a scan without noise, one for each beam."""
    view = View(GMappingParams(grain=0.0, max_range=laser.range_max)).read(
        seen(pose, laser, walls), IDENTITY
    )
    return view.pieces.copy()


def view_of(pose, **changes):
    return View(GMappingParams(**changes)).read(seen(pose), IDENTITY)


def mapped(surface, pose=(0.0, 0.0, 0.0), n=1):
    tiles = TileMap(n, N_SURFACE_LAYERS, 0.05, 5000, n_values=N_SURFACE_VALUES)
    poses = np.tile(np.array(pose, float), (n, 1))
    assert insert(tiles.tiles, poses, surface, UPDATE) == 0
    return tiles


def linearized(tiles, pose, surface, scale=0.1, old_path_length=0.0):
    """H (3, 3), gradient (3,), cost, inlier beams, mean square distance, score of old surfaces."""
    h, out = np.zeros((3, 3)), np.zeros(7)
    linearize(posterior(tiles, surface), 0, np.array(pose, float), scale, old_path_length, h, out)
    return h, -out[:3], *out[3:]


def posterior(tiles, pieces, means=((0.0, 0.0, 0.0),), information=0.0, owners=(0,)):
    """`information` (3, 3) of the means, or one number: of x, y and theta each."""
    known = information * np.eye(3) if np.ndim(information) == 0 else np.array(information, float)
    return Posterior(tiles, np.array(owners), pieces, np.array(means, float), known)


def climb(of, starts, settings=GAUSS_NEWTON):
    """Peaks (k, 3), information (k, 3, 3) and `linearize`'s numbers (k, 7) there."""
    poses = np.array(starts, float)
    h, out = np.zeros((len(poses), 3, 3)), np.zeros((len(poses), 7))
    register(of, settings, poses, h, out)
    return poses, h, out


def matcher_of(*poses, **changes):
    """A matcher of as many particles; each has in its map what is seen from 0, put at its pose."""
    params = GMappingParams(n_particles=len(poses), max_tiles=5000, **changes)
    matcher = SurfaceMatcher(params)
    assert matcher.insert(view_of(IDENTITY), np.array(poses, float), 1.0)
    return matcher


def touched(maps):
    """The tables (ny, nx, particles, layers) of all tiles that were ever written to, a view."""
    y, x = np.nonzero(maps.tiles.written)
    return maps.tiles.tables[y.min() : y.max() + 1, x.min() : x.max() + 1]


def references_add_up(tiles):
    used = touched(tiles)[touched(tiles) > 0].astype(int)
    pointers, tiles = np.bincount(used, minlength=len(tiles.tiles.references)), tiles.tiles
    np.testing.assert_array_equal(pointers, tiles.references)
    free = tiles.free[1 : tiles.free[0] + 1]
    assert sorted(free) == (1 + np.flatnonzero(pointers[1:] == 0)).tolist()
