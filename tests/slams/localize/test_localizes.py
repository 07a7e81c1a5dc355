"""Localizing in a map that stays: the virtual drive, the hooks of every algorithm, the command."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import slams
from slams.formats.occupancy import write_map
from slams.localize import Localizer, Localizes, MapIndex, open_map, prepare
from slams.localize.distance_map import DistanceMap
from slams.localize.source import find_start, start_at
from slams.localize.virtual import build, ranges_at, scans_of, stations
from slams.params import Params
from slams.registry import find
from slams.state import save
from slams.test_world import ROOM, box, cast, drive, drive_poses, laser, scan_at
from slams.types import IDENTITY, Laser, OccupancyGrid, Pose2
from tests.floors import START, grid_of, seen, truth
from tests.rooms import command, labels, made, mirrored
from tests.test_readme_code import block
from tests.wheels import Drifting

OFFERING = [label for label in labels() if isinstance(made(label), Localizes)]


@pytest.fixture(scope="module")
def log():
    """A drive of `way`, its truth in the map's frame, that begins at START."""
    lidar = laser(361)
    whole = drive(n=40, lidar=lidar)
    return replace(whole, ranges=seen(40, lidar), truth=None, meta={"name": "room"})


def off_the_walls(points):
    """Distance of each point (n, 2) to the nearest wall of the room."""
    p, e = ROOM[:, :2], ROOM[:, 2:] - ROOM[:, :2]
    along = ((points[:, None] - p) * e).sum(axis=2) / (e * e).sum(axis=1)
    foot = p + np.clip(along, 0.0, 1.0)[..., None] * e
    return np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1)


def test_virtual_ranges_are_those_of_the_walls(room):
    for pose in ((0.0, 0.0, 0.0), (-3.0, 3.0, 2.0), (4.5, -2.5, -1.0)):
        fan = Laser(-math.pi, 0.01, 628, 0.1, 30.0)
        seen, true = ranges_at(room.distances, Pose2(*pose), fan), cast(ROOM, pose, fan)
        assert np.isfinite(seen).all()
        assert np.median(np.abs(seen - true)) < 0.03
        points = Pose2(*pose).transform(seen[:, None] * fan.directions)
        assert off_the_walls(points).max() < 0.075  # walls lie up to half a cell beside their cells
        assert not seen.flags.writeable and seen.dtype == np.float32


def test_a_wall_is_taken_to_be_in_the_middle_of_its_cells():
    p = np.zeros((40, 60), np.float32)
    p[:, 50] = p[35] = 1.0
    distances = DistanceMap(OccupancyGrid(p, 0.1, (-1.0, 2.0)))
    fan, single = Laser(0.0, math.pi / 4, 3, 0.1, 30.0), Laser(-math.pi / 2, 0.1, 1, 0.1, 30.0)
    ahead, aslant, aside = ranges_at(distances, Pose2(0.0, 3.03, 0.0), fan).tolist()
    assert (ahead, aside) == pytest.approx((4.05, 2.52), abs=1e-5)
    assert aslant == pytest.approx(2.52 * math.sqrt(2.0), abs=0.05)
    turned = ranges_at(distances, Pose2(0.0, 3.03, math.pi / 2), single)
    assert turned.tolist() == pytest.approx([4.05], abs=1e-5)


def test_out_of_reach_or_unknown_is_no_range():
    grid = grid_of(ROOM)
    grid.p[grid.p == 1.0] = np.where(np.arange((grid.p == 1.0).sum()) % 2, np.nan, 1.0)
    grid.p[:, 150:] = np.nan  # nobody has seen what is on the right
    distances = DistanceMap(grid)
    fan = Laser(0.0, 0.1, 2, 0.1, 30.0)
    assert np.isnan(ranges_at(distances, Pose2(0.0, 0.0, 0.0), fan)).all()
    near = Laser(0.0, 0.1, 2, 0.1, 1.0)
    assert np.isnan(ranges_at(DistanceMap(grid_of(ROOM)), Pose2(0.0, 0.0, 0.0), near)).all()


def test_the_places_of_a_virtual_drive_see_every_wall(room):
    distances, seen = room.distances, np.zeros(room.distances.occupied.shape, bool)
    places = stations(distances)
    assert 40 < len(places) < 90  # one for each square meter, in the middle of a cell
    assert (places - distances.origin) / distances.resolution % 1.0 == pytest.approx(0.5, abs=1e-6)
    steps = np.hypot(*np.diff(places, axis=0).T)
    assert np.median(steps) < 1.5
    for scan, pose in scans_of(distances):
        good = np.isfinite(scan.ranges)
        points = pose.transform(scan.ranges[good, None] * scan.laser.directions[good])
        ix, iy = np.floor((points - distances.origin) / distances.resolution).astype(int).T
        seen[iy, ix] = True
    facing = distances.occupied & (np.roll(distances.free, 1, 0) | np.roll(distances.free, -1, 0))
    assert seen[facing].mean() > 0.95


