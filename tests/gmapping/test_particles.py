"""The particle filter: weights, ancestors, tiles; the output particle, and its map."""

import dataclasses

import numpy as np
import pytest

from gmapping import GMapping, GMappingParams
from gmapping.map import TileMap
from gmapping.map_kernels import insert
from gmapping.particles import Particles, Proposals, normalize, survivors_in_place, systematic
from gmapping.render_kernels import BeamCounts, draw
from gmapping.tile_kernels import own_slot
from slams.types import IDENTITY, Pose2
from tests.gmapping.scenes import (
    UPDATE,
    drive,
    mapped,
    position_error,
    references_add_up,
    run,
    surface_of,
    touched,
)


def test_weights_and_n_eff_by_hand():
    w, n_eff = normalize(np.log([1.0, 2.0, 1.0]) - 900.0, 1.0)
    np.testing.assert_allclose(w, [0.25, 0.5, 0.25])
    assert n_eff == pytest.approx(1.0 / (0.0625 + 0.25 + 0.0625))
    assert normalize(np.full(3, -5.0), 1.0)[1] == pytest.approx(3.0)
    np.testing.assert_allclose(normalize(np.log([1.0, 16.0]), 4.0)[0], [1 / 3, 2 / 3])


def test_systematic_resampling_with_a_known_draw():
    out = systematic(np.array([0.1, 0.2, 0.3, 0.4]), 0.5)
    np.testing.assert_array_equal(out, [1, 2, 3, 3])
    out = systematic(np.array([0.0, 1.0 - 1e-9, 0.0, 0.0]), 0.999999999999)
    assert (out == 1).all()
    assert systematic(np.array([0.0, 0.5, 0.5]), 0.0)[0] == 1


def test_histories_follow_ancestors_and_the_best_particle_has_to_be_strictly_better():
    particles = Particles(3)
    particles.poses[:, 0] = [1.0, 2.0, 3.0]
    particles.append_to_history()
    particles.weigh(np.array([-1.0, 0.0, -6.0]), 1.0)
    assert particles.best() == 1
    particles.output = 1
    particles.inherit(np.array([1, 1, 0]))
    assert particles.output == 0
    particles.poses[:, 0] += 10.0
    particles.append_to_history()
    np.testing.assert_array_equal(particles.history(1)[:, 0], [2.0, 12.0])
    np.testing.assert_array_equal(particles.history(2)[:, 0], [1.0, 11.0])


def test_the_output_particle_survives_in_place_of_a_twin_if_it_is_kept():
    particles = Particles(5, keep_output=True)
    particles.output = 3
    particles.weigh(np.array([0.0, 0.2, -90.0, -90.0, -90.0]), 1.0)
    ancestors = particles.draw_ancestors(0.5)
    assert sorted(np.bincount(ancestors, minlength=5).tolist()) == [0, 0, 1, 2, 2]
    assert np.count_nonzero(ancestors == 3) == 1
    particles.output = 0
    assert set(particles.draw_ancestors(0.5).tolist()) == {0, 1}


@pytest.mark.parametrize(("preset", "kept"), [("paper", False), ("default", True)])
def test_only_the_default_keeps_the_output_particle(preset, kept):
    particles = run(drive(12)[1], preset, n_particles=4, seed=3)[0].particles
    particles.weigh(-90.0 * (np.arange(4) == particles.output), 1.0)
    assert (particles.output in particles.draw_ancestors(0.9)) == kept


def test_writing_to_one_particle_never_shows_in_another():
    surface = surface_of(IDENTITY)
    tiles = mapped(surface, n=3)
    tiles.inherit(np.array([0, 0, 2]))
    pointers = np.count_nonzero(touched(tiles))
    assert tiles.used == pytest.approx(2 / 3 * pointers)
    before = [tiles.tiles.cells[touched(tiles)[:, :, i]] for i in range(3)]
    insert(tiles.tiles, np.array([[0.01, 0.0, 0.0]]), surface, UPDATE)  # particle 0 alone
    after = [tiles.tiles.cells[touched(tiles)[:, :, i]] for i in range(3)]
    assert not np.array_equal(before[0], after[0])
    np.testing.assert_array_equal(before[1:], after[1:])
    references_add_up(tiles)


