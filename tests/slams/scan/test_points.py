"""End points: which are kept, how noisy they are, where their normals point, when they were."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slams.scan import range_noise, scan_kernels
from slams.scan.end_points import EndPoints
from slams.scan.moving_average import MovingAverage
from slams.scan.noise_kernels import beyond_chords
from slams.scan.params import ScanParams
from slams.scan.range_noise import ROUNDING_UNIT, rounding_step
from slams.types import IDENTITY, Laser, Pose2, Scan
from tests.rooms import laser, scan_at

GAP_THRESHOLD = 0.1


def points_of(*xy):
    rows = [(x, y, k, 1.0) for k, (x, y) in enumerate(xy)]
    return np.ascontiguousarray(np.array(rows, float).T)


def kept(points, step):
    """The numbers of the beams that have company."""
    spare = np.zeros_like(points)
    n = scan_kernels.remove_isolated(points, points.shape[1], IDENTITY, step, GAP_THRESHOLD, spare)
    return points[2, :n].astype(int).tolist()


def test_a_beam_without_company_is_left_out_unless_beams_are_far_apart():
    post = points_of((5.0, 0.0), (5.0, 0.02), (2.0, 0.05), (5.0, 0.06), (5.0, 0.08))
    assert kept(post.copy(), 0.004) == [0, 1, 3, 4]
    assert kept(post.copy(), 0.024) == [0, 1, 3, 4]  # a post of 0.15 m has more than three beams
    assert kept(post.copy(), 0.026) == [0, 1, 2, 3, 4]  # 0.052 m between two beams at 2 m


def test_a_wall_seen_aslant_has_company_up_to_four_times_the_spacing_of_its_beams():
    for apart, found in ((0.13, [1, 2, 3]), (0.15, [])):  # 0.1 m, and four times 0.01
        assert kept(points_of(*((2.5, apart * k) for k in range(-2, 3))), 0.004) == found


def test_where_most_beams_are_missing_their_neighbors_are_far_apart():
    ends = points_of(*((2.0 + 0.3 * k, 0.3 * k) for k in range(9)))
    assert kept(ends.copy(), 0.001) == []
    ends[2] *= 50.0
    assert kept(ends, 0.001) == [50 * k for k in range(9)]


def test_one_beam_beside_is_no_company_as_smoke_has_some():
    for together, expected in ((2, []), (3, [1, 2, 3])):
        ends = [(3.0 + 2.0 * k, 0.0) for k in range(6)]
        ends[1 : 1 + together] = [(2.0, 0.03 * k) for k in range(together)]
        assert kept(points_of(*ends), 0.001) == expected


def test_ranges_count_between_both_limits_and_carry_the_number_of_their_beam():
    lidar = Laser(0.0, 0.1, 5, 0.1, 30.0, Pose2(1.0, 2.0, 0.5 * math.pi))
    ranges, out = np.array([0.4, 0.6, np.nan, 4.9, 5.1], np.float32), np.zeros((4, 5))
    beams = ranges, lidar.directions, lidar.mount, (0.5, 5.0)
    for typical, weights in ((0.0, [1.0, 1.0]), (2.0, [4.0, (2.0 / 4.9) ** 2])):
        n, far = scan_kernels.end_points(*beams, typical, out)
        assert (n, out[2, :2].tolist()) == (2, [1.0, 3.0])
        assert out[3, :2] == pytest.approx(weights, rel=1e-6)
    expected = lidar.mount.transform((ranges[:, None] * lidar.directions)[[1, 3]].astype(float))
    assert pytest.approx(expected, rel=1e-6) == out[:2, :2].T
    assert far == pytest.approx(np.hypot(*expected.T).max())


def test_a_point_is_brought_along_the_arc_to_the_middle_of_the_sweep():
    points = points_of((2.0, 0.0), (2.0, 1.0), (2.0, 2.0))
    before = points.copy()
    scan_kernels.deskew(points, 3, Pose2(1.0, 0.2, 0.8), 0.05, 1.0)
    for k in range(3):
        t = 0.05 * (k - 1)
        half = Pose2(0.0, 0.0, 0.5 * 0.8 * t)
        x, y = half.transform(np.array([[1.0 * t, 0.2 * t]]))[0]
        there = Pose2(x, y, 0.8 * t).transform(before[:2, k][None])[0]
        assert points[:2, k] == pytest.approx(there)


def test_noise_is_what_is_left_of_straight_walls():
    rng, wall = np.random.default_rng(0), np.linspace(-1.0, 1.0, 301)
    points = np.stack([np.full(301, 2.0), wall, np.arange(301.0), np.ones(301)])
    out = np.zeros(301)
    for chord, n in ((0.1, 100), (0.01, 0)):
        assert beyond_chords(points, 301, IDENTITY, 0.0, (chord, 0.1), out) == n
    beyond_chords(points, 301, Pose2(0.5, 0.3, 0.0), 0.0, (0.1, 0.1), out)
    assert np.abs(out).max() < 1e-12
    lidar = laser(1441)
    for noise, found in ((0.02, 0.02), (0.3, 0.15), (0.0, 0.001)):
        ends = EndPoints(ScanParams())
        for k in range(30):
            ends.read(scan_at((0.0, 0.0, 0.0), lidar, noise=noise, rng=rng, t=0.1 * k), IDENTITY)
        assert ends.noise == pytest.approx(found, rel=0.15)


@pytest.mark.parametrize(
    ("noise", "step", "expected"),
    [
        (0.0, 0.1, 0.029),
        (0.05, 0.1, 0.058),
        (0.1, 0.2, 0.115),
        (0.1, 0.05, 0.1),
        (0.01, 1e-3, 0.01),
    ],
)
def test_noise_of_rounded_ranges_is_theirs_and_that_of_the_rounding(noise, step, expected):
    rng, lidar, ends = np.random.default_rng(0), laser(1441), EndPoints(ScanParams())
    for k in range(30):
        ranges = scan_at((0.1, 0.2, 0.3), lidar, noise=noise, rng=rng).ranges
        rounded = (step * np.round(ranges / step)).astype(np.float32)
        assert rounding_step(ranges) == ROUNDING_UNIT
        assert rounding_step(rounded) == pytest.approx(step)
        ends.read(Scan(0.1 * k, rounded, lidar), IDENTITY)
    assert ends.noise == pytest.approx(expected, rel=0.15)
    assert rounding_step(rounded[:5]) == 0.0


@pytest.mark.parametrize(("share", "constant"), [(0.01, 0.0), (0.01, 0.01), (0.0, 0.02)])
def test_noise_that_grows_with_the_range_weighs_the_beams(share, constant):
    rng, lidar, ends = np.random.default_rng(0), laser(721), EndPoints(ScanParams())
    for k in range(60):
        ranges = scan_at((0.1, 0.2, 0.3), lidar).ranges
        std = np.hypot(constant, share * ranges)
        noisy = (ranges + std * rng.normal(size=len(ranges))).astype(np.float32)
        ends.read(Scan(0.1 * k, noisy, lidar), IDENTITY)
        assert k > 10 or ends._noise.typical_range == 0.0, "few scans decide nothing"
    far, typical = np.hypot(*ends.points[:2, : ends.n]), ends._noise.typical_range
    if share < constant:
        assert typical == 0.0 and (ends.points[3] == 1.0).all()
        return
    assert ends.noise == pytest.approx(math.hypot(constant, share * typical), rel=0.15)
    assert 0.9 * far.mean() < typical < 1.2 * far.mean()
    expected = np.minimum((typical / far) ** 2, scan_kernels.MAX_WEIGHT)
    assert ends.points[3, : ends.n] == pytest.approx(expected, rel=0.01)


def test_the_median_is_that_of_a_normal_deviate_that_is_no_outlier():
    deviates = np.abs(np.random.default_rng(0).normal(size=2_000_000))
    found = np.median(deviates[deviates < range_noise.OUTLIER_DEVIATIONS])
    assert found == pytest.approx(range_noise.TRUNCATED_MEDIAN, abs=0.001)


def test_what_is_no_wall_is_no_noise():
    """Smoke in a small room: two of three beams end somewhere before the wall."""
    rng, lidar, ends = np.random.default_rng(0), laser(1441), EndPoints(ScanParams())
    for k in range(30):
        wall = 0.3 * scan_at(IDENTITY, lidar).ranges + rng.normal(0.0, 0.01, lidar.n_beams)
        struck = rng.random(lidar.n_beams) < 0.67
        short = np.where(struck, wall * rng.random(lidar.n_beams), wall)
        ends.read(Scan(0.1 * k, short.astype(np.float32), lidar), IDENTITY)
    assert ends.noise == pytest.approx(0.01, rel=0.5)


def noisy(beams, noise):
    """End points after ten scans of a noisy laser."""
    ends, rng = EndPoints(ScanParams()), np.random.default_rng(0)
    for k in range(10):
        ends.read(scan_at(IDENTITY, laser(beams), noise=noise, rng=rng, t=0.1 * k), IDENTITY)
    return ends


def test_noise_needs_ten_beams_whose_neighbors_are_no_farther_apart_than_on_a_slanted_wall():
    assert noisy(31, 0.06).noise == ScanParams().range_noise
    assert noisy(91, 0.06).noise == pytest.approx(0.06, rel=0.15)


def test_normals_are_those_of_a_total_least_squares_fit():
    x = np.linspace(-0.06, 0.06, 13)
    noise = np.random.default_rng(0).normal(0.0, 0.001, 13)
    points = np.stack([x, 2.0 + 0.3 * x + noise])
    out = normals_of(points, step=0.005)
    half = 2 + int(0.05 / (0.005 * math.hypot(*points[:, 6]) + 1e-6))
    _, vectors = np.linalg.eigh(np.cov(points[:, 6 - half : 7 + half]))
    normal = vectors[:, 0] * -np.sign(vectors[:, 0] @ points[:, 6])
    assert out[:2, 6] == pytest.approx(normal, abs=1e-6)


def test_the_window_of_a_normal_and_what_is_one_surface_grow_with_the_noise():
    nothing = Scan(0.0, np.zeros(9, np.float32), Laser(0.0, 0.1, 9, 0.1, 30.0))
    ends = EndPoints(ScanParams(normal_window=0.05)).read(nothing, IDENTITY)
    for noise, window, gap_threshold in ((0.005, 0.05, 0.1), (0.02, 0.12, 0.12)):
        ends._noise._std.value = noise
        ends.read(nothing, IDENTITY)
        assert ends.resolution == pytest.approx((noise, window, gap_threshold))


def normals_of(points, noise=0.0, step=0.02):
    n = points.shape[1]
    out, moments = np.zeros((3, n)), np.zeros((6, n + 1))
    scan_kernels.scan_moments(points, n, IDENTITY, step, GAP_THRESHOLD, moments)
    resolution = scan_kernels.ScanResolution(noise, 0.05, GAP_THRESHOLD)
    scan_kernels.scan_normals(points, n, IDENTITY, step, resolution, moments, out)
    return out


@pytest.mark.parametrize(("beams", "found"), [(2, 0), (3, 3)])
def test_a_chord_needs_three_end_points(beams, found):
    points, out = points_of(*((2.0, 0.01 * k) for k in range(beams))), np.ones((3, beams))
    resolution = scan_kernels.ScanResolution(0.0, 0.05, GAP_THRESHOLD)
    scan_kernels.chords(points, beams, IDENTITY, 0.005, resolution, out)
    assert np.count_nonzero(out[0]) == found


def test_normals_face_the_laser_and_the_gap_is_that_between_two_beams():
    y = np.arange(-10, 11) * 0.04
    for x in (2.0, -2.0):
        out = normals_of(points_of(*((x, float(v)) for v in y)))
        assert out[0] == pytest.approx(-np.sign(x)) and out[1] == pytest.approx(0.0, abs=1e-9)
        assert out[2] == pytest.approx(0.04)


def test_a_normal_is_shared_within_a_part_of_its_window():
    points, step = np.stack([np.full(400, 1.0), np.linspace(-0.5, 0.5, 400)]), 0.0025
    points[0] += np.random.default_rng(0).normal(0.0, 0.002, 400)
    out = normals_of(points, 0.002, step)
    half = 2 + int(0.05 / (step * math.hypot(0.5, 1.0)))
    ends, middle = out[0, 400 - half :], out[0, 200 : 200 + half]
    assert len(np.unique(ends)) == half  # at the end of a wall a window is half a one
    assert len(np.unique(middle)) <= 2 + half / (1 + half // scan_kernels.NORMALS_PER_HALF_WINDOW)
    assert np.abs(out[1, half:-half]).max() < 0.05


def test_a_corner_has_no_normal_unless_noise_may_have_bent_it():
    corner = [(2.0, 0.04 * k) for k in range(-6, 1)] + [(2.0 + 0.04 * k, 0.0) for k in range(1, 7)]
    sharp, blurred = normals_of(points_of(*corner)), normals_of(points_of(*corner), noise=0.05)
    assert not sharp[:2, 6].any() and sharp[:2, 0].any()
    assert blurred[:2, 6].any()


def test_a_surface_ends_at_a_jump_for_those_before_and_behind_it():
    xy = [(2.0, 0.04 * k) for k in range(6)] + [(3.0, 0.3 + 0.04 * k) for k in range(6)]
    out = normals_of(points_of(*xy))
    assert out[0] == pytest.approx(-1.0) and out[1] == pytest.approx(0.0, abs=1e-9)


def test_a_surface_goes_on_over_a_gap_of_four_spacings_of_its_beams():
    moments = np.zeros((6, 3))
    for gap, starts in ((0.25, [0, 0]), (0.27, [0, 1])):  # 0.1 m, and four times 0.04
        ends = points_of((2.0, 0.0), (2.0, gap))
        scan_kernels.scan_moments(ends, 2, IDENTITY, 0.02, GAP_THRESHOLD, moments)
        assert moments[5, :2].tolist() == starts


@pytest.mark.parametrize(("on", "seconds"), [(True, 0.02), (False, 0.02), (True, 0.0)])
def test_only_a_sweep_that_takes_time_is_freed_of_its_motion(on, seconds):
    lidar = laser(181, time_increment=seconds / 180)
    ends = EndPoints(ScanParams(deskew=on))
    ends.read(scan_at((0.0, 0.0, 0.0), lidar), Pose2(1.0, 0.0, 0.0))
    back = 0.01 if on and seconds else 0.0
    assert ends.has_sweep == (back > 0.0)
    assert ends.at_stamp(IDENTITY).x == pytest.approx(-back)


def test_ranges_below_the_lasers_own_limit_or_ours_are_not_used():
    ranges = np.repeat(np.float32([0.3, 0.6, 2.0]), 9)
    for low, least in ((0.1, 0.5), (0.5, 0.1)):
        lidar = Laser(0.0, 0.001, 27, low, 30.0)
        ends = EndPoints(ScanParams(min_range=least))
        ends.read(Scan(0.0, ranges, lidar), IDENTITY)
        assert np.hypot(*ends.points[:2, : ends.n]).min() == pytest.approx(0.6)


def test_rough_normals_are_the_normals_once_these_are_computed():
    reader = EndPoints(ScanParams()).read(scan_at(IDENTITY, laser(361)), IDENTITY)
    by_chord = reader.rough_normals[:2].copy()
    assert reader.rough_normals is not reader.normals
    assert reader.rough_normals is reader.normals
    lengths = np.hypot(*by_chord[:, : reader.n]) * np.hypot(*reader.normals[:2, : reader.n])
    alike = (by_chord * reader.normals[:2])[:, : reader.n].sum(axis=0)[lengths > 0.0]
    assert (alike > 0.9 * lengths[lengths > 0.0]).all()
    assert reader.read(scan_at(IDENTITY, laser(361)), IDENTITY).rough_normals is not reader.normals


def test_the_scan_interval_is_that_of_rising_stamps():
    def interval(*stamps):
        reader = EndPoints(ScanParams())
        for t in stamps:
            reader.read(scan_at(IDENTITY, laser(361), t=t), IDENTITY)
        return reader.scan_interval

    assert interval() == interval(3.0) == interval(3.0, 3.0) == 0.0
    assert interval(0.0, 0.4, 0.8) == pytest.approx(0.4)
    assert interval(0.0, 0.4, 0.4, 0.2, 0.6) == pytest.approx(0.4)  # a scan twice, a jump back
    assert interval(0.0, 0.4, 60.4) == pytest.approx(0.7)  # a gap counts as one second


steps = st.sampled_from([-9.0, 0.0, 0.025, 0.1, 3.0])  # s from one measurement to the next


@given(st.lists(st.tuples(steps, st.floats(-5.0, 5.0)), max_size=40))
def test_an_average_is_the_plain_mean_at_first_and_then_forgets_in_seconds(measured):
    """A repeated scan counts once; a rare one counts for 0.1 s."""
    average, expected, t, n = MovingAverage(2.0, 7.0), 7.0, 0.0, 0
    for step, value in measured:
        t += step
        average.add(value, t)
        if step != 0.0 or n == 0:
            n += 1
            weight = max(1.0 - math.exp(-min(max(step, 0.0), 0.1) / 2.0), 1.0 / n)
            expected += weight * (value - expected)
        assert average.value == pytest.approx(expected, abs=1e-9)
    assert n > 0 or average.value == 7.0


def test_a_recent_measurement_is_fresh_unless_the_clock_went_back():
    average = MovingAverage(1.0)
    assert not average.is_fresh(3.0)
    average.add(1.0, 3.0)
    average.add(9.0, math.nan)
    assert [average.is_fresh(t) for t in (3.0, 3.05, 3.1, 2.9)] == [True, True, False, False]
    assert average.value == 1.0


def test_a_scan_of_more_ranges_than_its_laser_has_beams_is_cut():
    ends, lidar = EndPoints(ScanParams()), laser(5)
    ends.read(Scan(0.0, np.ones(5, np.float32), lidar), IDENTITY)
    assert ends.read(Scan(0.1, np.ones(9, np.float32), lidar), IDENTITY).n == 5


def test_company_may_be_four_beams_away_but_not_five():
    for away, found in ((4, [0, 3, 4]), (5, [4])):
        ends = [(5.0 + 3.0 * k, 0.0) for k in range(7)]
        ends[0] = ends[away - 1] = ends[away] = (2.0, 0.0)
        assert kept(points_of(*ends), 0.001) == found