def test_a_virtual_drive_gives_an_algorithm_the_map_and_freezes_it(room):
    fake = Drifting(Params())
    origin = build(fake, room.distances)
    assert fake.frozen and not fake.places
    scans, poses = zip(*fake.inserted, strict=True)
    assert poses[0] == IDENTITY and len(poses) == len(stations(room.distances))
    assert all(b.t > a.t for a, b in zip(scans, scans[1:], strict=False))
    for scan, pose in fake.inserted[:3]:
        ends = (scan.ranges[:, None] * scan.laser.directions)[np.isfinite(scan.ranges)]
        assert room.distances.evaluate(ends, origin @ pose) >= (0.97, 0.0)


def test_poses_come_in_the_frame_of_the_map(room, log):
    fake, origin = Drifting(Params()), Pose2(-2.0, 1.0, 0.7)
    fake.used = 7  # scans of the drive that made the map
    fake.report = lambda: {"odometry": fake.used, "tiles": 7}
    localizer = Localizer(fake, room, START, origin)
    poses = [localizer.update(scan) for scan in log]
    ((scan, place),) = fake.places
    assert poses[0] == START and scan.t == 0.0
    assert origin @ place == pytest.approx(START)
    assert np.abs(np.array(poses)[:, :2] - truth()[:, :2]).max() < 0.1  # wheels drift
    assert localizer.map() is room.grid
    report = localizer.report()
    assert report["odometry"] == len(log) - 1 and report["tiles"] == 7
    assert report["explained"] > 0.9 and report["unlike"] == 0
    assert localizer.explained > 0.9 and math.isnan(localizer.quality)
    assert np.isinf(np.diag(localizer.covariance)).all()


def test_a_changed_world_is_told(room, log):
    localizer = Localizer(Drifting(Params()), room, START)
    for scan in log:
        localizer.update(scan_at(START, log.laser, mirrored(ROOM), t=scan.t))
    assert localizer.report()["explained"] < 0.5 and localizer.report()["unlike"] == 40


def test_covariances_turn_with_the_frame(room):
    fake = Drifting(Params())
    fake.covariance = np.diag([4.0, 1.0, 0.5])
    turned = Localizer(fake, room, START, Pose2(3.0, 1.0, math.pi / 2)).covariance
    assert turned == pytest.approx(np.diag([1.0, 4.0, 0.5]), abs=1e-12)
    fake.local_covariance = np.diag([0.4, 0.1, 0.05])  # a map that is given does not drift
    turned = Localizer(fake, room, START, Pose2(3.0, 1.0, math.pi / 2)).covariance
    assert turned == pytest.approx(np.diag([0.1, 0.4, 0.05]), abs=1e-12)


def prepared(label, room):
    slam = made(label)
    assert slam.frozen is False
    return slam, build(slam, room.distances)


@pytest.mark.parametrize("label", OFFERING)
def test_a_frozen_map_stays_and_the_poses_are_right(label, room, log):
    slam, origin = prepared(label, room)
    before = slam.map()
    localizer = Localizer(slam, room, START @ Pose2(0.02, -0.02, 0.01), origin)
    poses = np.array([localizer.update(scan) for scan in log])
    after = slam.map()
    assert np.array_equal(before.p, after.p, equal_nan=True) and before.origin == after.origin
    error = poses[5:] - truth()[5:]
    assert np.hypot(error[:, 0], error[:, 1]).max() < 0.05  # the map's cells are as large
    assert np.abs(error[:, 2]).max() < 0.01


@pytest.mark.parametrize("label", OFFERING)
def test_after_an_insertion_elsewhere_the_next_scan_goes_on_from_there(label, room, log):
    slam, origin = prepared(label, room)
    scans = list(log)
    for pose in (Pose2(4.0, 3.0, 1.0), START):
        slam.insert_at(scans[0], origin.between(pose))
    found = origin @ slam.update(scans[1])
    assert np.hypot(*(np.array(found[:2]) - truth()[1, :2])) < 0.05


@pytest.fixture
def files(tmp_path, log):
    write_map(tmp_path, grid_of(ROOM))
    log.save(tmp_path / "room.npz")
    return tmp_path


def localized(files, log, *more):
    """The exit code of hector in the map of this folder."""
    there = ("--localize", files / "map.yaml", "--out", files / "o", "--force")
    return command("hector", files / log, *there, *more)


