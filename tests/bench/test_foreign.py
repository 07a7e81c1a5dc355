"""Any program as a row: its errors are evo's, at its own rate, in its own frame, with its map."""

import json

import numpy as np
import pytest

from bench import compare
from bench.judge.comparison import evaluated
from bench.report import figures
from bench.results import LogResult, Outcome, Reference
from bench.run.cases import Choice, replayed
from bench.run.foreign import Foreign, foreign_case
from slams import OccupancyGrid, Pose2
from slams.formats.occupancy import write_map
from slams.metrics import between
from slams.scanlog import TimeSeries
from tests import bags
from tests.bench.compared import compared
from tests.rooms import drive, moved

pytestmark = pytest.mark.usefixtures("here")
OTHER = Pose2(3.0, -2.0, 0.7)  # where the map frame of another program lies


def precise_tum(path, t, poses):
    """As any program may write it: with all digits."""
    zero = np.zeros(len(t))
    half = 0.5 * poses[:, 2]
    columns = [t, poses[:, 0], poses[:, 1], zero, zero, zero, np.sin(half), np.cos(half)]
    np.savetxt(path, np.stack(columns, axis=1), fmt="%.17g")


@pytest.fixture(scope="module")
def log():
    return drive(n=80)


@pytest.fixture(scope="module")
def estimate(log):
    """What some program found at every other scan: the truth, a little off."""
    truth = log.truth_at(log.t)[::2]
    rng = np.random.default_rng(4)
    steps = rng.normal(0.0, (0.01, 0.01, 0.004), truth.shape)
    return TimeSeries(log.t[::2], moved(OTHER, truth + steps))


def test_errors_of_a_tum_file_are_those_of_evo(log, estimate, tmp_path):
    files = pytest.importorskip("evo.tools.file_interface")
    sync = pytest.importorskip("evo.core.sync")
    evo = pytest.importorskip("evo.core.metrics")
    precise_tum(tmp_path / "other.tum", estimate.t, estimate.values)
    precise_tum(tmp_path / "truth.tum", log.t, log.truth_at(log.t))
    log.save(tmp_path / "room.npz")
    words = [str(tmp_path / "room.npz"), "--algorithms", "odometry", "--jobs", "1", "-q"]
    words += ["--trajectory", f"toolbox={tmp_path / 'other.tum'}", "--out", str(tmp_path / "out")]
    found = compared(words).logs[0].outcomes[1]

    truth = files.read_tum_trajectory_file(tmp_path / "truth.tum")
    other = files.read_tum_trajectory_file(tmp_path / "other.tum")
    truth, other = sync.associate_trajectories(truth, other, max_diff=1e-6)
    relations = evo.PoseRelation.translation_part, evo.PoseRelation.rotation_angle_rad
    for span, frames in (("update", 1), ("1 s", 10)):
        ours = found.errors[span].se2_translation, found.errors[span].orientation
        for relation, values in zip(relations, ours, strict=True):
            rpe = evo.RPE(relation, frames, evo.Unit.frames, all_pairs=True)
            rpe.process_data((truth, other))
            assert values == pytest.approx(rpe.error, abs=1e-9)
    ape = evo.APE(evo.PoseRelation.translation_part)
    other.align(truth)
    ape.process_data((truth, other))
    rmse = ape.get_statistic(evo.StatisticsType.rmse)
    assert found.row["errors"]["ate_m"] == pytest.approx(rmse, abs=1e-9)
    tables = (tmp_path / "out" / "tables.md").read_text()
    assert tables.count("| toolbox |") >= 4
    assert found.row["consistency"]["walls_m2"] > 0.0
    assert "toolbox" in (tmp_path / "out" / "report.html").read_text()


