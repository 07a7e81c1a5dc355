import math
from dataclasses import replace

import numpy as np
import pytest

from bench.judge.metrics import common_with
from bench.sim.degrade import degrade
from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from gmapping import GMappingParams
from gmapping.mover_kernels import moving
from gmapping.movers import MARGIN, MOST, SECONDS, Movers
from gmapping.scan import View
from slams.motion.track import Track
from slams.registry import find
from slams.types import IDENTITY, Pose2
from tests.gmapping.scenes import LASER, make_scan, run

STEP = 0.01  # rad
SURE = np.zeros((3, 3))
BOX = np.array(  # 8 m x 6 m
    [[-4.0, -3.0, 4.0, -3.0], [4.0, -3.0, 4.0, 3.0], [4.0, 3.0, -4.0, 3.0], [-4.0, 3.0, -4.0, -3.0]]
)


def post(x, y, half=0.05):
    """A square leg."""
    a, b, c, d = x - half, x + half, y - half, y + half
    sides = [[a, c, b, c], [b, c, b, d], [b, d, a, d], [a, d, a, c]]
    return np.concatenate([BOX, np.array(sides)])


def seen(walls, pose=IDENTITY, t=0.0):
    return make_scan(pose, t, walls=walls)


def taken(scan):
    view = View(GMappingParams())
    return view.take(scan, IDENTITY)


def matched_at(pose):
    track = Track(GMappingParams())
    track.pose = pose
    return track


def witness(scan, pose=IDENTITY):
    movers, view = Movers(idle=False), taken(scan)
    assert movers.drop(view, scan, pose, SURE) is scan  # nothing is remembered
    movers.remember(scan, matched_at(pose))
    return movers


def earlier(*ranges, x=0.0, heading=0.0):
    """Scans of 101 beams from -0.5 to 0.5 rad, every beam of one range."""
    lasers = np.array([[x, 0.0, math.cos(heading), math.sin(heading)]] * len(ranges))
    return lasers, np.array([[r] * 101 for r in ranges], np.float32), -0.5, STEP


def moved(pieces, witnesses, doubt=(0.15, 0.0, 0.0), pose=(0.0, 0.0, 0.0), mount=(0.0, 0.0, 0.0)):
    pieces, out = np.array(pieces, np.float64), np.zeros(len(pieces), np.bool_)
    return moving(pieces, pose, mount, witnesses, doubt, out), out.tolist()


LEG = [[2.0, 0.0, -1.0, 0.0, 3.0], [2.02, 0.05, -1.0, 0.0, 2.0]]


@pytest.mark.parametrize(
    ("witnesses", "moves"),
    [
        (earlier(3.0), True),  # went on a meter behind it
        (earlier(2.1), False),  # within the margin
        (earlier(0.0), False),  # nothing came back
        (earlier(1.0), False),  # something stood in between
        (earlier(1.0, 3.0), True),  # one witness is enough
        (earlier(3.0, x=5.0, heading=math.pi), False),  # 3 m away, and no farther
        (earlier(4.0, x=5.0, heading=math.pi), True),  # the same beams, from behind
        (earlier(3.0, heading=1.0), False),  # looked elsewhere
    ],
)
def test_a_thing_moves_where_beams_went_through_before(witnesses, moves):
    assert moved(LEG, witnesses) == ((5.0 if moves else 0.0), [moves, moves])


def test_a_thing_moves_as_a_whole_if_enough_of_it_does():
    half = earlier(3.0)
    half[1][0, 52:] = 1.0  # what lies at y > 0 was hidden
    assert moved(LEG, half) == (5.0, [True, True])
    few = [[2.0, 0.0, -1.0, 0.0, 1.0], [2.02, 0.05, -1.0, 0.0, 4.0]]  # a fifth of the beams
    assert moved(few, half) == (0.0, [False, False])


def test_all_three_beams_have_to_have_gone_through():
    for beam in (49, 50, 51):
        edge = earlier(3.0)
        edge[1][0, beam] = 1.9
        assert moved(LEG[:1], edge) == (0.0, [False])


