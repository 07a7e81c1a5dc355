"""Ground of old is found again where it is clear, and only there."""

import math

import numpy as np
import pytest

from slams.localize import old_ground
from slams.localize.old_ground import OldGround, empty_ground, search
from slams.localize.old_ground_kernels import fits, show
from slams.localize.places import ends_of
from slams.types import IDENTITY, Pose2
from tests.rooms import CORRIDOR, ROOM, laser, scan_at

LIDAR = laser(361)
HALF = np.array((2.0, 2.0, 0.1))
TRUE = Pose2(0.5, 0.3, 0.4)


def ground(segments, places=((0.0, 0.0, 0.0), (1.0, -1.0, 2.0), (-1.0, 1.0, 4.0))):
    seen = empty_ground(-12.0, -12.0, 480)
    for at in (Pose2(*place) for place in places):
        ends = at.transform(ends_of(scan_at(at, LIDAR, segments)))
        near = ends[np.hypot(*ends.T) < 11.0]
        show(seen, np.column_stack([near, np.tile((at.x, at.y), (len(near), 1))]))
    return seen


def points(segments, pose=TRUE):
    return np.ascontiguousarray(ends_of(scan_at(pose, LIDAR, segments))[::5])


def drifted(pose, x=1.2, y=-0.7, turn=0.05):
    return Pose2(pose.x + x, pose.y + y, pose.theta + turn)


def test_a_pose_that_drifted_is_found_on_ground_of_old():
    found = search(ground(ROOM), points(ROOM), drifted(TRUE), HALF)
    assert found is not None and found.whole
    assert math.hypot(found.pose.x - TRUE.x, found.pose.y - TRUE.y) < 0.07
    assert abs(found.pose.theta - TRUE.theta) < 0.01


def test_who_is_where_old_ground_has_him_stays():
    assert search(ground(ROOM), points(ROOM), TRUE, HALF) is None


def in_a_corridor(pose, far=6.0, places=(-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0), half=HALF):
    """A scan of a bare corridor as far as that, looked for in what was seen of it before."""
    ahead = points(CORRIDOR, IDENTITY)
    ahead = np.ascontiguousarray(ahead[np.hypot(*ahead.T) < far])
    seen = empty_ground(-12.0, -12.0, 480)
    for x in places:
        ends = ahead + np.array((x, 0.0))
        show(seen, np.column_stack([ends, np.tile((x, 0.0), (len(ends), 1))]))
    return search(seen, ahead, pose, half)


@pytest.mark.parametrize("y", [0.5, -0.7])
def test_along_a_bare_corridor_only_the_part_across_is_clear(y):
    found = in_a_corridor(Pose2(1.2, y, 0.04))
    assert found is not None and not found.whole
    assert found.pose.x == pytest.approx(1.2, abs=0.01)
    assert found.pose.y == pytest.approx(0.0, abs=0.05)
    assert found.pose.theta == pytest.approx(0.0, abs=0.02)


def test_who_has_slipped_along_a_corridor_stays():
    assert in_a_corridor(Pose2(1.2, 0.0, 0.0)) is None


def test_a_corridor_beside_an_old_one_is_new_ground():
    wide = np.array((4.0, 4.0, 0.1))
    assert in_a_corridor(Pose2(1.2, 3.4, 0.0), half=wide) is None
    assert in_a_corridor(Pose2(1.2, 0.7, 0.0), half=wide) is not None


def test_where_the_old_part_of_a_corridor_ends_nothing_is_clear():
    for x, clear in ((0.5, True), (2.6, False)):
        assert (in_a_corridor(Pose2(x, 0.6, 0.0), far=4.0, places=(-1.0, 0.0)) is not None) == clear


def test_who_sees_mostly_new_ground_is_not_moved():
    here = points(ROOM)
    new = np.full_like(here, 20.0)
    assert search(ground(ROOM), np.concatenate([here, new[:20]]), drifted(TRUE), HALF) is not None
    assert search(ground(ROOM), np.concatenate([here, new]), drifted(TRUE), HALF) is None


def test_places_alike_on_a_line_leave_the_way_across():
    along = np.array([[1.0, 0.5], [-2.0, -1.0], [3.0, 1.4]])
    side = old_ground._across(along)
    assert side is not None and abs(side @ (1.0, 0.5)) < 0.05
    assert old_ground._across(np.array([[1.0, 0.5], [-1.0, 1.0]])) is None


def test_two_rooms_alike_within_reach_are_one_too_many():
    alike = np.concatenate([ROOM / 4.0, ROOM / 4.0 + np.array((0.0, 3.0, 0.0, 3.0))])
    places = [(0.0, 0.0, 0.0), (0.0, 3.0, 0.0)]
    here, between = points(alike, IDENTITY), Pose2(0.0, 1.3, 0.0)
    assert search(ground(alike, places), here, between, HALF) is None
    assert search(ground(alike, places[:1]), here, between, HALF) is not None