def test_a_run_of_ours_read_back_is_the_same_row(log, tmp_path):
    own = replayed("hector", log, Choice())
    again = foreign_case(Foreign("x", TimeSeries(own.t, moved(OTHER, own.poses)), None), log)
    assert again.frame == pytest.approx(OTHER)
    np.testing.assert_allclose(again.poses, own.poses, atol=1e-12)
    for name, errors in own.errors.items():
        for a, b in zip(errors, again.errors[name], strict=True):
            np.testing.assert_allclose(a, b, atol=1e-12)
    for key, value in own.row["errors"]["spans"]["update"]["translation_m"].items():
        assert again.row["errors"]["spans"]["update"]["translation_m"][key] == pytest.approx(value)
    assert again.row["used"] is None
    assert again.row["cost"] is None


def test_between_stamps_the_truth_is_interpolated_and_nothing_is_extrapolated(log):
    t = np.linspace(log.t[0] - 1.0, log.t[-1] + 1.0, 300)
    shown = log.truth.poses_at(np.clip(t, log.t[0], log.t[-1]))
    found = foreign_case(Foreign("x", TimeSeries(t, shown), None), log)
    assert found.t.min() >= log.t[0] - 1.1 * log.scan_period
    assert found.row["errors"]["ate_m"] < 1e-9
    inside = (found.t >= log.truth.t.min()) & (found.t <= log.truth.t.max())
    assert found.row["errors"]["dropped"] == int((~inside).sum()) > 0
    assert len(found.common.t) == inside.sum()


def test_a_program_that_starts_late_is_seen_from_the_first_scan(log, estimate):
    late = TimeSeries(estimate.t[9:], estimate.values[9:])
    found = foreign_case(Foreign("x", late, None), log)
    truth = between(np.repeat(log.truth_at(log.t[:1]), len(late.t), axis=0), log.truth_at(late.t))
    assert np.abs(found.poses[:, :2] - truth[:, :2]).max() < 0.1, "in the frame of the others"
    assert found.row["errors"]["ate_m"] < 0.02


def test_relations_are_met_by_interpolation(log, estimate):
    truth = log.truth_at(log.t)
    a, b = [10, 5], [40, 70]
    relations = np.column_stack([log.t[a], log.t[b], between(truth[a], truth[b])])
    fine = TimeSeries(log.t[::2], moved(OTHER, truth[::2]))
    found = foreign_case(Foreign("x", fine, None), log, relations)
    assert found.row["relations"]["used"] == 2
    assert found.row["relations"]["all"]["translation_m"]["max"] < 0.01
    keyframes = TimeSeries(log.t[::20], truth[::20])  # the last two seconds have none
    for row in (found.row, foreign_case(Foreign("x", keyframes, None), log).row):
        assert not row["loss"]["lost"]
    gap = np.r_[:30, 60:80]
    for part in (slice(0, 60, 2), gap):  # it ends early, or has a gap
        cut = TimeSeries(log.t[part], moved(OTHER, truth[part]))
        rows = [
            foreign_case(Foreign("x", cut, None), log, known).row for known in (None, relations)
        ]
        assert rows[1]["relations"]["used"] == 1
        if part is not gap:
            assert all(row["loss"]["by"] == "end" and row["loss"]["lost"] for row in rows)
            assert rows[1]["loss"]["end"]["at_s"] == pytest.approx(log.t[58] - log.t[0])


def test_start_luck_is_told(log, tmp_path, capsys):
    truth = log.truth_at(log.t)
    lines = []
    for a in range(20, 60, 4):
        step = between(truth[a : a + 1], truth[a + 10 : a + 11])[0]
        lines.append(f"{log.t[a]} {log.t[a + 10]} {step[0]} {step[1]} 0 0 0 {step[2]}")
    (tmp_path / "room.relations").write_text("\n".join(lines))
    log.save(tmp_path / "room.npz")
    words = [str(tmp_path / "room.npz"), "--relations", str(tmp_path / "room.relations")]
    words += ["--algorithms", "odometry", "tests.bench.test_html:Runaway", "--starts", "3"]
    assert compare.main([*words, "--jobs", "1", "--out", str(tmp_path / "out")]) == 0
    assert "from other start scans" in capsys.readouterr().out
    good, bad = json.loads((tmp_path / "out" / "results.json").read_text())["rows"]
    assert good["starts"]["n"] == 3
    assert good["starts"]["worst"] >= good["relations"]["all"]["translation_m"]["mean"] - 1e-12
    assert bad["starts"]["above"] == 3