def test_walls_are_no_things_and_coarse_lasers_no_witnesses():
    wall = [[2.0, 0.1 * k, -1.0, 0.0, 2.0] for k in range(-4, 5)]  # 0.8 m
    assert moved(wall, earlier(3.0))[0] == 0.0
    two = [*LEG, [2.0, 0.5, -1.0, 0.0, 1.0]]  # another thing; its beam is at 0.245 rad
    beside = earlier(3.0)
    beside[1][0, 70:] = 1.0
    assert moved(two, beside) == (5.0, [True, True, False])
    lasers, ranges, _, _ = earlier(3.0)
    assert moved(LEG, (lasers, ranges, -2.55, 0.051))[0] == 0.0  # beams 10.2 cm apart there
    assert moved(LEG, (lasers, ranges, -2.45, 0.049))[0] == 5.0


def test_a_laser_that_turns_the_other_way_or_all_around_finds_its_beams():
    lasers, ranges, _, _ = earlier(3.0)
    assert moved(LEG, (lasers, ranges, 0.5, -STEP))[0] == 5.0
    assert moved(LEG, (lasers, ranges, 2.0 * math.pi - 0.5, STEP))[0] == 5.0


def test_pieces_are_seen_in_the_map_by_the_pose():
    behind = earlier(3.0, x=5.0, heading=math.pi / 2)  # looks along +y from (5, 0)
    assert moved(LEG, behind, pose=(5.0, 0.0, math.pi / 2))[0] == 5.0  # the leg is at (5, 2)
    assert moved(LEG, behind)[0] == 0.0


def test_a_leg_that_came_is_left_out_of_view_and_scan():
    movers, scan = witness(seen(BOX)), seen(post(1.0, 0.0), t=0.1)
    view = taken(scan)
    beams, hits = view.beams, np.count_nonzero(scan.ranges < 1.2)
    rest = movers.drop(view, scan, IDENTITY, SURE)
    assert hits > 5
    assert np.count_nonzero(scan.ranges < 1.2) == hits  # the given scan is as it was
    np.testing.assert_array_equal(rest.ranges == 0.0, scan.ranges < 1.2)
    assert beams - view.beams == pytest.approx(hits, abs=2)
    assert view.beams == view.pieces[:, 4].sum()
    assert (np.hypot(*view.pieces[:, :2].T) > 1.2).all()
    twice = seen(post(1.0, 0.0), t=0.2)
    movers.remember(twice, matched_at(IDENTITY))  # within SECONDS of the other: not kept
    assert movers.drop(taken(twice), twice, IDENTITY, SURE) is not twice


def test_what_stood_there_before_stays():
    scan = seen(post(2.0, 0.0))
    movers, view = witness(scan), taken(scan)
    assert movers.drop(view, scan, IDENTITY, SURE) is scan


@pytest.mark.parametrize(
    ("doubt", "moves"),
    [
        ((0.15, 0.09, 0.0), True),
        ((0.15, 0.11, 0.0), False),  # beside: other beams
        ((0.15, 0.0, 0.04), True),  # 0.08 m at 2 m
        ((0.15, 0.0, 0.06), False),
        ((0.15, 0.06, 0.03), False),  # both together
        ((1.1, 0.0, 0.0), False),
    ],
)
def test_beams_tell_nothing_where_the_doubt_leads_to_others(doubt, moves):
    assert moved(LEG[:1], earlier(3.0), doubt)[1] == [moves]


def test_where_the_pose_is_in_doubt_nothing_moves():
    movers, scan = witness(seen(BOX)), seen(post(3.6, 0.0), t=0.1)  # 0.45 m before the wall
    doubt = np.diag([0.1**2, 0.0, 0.0])  # 3 x 0.1 m + MARGIN
    assert MARGIN < 0.45 < MARGIN + 0.3 + 1e-9
    assert movers.drop(taken(scan), scan, IDENTITY, doubt) is scan
    assert movers.drop(taken(scan), scan, IDENTITY, SURE) is not scan


def test_where_most_is_contradicted_the_pose_is_wrong():
    around = np.concatenate([post(1.0 * math.cos(a), 1.0 * math.sin(a), 0.2) for a in range(6)])
    movers, scan = witness(seen(BOX)), seen(around, t=0.1)
    view = taken(scan)
    assert np.count_nonzero(scan.ranges < 1.3) > MOST * len(scan.ranges)
    assert movers.drop(view, scan, IDENTITY, SURE) is scan