def test_a_tile_without_references_is_zero_and_takes_no_space_in_a_state():
    maps = TileMap(2, 1, 0.05, 50, max_cells=4000)
    maps.cover(np.full((1, 3), 0.5), 0.5)
    for particle in (0, 1):
        slot = own_slot(maps.tiles, particle, 0, 3, 3)
        maps.tiles.cells[slot] = 1.0 + particle
    maps.cover(np.array([[3.0, 0.5, 0.0]]), 0.5)  # beyond the tables, which grow
    maps.inherit(np.zeros(2, np.int64))
    freed = maps.tiles.free[maps.tiles.free[0]]
    assert freed == slot and not maps.tiles.cells[freed].any()
    assert maps.tiles.cells[touched(maps)[:, :, 1].max()].min() == 1.0


def test_nothing_leaks_in_two_thousand_resamplings():
    rng, surface = np.random.default_rng(2), surface_of(IDENTITY)[::40]
    tiles = mapped(surface, n=5)
    alone = tiles.used // 5
    for i in range(2_000):
        tiles.inherit(survivors_in_place(rng.integers(0, 5, 5)))
        if i % 20 == 0:
            poses = rng.normal(0.0, 0.01, (5, 3))
            assert insert(tiles.tiles, poses, surface, UPDATE) == 0
    references_add_up(tiles)
    tiles.inherit(np.zeros(5, np.int64))
    assert tiles.used <= 2 * alone


def test_a_map_that_is_drawn_anew_is_drawn_once_and_shared():
    """For one particle; the others get it with the next scan, whichever instance takes it."""
    (truth, scans), going, drawn = drive(8), GMapping(GMappingParams()), GMapping(GMappingParams())
    going.update(scans[0])
    for scan, pose in zip(scans[:5], truth[:5], strict=True):
        drawn.insert_at(scan, Pose2(*pose))
    assert touched(drawn.tiles)[:, :, 0].any() and not touched(drawn.tiles)[:, :, 1:].any()
    going.frozen = True
    going.adopt(drawn, Pose2(*truth[5]))
    tables = touched(going.tiles)
    assert tables.any() and (tables == tables[:, :, :1]).all()
    drawn.insert_at(scans[5], Pose2(*truth[5]))
    drawn.frozen = True
    drawn.update(scans[6])
    tables = touched(drawn.tiles)
    assert (tables == tables[:, :, :1]).all()
    references_add_up(drawn.tiles)


def test_memory_is_bounded_by_sharing_one_map():
    (truth, scans), params = drive(60), GMappingParams(n_particles=6, max_tiles=200)
    assert run(scans, n_particles=6)[0].report()["tiles"] > 200
    slam, poses, shared = GMapping(params), [], False
    for scan in scans:
        poses.append(slam.update(scan))
        if slam.report()["collapsed"] and not shared:
            tables, shared = touched(slam.tiles), True
            assert (tables == tables[:, :, :1]).all()
            references_add_up(slam.tiles)
    assert shared and slam.report()["tiles"] <= 200
    assert position_error(np.array(poses), truth).max() < 0.05


def test_draws_are_from_the_gaussians():
    L = np.array([[2.0, 0.0, 0.0], [1.0, 4.0, 0.0], [0.5, -1.0, 5.0]])
    peaks = 0.1 * np.arange(9.0).reshape(3, 3)
    normals, particles = np.random.default_rng(1).standard_normal((3, 3)), Particles(3)
    proposals = Proposals(peaks, np.tile(L, (3, 1, 1)), np.zeros(3), np.zeros(3, np.bool_))
    particles.draw(proposals, normals)
    # L^T off = normals: covariance (L L^T)^-1
    np.testing.assert_allclose((particles.poses - peaks) @ L, normals)


def test_the_spread_is_around_the_output_particle():
    particles = Particles(2)
    particles.poses[:] = [[1.0, 2.0, 3.1], [1.2, 1.6, -3.1]]
    off = np.array([0.2, -0.4, 2.0 * np.pi - 6.2])
    np.testing.assert_allclose(particles.spread(), 0.5 * np.outer(off, off))


def test_every_particle_steps_in_its_own_heading_and_inherits_a_lifetime():
    particles = Particles(2)
    particles.poses[:] = [[1.0, 2.0, 0.5 * np.pi], [0.0, 0.0, 0.0]]
    particles.move(np.array([0.3, 0.1, 0.2]))
    np.testing.assert_allclose(particles.poses, [[0.9, 2.3, 0.5 * np.pi + 0.2], [0.3, 0.1, 0.2]])
    particles.lifetime[:] = [-3.0, 0.0]
    particles.inherit(np.array([1, 1]))
    np.testing.assert_array_equal(particles.lifetime, 0.0)