def test_a_bag_recorded_with_another_slam_gives_the_whole_table(log, tmp_path, capsys, monkeypatch):
    """Scans, wheels and the other's map -> odom by tf in one bag, its map beside, one command."""
    frames = {}
    monkeypatch.setattr(
        figures, "map_panel", lambda axes, name, plan, *_: frames.update({name: plan.frame})
    )
    truth = log.truth_at(log.t)
    found = [Pose2(*p) for p in moved(OTHER, truth + 0.004 * np.sin(np.arange(80))[:, None])]
    wheels = [Pose2(*p) for p in log.odometry_at_scans().tolist()]

    def messages(make):
        still = ("base_link", "laser", (0.0, 0.0, 0.0), 0.0, 0.0)
        every = [("/tf_static", log.t[0], make.tf(log.t[0], still))]
        angles = (log.laser.angle_min, log.laser.angle_increment)
        for t, ranges, pose, wheel in zip(log.t, log.ranges, found, wheels, strict=True):
            shift = pose @ wheel.inverse()
            for parent, child, p in (("map", "odom", shift), ("odom", "base_link", wheel)):
                place = (parent, child, (p.x, p.y, 0.0), p.theta, 0.0)
                every.append(("/tf", t, make.tf(t, place)))
            every.append(("/scan", t, make.scan(t, ranges, angles=angles)))
        return every

    path = bags.write(tmp_path, "mcap", messages)
    precise_tum(tmp_path / "truth.tum", log.t, truth)
    write_map(tmp_path, replayed("hector", log, Choice()).grid)
    words = [str(path), "--truth", str(tmp_path / "truth.tum"), "--jobs", "1"]
    words += ["--trajectory", "slam_toolbox=map", "--map", f"slam_toolbox={tmp_path / 'map.yaml'}"]
    words += ["--algorithms", "hector", "--out", str(tmp_path / "out")]
    ours, theirs = compared(words).logs[0].outcomes
    assert capsys.readouterr().out.count("slam_toolbox") >= 2
    assert ours.row["used"] == ["laser", "wheels"]
    assert theirs.row["errors"]["dropped"] <= 1
    assert 0.001 < theirs.row["errors"]["ate_m"] < 0.01
    assert theirs.grid is not None
    assert theirs.frame == pytest.approx(found[0], abs=1e-6)
    assert frames["slam_toolbox"] == theirs.frame and frames["hector"] == Pose2(0.0, 0.0, 0.0)


def test_map_quality_does_not_depend_on_the_frame():
    p = np.full((60, 60), np.nan, np.float32)
    p[10:50, 10:50], p[10, 10:50], p[49, 10:50], p[10:50, 49] = 0.1, 0.9, 0.9, 0.9
    true = OccupancyGrid(np.where(p > 0.5, 1.0, p).astype(np.float32), 0.05, (0.0, 0.0))
    start, shift = Pose2(0.5, 1.0, 0.0), Pose2(2.0, -1.0, 0.0)
    rows = [{"algorithm": name, "failed": None} for name in "abc"]
    frames = (Pose2(0.0, 0.0, 0.0), shift, Pose2(0.0, 0.0, 0.0))
    origins = ((-0.5, -1.0), (1.5, -2.0), (1.5, -2.0))
    outcomes = [
        Outcome(row, grid=OccupancyGrid(p, 0.05, origin), frame=frame)
        for row, frame, origin in zip(rows, frames, origins, strict=True)
    ]
    log = LogResult(Reference({"name": "l", "notes": []}, None, true, start), outcomes)
    own, foreign, wrong = (row["map"] for row in evaluated([log], {}).rows)
    assert own["iou"] == foreign["iou"] == 1.0
    assert (wrong["iou"] or 0.0) < 0.1
