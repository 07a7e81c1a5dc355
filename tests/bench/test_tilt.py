"""Tilted bodies: what their lasers meet, by hand, and that their attitudes bring the walls back."""

import math

import numpy as np
import pytest

from bench.sim.degrade import degrade
from bench.sim.drive import Drive
from bench.sim.measuring import Measuring
from bench.sim.ramps import LENGTH, Ramps
from bench.sim.sensors import SENSORS
from bench.sim.setting import Setting
from bench.sim.simulation import simulate, world_of
from bench.sim.swing import HEIGHT, WALLS, Swing, level_floor, ranges_of, rise, sway
from bench.sim.world import World
from slams.scan.end_points import EndPoints
from slams.scan.params import ScanParams
from slams.types import IDENTITY, Attitude, Pose2


def test_beams_point_where_the_rotation_turns_them():
    attitudes = np.array([[0.2, 0.0], [0.0, 0.3], [-0.1, 0.25]])
    for attitude in attitudes:
        for angle in (0.0, 1.0, -2.5):
            beam = np.array([math.cos(angle), math.sin(angle)])
            u, v, w = Attitude(*attitude).rotation() @ (*beam, 0.0)
            along, turn, slope = rise(beam[None], attitude[None])
            assert along[0] == pytest.approx(math.hypot(u, v))
            assert angle + turn[0] == pytest.approx(math.atan2(v, u)) and slope[0] == pytest.approx(
                w
            )


def test_a_beam_meets_wall_floor_or_nothing():
    slope = np.array([0.0, 0.1, -0.1, 0.5])
    along = np.sqrt(1.0 - slope**2)
    floor = level_floor(slope / along, 0.35)
    found = ranges_of(np.full(4, 4.0), floor, along, slope, 0.35)
    np.testing.assert_allclose(found, [4.0, 4.0 / along[1], 3.5, np.inf])
    assert 4.0 / along[3] * 0.5 > WALLS - 0.35


def test_a_laser_above_the_base_sways_as_the_rotation_moves_it():
    rays, attitude = np.array([[1.0, 2.0, 0.7]]), np.array([[0.2, -0.1]])
    x, y, z = Attitude(*attitude[0]).rotation() @ (0.0, 0.0, HEIGHT)
    expected = Pose2(1.0, 2.0, 0.7) @ Pose2(float(x), float(y), 0.0)
    assert sway(rays, attitude) == pytest.approx(z)
    assert rays[0] == pytest.approx(expected)


def test_a_swing_reaches_its_level_and_no_more():
    swing = Swing(10.0, np.random.default_rng(0))
    most = np.abs(swing.at(np.arange(0.0, 60.0, 0.01))).max(axis=0)
    np.testing.assert_allclose(most, math.radians(10.0), rtol=1e-3)


@pytest.mark.parametrize("heading", [0.0, 0.5 * math.pi, 2.5])
def test_a_body_stands_on_a_ramp_as_the_ramp_slopes(heading):
    """In the middle between ridge and valley all wheels are on one plane."""
    ramps = Ramps(15.0, np.random.default_rng(0))
    middle = LENGTH * (1.5 - ramps.phases)  # both waves rise there
    attitudes, base = ramps.stand(np.zeros(1), np.array([[*middle, heading]]))
    (roll, pitch), floor = attitudes[0], float(ramps.heights(middle[None])[0])
    forward, left, _ = Attitude(roll, pitch).rotation().T
    slopes = [axis[2] / math.hypot(axis[0], axis[1]) for axis in (forward, left)]
    toward = [ramps.slope * (math.cos(a) + math.sin(a)) for a in (heading, heading + math.pi / 2)]
    assert slopes[0] == pytest.approx(toward[0], rel=1e-6)
    assert slopes[1] == pytest.approx(toward[1], abs=0.03)  # aside of a nose that rises
    assert base[0] == pytest.approx(floor)
    assert ramps.slope * math.sqrt(2.0) == pytest.approx(math.tan(math.radians(15.0)))


def test_a_beam_meets_the_next_ridge_or_passes_it():
    ramps = Ramps(20.0, np.random.default_rng(1))
    valley = LENGTH * (1.0 - ramps.phases)
    rays = np.array([[*valley, 0.0]] * 3)
    ridge = ramps.slope * LENGTH
    height, rise_by = np.array([0.5 * ridge, 1.1 * ridge, 0.2]), np.array([0.0, 0.0, -0.1])
    found = ramps.meet(rays, np.full(3, 6.0), rise_by, height)
    assert found[0] == pytest.approx(0.5 * LENGTH, abs=0.01) and found[1] == math.inf
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
    ranges = Measuring(Setting(), sensor, world, still, chance, ramps).scans(np.zeros(1), None)
    assert ramps.walls.max() == sensor.range_max and np.isinf(ranges).all()


def off_the_walls(log, world, leveled):
    """Distance [m] from the walls that nine of ten end points keep within."""
    points, found = EndPoints(ScanParams()), []
    for scan in log.rows(slice(None, None, 40)):
        if not leveled:
            object.__setattr__(scan, "attitude", None)
        points.take(scan, IDENTITY)
        pose = Pose2(*log.truth_at(np.array([scan.t]))[0])
        ends = pose.transform(points.points[:2, : points.n].T)
        found.append(world.gap[world.cells_of(ends)] * world.resolution)
    return float(np.percentile(np.concatenate(found), 90))


def test_scans_from_ramps_are_leveled_and_no_attitude_is_called_wrong():
    log = simulate(Setting(size=10.0, duration=20.0, ramps=12.0)).select(every=4)
    points = EndPoints(ScanParams())
    for scan in log:
        points.take(scan, Pose2(0.3, 0.0, 0.0))
    assert points.counts["leveled"] == len(log)
    world = world_of(log)
    assert off_the_walls(log, world, True) < 0.05 < 0.2 < off_the_walls(log, world, False)


@pytest.mark.parametrize("made", ["simulated", "degraded"])
def test_leveled_scans_lie_on_the_walls_of_the_world(made):
    if made == "simulated":
        log = simulate(Setting(size=10.0, duration=8.0, tilt=12.0))
        assert log.laser.mount_z == log.laser.above_floor == HEIGHT
    else:
        log = degrade(simulate(Setting(size=10.0, duration=8.0)), "tilt", 12.0, 1)
        assert (log.laser.mount_z, log.laser.above_floor) == (0.0, HEIGHT)
    world = world_of(log)
    assert off_the_walls(log, world, True) < 0.05 < 0.2 < off_the_walls(log, world, False)


def test_what_is_measured_is_good_to_a_third_of_a_degree():
    level = simulate(Setting(size=10.0, duration=20.0, sensor="lds01"))
    log = degrade(level, "tilt", 0.0, 1)
    assert 0.1 < np.degrees(log.attitude.values).std() < 0.5
    np.testing.assert_allclose(log.ranges, level.ranges)
    assert degrade(level, "tilt_unmeasured", 6.0, 1).attitude is None