def errors(folder):
    rows = np.loadtxt(folder / "trajectory.csv", delimiter=",", skiprows=1)
    return np.hypot(*(rows[:, 1:3] - truth()[-len(rows) :, :2]).T)


def test_a_run_localizes_in_a_map_of_map_server(files, capsys):
    assert localized(files, "room.npz") == 0
    said = capsys.readouterr().err
    assert "note: found at 0.3" in said and "explained) by scan 0 of 40" in said
    assert errors(files / "o").max() < 0.05 and len(errors(files / "o")) == 40
    report = json.loads((files / "o" / "summary.json").read_text())["report"]
    assert report["explained"] > 0.9
    assert localized(files, "room.npz", "--start=0.35,-0.2,0.4", "--limit", "9") == 0
    assert "% of the scan explained" in capsys.readouterr().err
    assert len(errors(files / "o")) == 9


class Own(Drifting):
    """An algorithm of a user that knows the room."""

    def map(self):
        return grid_of(ROOM)


class Bare(Drifting):
    """An algorithm without parameters to show, as the contract allows."""

    def __init__(self, params):
        super().__init__(params)
        del self.params


def test_a_run_localizes_by_an_algorithm_that_has_the_methods_alone(files):
    there = ("--localize", files / "map.yaml", "--start=0.3,-0.2,0.4", "--out", files / "o")
    assert command(f"{__name__}:Bare", files / "room.npz", *there) == 0


def test_an_algorithm_of_ones_own_localizes_in_its_state_with_its_parameters(files, log):
    label, state = f"{__name__}:Own", files / "own.state"
    words = (label, files / "room.npz", "-q", "--force", "--out", files / "o")
    assert command(*words, "--seed", "4", "--save-state", state) == 0
    assert command(*words, "--localize", state) == 0
    assert slams.LiveSlam(label, map=state, warm_up=False).params.seed == 4
    with pytest.raises(ValueError, match="saved with seed 4, got 0"):
        slams.LiveSlam(label, state=state, warm_up=False, seed=0)


def test_a_run_begins_at_the_scan_that_is_found(files, log, capsys):
    ranges = log.ranges.copy()
    ranges[:3] = np.nan
    type(log)(log.t, ranges, log.laser).save(files / "late.npz")
    assert localized(files, "late.npz") == 0
    assert "by scan 3 of 40" in capsys.readouterr().err
    assert len(errors(files / "o")) == 37 and errors(files / "o").max() < 0.05


def test_a_run_localizes_in_a_state_of_its_own_or_of_another(files, log):
    for label in ("hector", "tsd"):
        slam = made(label)
        for scan in log:
            slam.update(scan)
        save(slam, files / label)
        given = open_map(files / label)
        assert type(given.slam) is type(slam)
        ready = prepare(find("hector"), find("hector").params(), given)
        assert (ready.origin == IDENTITY) == (label == "hector") and ready.slam.frozen
        localizer = ready.at(start_at(ready.map_index, log, IDENTITY).pose)
        poses = np.array([localizer.update(scan) for scan in log])
        apart = poses - drive_poses(40, 0.05)
        assert np.hypot(apart[:, 0], apart[:, 1]).max() < 0.06, label


def test_what_is_never_sure_ends_with_the_likely_places(files, log):
    square = np.array(box(-2.0, -2.0, 2.0, 2.0))
    lidar = laser(361)
    ranges = np.array([cast(square, (0.5, 0.2, 0.1), lidar)] * 3)
    still = type(log)(log.t[:3], ranges.astype(np.float32), lidar)
    sentence = r"no certain pose in the map after all 3 scans \(most likely: "
    with pytest.raises(RuntimeError, match=sentence):
        find_start(MapIndex(grid_of(square)), still)
    write_map(files, grid_of(square))
    still.save(files / "still.npz")
    assert localized(files, "still.npz", "-q") == 1


@pytest.mark.parametrize("word", ["load_state(folder", "GlobalLocalizer(slam.map())", "map=state"])
def test_the_code_of_the_page_about_maps_runs(word):
    exec(block(word), scope := {"slams": slams})
    if "GlobalLocalizer" in word:
        assert math.hypot(*scope["found"].pose[:2]) < 0.1
    elif "map=" in word:
        apart = np.array(scope["estimate"].pose) - np.array(scope["on"].last.pose)
        assert scope["estimate"].found and np.abs(apart).max() < 0.05
    else:
        slam = slams.create("hector")
        assert [slam.update(scan) for scan in drive(n=30)][20:] == scope["poses"]