def test_witnesses_are_matched_scans_half_a_second_apart_of_one_laser_and_one_map():
    movers, scan, lost = Movers(idle=False), seen(BOX), matched_at(IDENTITY)
    lost.state = "lost"
    assert movers.drop(taken(scan), scan, IDENTITY, SURE) is scan
    movers.remember(scan, lost)
    came = seen(post(2.0, 0.0), t=SECONDS + 0.1)
    assert movers.drop(taken(came), came, IDENTITY, SURE) is came
    movers.remember(scan, matched_at(IDENTITY))
    assert movers.drop(taken(came), came, IDENTITY, SURE) is not came
    movers.forget()
    assert movers.drop(taken(came), came, IDENTITY, SURE) is came
    movers.remember(scan, matched_at(IDENTITY))
    other = make_scan(IDENTITY, 1.0, type(LASER)(-1.5, 0.01, 301, 0.1, 30.0), walls=post(2.0, 0.0))
    assert movers.drop(taken(other), other, IDENTITY, SURE) is other
    idle = Movers(idle=True)
    idle.remember(scan, matched_at(IDENTITY))
    assert idle.drop(taken(came), came, IDENTITY, SURE) is came


@pytest.mark.parametrize("nothing", [np.inf, LASER.range_max, np.nan])
def test_beams_without_return_are_no_witnesses(nothing):
    ranges, came = np.full(LASER.n_beams, nothing, np.float32), seen(post(2.0, 0.0), t=0.1)
    movers = witness(replace(seen(BOX), ranges=ranges))
    assert movers.drop(taken(came), came, IDENTITY, SURE) is came


def rested():
    """A robot at rest in the box, sure of its pose after a second."""
    entry = find("gmapping")
    slam = entry.cls(entry.params().replace(n_particles=2))
    for i in range(20):
        slam.update(seen(BOX, t=0.05 * i))
    return slam


def test_what_moves_tells_nothing_of_walls(monkeypatch):
    slam, given = rested(), []
    matched = slam._track.matched

    def spied(pose, information, scan, rough):
        given.append(scan.ranges)
        matched(pose, information, scan, rough)

    monkeypatch.setattr(slam._track, "matched", spied)
    came = seen(post(1.0, 0.0), t=1.0)
    slam.update(came)
    np.testing.assert_array_equal(given[0] == 0.0, came.ranges < 1.2)


def test_witnesses_end_where_the_pose_leaps():
    closes, placed, came = rested(), rested(), seen(post(2.0, 0.0), t=1.0)

    def moves(slam):
        return slam._movers.drop(taken(came), came, IDENTITY, SURE) is not came

    assert moves(closes) and moves(placed)
    closes.particles.poses[1, 1] += 0.3
    closes.particles.lifetime[1] += closes.params.switch_margin + 1.0
    closes._elect()
    placed._place(IDENTITY)  # the map it is found in may be another
    assert not moves(closes) and not moves(placed)


def test_somebody_who_comes_along_a_bare_corridor_does_not_take_the_robot_along():
    walls = np.array([[-50.0, -1.0, 50.0, -1.0], [50.0, 1.0, -50.0, 1.0]])
    entry, rng = find("gmapping"), np.random.default_rng(1)
    slam = entry.cls(entry.params().replace(n_particles=2))
    for i in range(60):  # with all that is seen in the map this ends 1.17 m off
        true = Pose2(0.05 * i, 0.0, 0.0)
        legs = [post(8.0 - 0.1 * i, y)[len(BOX) :] for y in (-0.15, 0.15)]
        scene = np.concatenate([walls, *legs])
        found = slam.update(make_scan(true, 0.1 * i, rng=rng, odometry=true, walls=scene))
        assert math.hypot(found.x - true.x, found.y - true.y) < 0.005
    assert slam.state == "matched"


def test_people_in_a_ring_of_corridors_do_not_take_the_particles_along():
    log = degrade(simulate(Setting("ring", seed=5, duration=20.0)), "people", 8.0, 5)
    log = log.select(every=4, odometry=False)
    found = common_with(log, log.t, run(log)[1])
    assert np.hypot(*(found.estimate - found.truth)[:, :2].T).max() < 0.1