def test_a_place_at_the_edge_of_what_is_looked_through_is_none():
    assert search(ground(ROOM), points(ROOM), drifted(TRUE), HALF * (0.6, 0.6, 1.0)) is None


def test_free_space_contradicts_and_the_unseen_says_nothing():
    seen, out = ground(ROOM), np.empty(1)
    for x, expected in ((0.3, -1.0), (11.0, 0.0)):
        fits(seen, np.array([[x, 0.3]]), np.zeros((1, 3)), out)
        assert out[0] == pytest.approx(expected, abs=0.01)


class StandIn:
    """A track that drives around a room, and is `off` when it is back."""

    def __init__(self):
        self.pose, self.corrections, self.state = IDENTITY, 0, "matched"

    def corrected(self, pose):
        self.pose, self.corrections = pose, self.corrections + 1


def driven(off, step=0.5, wheels=True, on=True, state="matched"):
    """Once around for 40 m, in a place of its own, then the way from the beginning again."""
    track, t = StandIn(), 0.0
    old, track.state = OldGround(track, on), state
    first = [Pose2(x, 0.0, 0.0) for x in np.arange(-2.0, 2.0, step)]
    away = [Pose2(100.0 + x, 0.0, 0.0) for x in np.arange(0.0, 40.0, step)]
    for k, true in enumerate([*first, *away, *first]):
        back = k >= len(first) + len(away)
        shift = off(k) if back and not track.corrections else (0.0, 0.0)
        track.pose, t = Pose2(true.x + shift[0], true.y + shift[1], 0.0), t + 1.0
        old.update(scan_at(true, LIDAR, ROOM, t=t, odometry=true if wheels else None))
        if track.corrections:
            return old, track, true
    return old, track, None


def test_the_same_correction_over_a_few_looks_is_believed():
    old, track, true = driven(lambda k: (0.5, 0.4))
    assert old.found == 1
    assert true is not None and math.hypot(track.pose.x - true.x, track.pose.y - true.y) < 0.05
    assert true.x >= -2.0 + old_ground.ALONG


def test_corrections_that_do_not_stand_are_not_believed():
    old, _, _ = driven(lambda k: (0.5, 0.4) if k % 2 else (-0.5, 0.4))
    assert old.found == 0


@pytest.mark.parametrize(
    "how", [{"wheels": False}, {"on": False}, {"step": 0.1}, {"state": "lost"}]
)
def test_without_wheels_or_lost_or_with_scans_close_by_nothing_changes(how):
    old, track, _ = driven(lambda k: (0.5, 0.4), **how)
    assert old.found == 0 and track.corrections == 0


@pytest.mark.parametrize(("whole", "widths"), [(False, [2.0, 2.0]), (True, [2.0, 0.3])])
def test_what_was_only_moved_across_is_looked_for_as_far_as_before(monkeypatch, whole, widths):
    """100 m of way since: 2 m to either side, until ground of old has been found again."""
    looked = []

    def found(_ground, _points, pose, half):
        looked.append(half[0])
        return old_ground.Found(Pose2(pose.x - 0.5, pose.y, pose.theta), whole)

    monkeypatch.setattr(old_ground, "search", found)
    old, track, t = OldGround(StandIn(), True), None, 0.0
    track = old._track
    way = [*np.arange(0.0, 4.0, 0.5), *np.arange(110.0, 202.0, 2.0), *np.arange(0.0, 12.0, 0.5)]
    for x in way:
        track.pose, t = Pose2(x, 0.0, 0.0), t + 1.0
        at = Pose2(x if x < 20.0 else 0.0, 0.0, 0.0)
        old.update(scan_at(at, LIDAR, ROOM, t=t, odometry=track.pose))
    first = track.corrections and looked.index(looked[0])
    assert track.corrections > 0 and first == 0
    after = looked[old_ground.LOOKS + 1 :]
    assert [looked[0], after[0]] == pytest.approx(widths, abs=0.3)


def test_nobody_looks_farther_than_it_can_be_told(monkeypatch):
    looked = []
    monkeypatch.setattr(old_ground, "search", lambda g, p, pose, half: looked.append(half))
    old = OldGround(StandIn(), True)
    way = [*np.arange(0.0, 4.0, 0.5), *np.arange(110.0, 610.0, 4.0), *np.arange(0.0, 4.0, 0.5)]
    for k, x in enumerate(way):
        old._track.pose = Pose2(x, 0.0, 0.0)
        at = Pose2(x if x < 20.0 else 0.0, 0.0, 0.0)
        old.update(scan_at(at, LIDAR, ROOM, t=float(k), odometry=old._track.pose))
    assert looked and looked[-1][:2] == pytest.approx(old_ground.FARTHEST)
    assert old_ground.FARTHEST == 4.0 and looked[-1][2] == old_ground.FARTHEST_TURN