def test_the_output_particle_stays_at_its_peak_and_the_others_are_drawn():
    _, scans = drive(50)
    one, poses = run(scans, n_particles=1)
    many, reported = run(scans, n_particles=6)
    assert many.report()["resampled"] == 0  # no old surface
    np.testing.assert_allclose(reported, poses, atol=1e-9)
    others = np.delete(many.particles.poses, many.particles.output, axis=0)
    off = np.hypot(*(others[:, :2] - one.particles.poses[0, :2]).T)
    assert 1e-4 < off.max() < 0.05 and len(np.unique(off)) == len(off)
    full = run(scans, "paper", n_particles=1)[1]
    assert not np.array_equal(full, run(scans, "paper", n_particles=1, seed=3)[1])


def test_beams_clear_what_they_cross_and_mark_their_end():
    (hits, visits), coarse_hits = np.zeros((2, 3, 7), np.int32), np.zeros((1, 2), np.float32)
    counts = BeamCounts(hits, visits, coarse_hits, 0, 0, 0.05)
    scan = np.array([[0.30, 0.05], [0.0, 0.10], [0.0, 0.05]])
    draw(scan, counts, 1)
    np.testing.assert_array_equal(visits, [[0] * 7, [2, 1, 1, 1, 1, 1, 1], [1] + [0] * 6])
    np.testing.assert_array_equal(hits, [[0] * 7, [0] * 6 + [1], [1] + [0] * 6])
    np.testing.assert_array_equal(coarse_hits, [[1, 1]])
    draw(scan, counts, -1)
    assert not (hits.any() or visits.any() or coarse_hits.any())


def test_a_closed_loop_moves_the_robot_and_is_no_motion():
    _, scans = drive(30)
    (slam, poses), (other, _) = (run(scans[:-1], n_particles=2) for _ in range(2))
    particles, pose = slam.particles, Pose2(*poses[-1])
    particles.poses[:] = pose
    particles.poses[0, 1] += 0.3
    particles.output, particles.lifetime[:] = 0, [0.0, 90.0]
    assert slam._select_output(pose, np.array([False, True])) == pose and particles.output == 0
    there = slam._select_output(pose, np.array([True, True]))
    assert (slam.report()["closed"], slam.report()["switched"], particles.output) == (1, 0, 0)
    np.testing.assert_allclose(there, [pose.x, pose.y + 0.3, pose.theta])
    shifted, expected = (s._estimator.predict(scans[-1]).pose for s in (slam, other))
    np.testing.assert_allclose(shifted, [expected.x, expected.y + 0.3, expected.theta], atol=1e-4)


def test_without_odometry_the_original_needs_one_particle_and_enters_every_scan():
    scans = [dataclasses.replace(scan, odometry=None) for scan in drive(40)[1]]
    report = run(scans, "original")[0].report()
    assert (report["particles"], report["inserted"]) == (1, 40)


def test_particles_spread_as_the_pose_becomes_less_certain():
    slam, _ = run(drive(12)[1], n_particles=2)
    before, lost, covariances = slam._estimator.covariance, np.diag([0.09, 0.0, 0.0]), []
    for change in (0.0, -1.0, 1.0):
        if change:
            slam._keyframe_covariance = before + change * lost
        covariances.append(np.linalg.inv(slam._motion_information(Pose2(0.2, 0.0, 0.0))))
    np.testing.assert_allclose(covariances[1], covariances[0] + lost, atol=1e-5)
    noise = slam.params.key_noise + slam.params.way_noise * 0.2
    assert covariances[0][0, 0] == pytest.approx(noise**2, rel=0.5)
    assert covariances[2][0, 0] == pytest.approx(noise**2)  # no less than that of the motion


def test_resampled_particles_go_on_with_pose_and_map_of_their_ancestor():
    slam, _ = run(drive(20)[1], n_particles=4, spread=1.0)
    pose, table = slam.particles.poses[1].copy(), touched(slam.tiles)[:, :, 1].copy()
    assert not np.array_equal(table, touched(slam.tiles)[:, :, 2])
    slam.particles.weigh(np.array([-90.0, 0.0, -90.0, -90.0]), 1.0)
    slam.particles.output = 1
    slam._inherit(slam.particles.draw_ancestors(0.5))
    np.testing.assert_array_equal(slam.particles.poses, np.tile(pose, (4, 1)))
    assert (touched(slam.tiles) == table[:, :, None]).all()
    references_add_up(slam.tiles)


def test_the_papers_filter_outputs_the_best_particle_whether_or_not_it_closed_a_loop():
    _, scans = drive(10)
    slam, poses = run(scans, "paper", n_particles=2)
    slam.particles.output, slam.particles.lifetime[:] = 0, [0.0, 1.0]
    slam._select_output(Pose2(*poses[-1]), np.array([False, False]))
    assert slam.particles.output == 1
