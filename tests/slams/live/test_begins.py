"""A node that goes on from a state, or localizes in a map that stays."""

import json
import signal
from dataclasses import replace

import numpy as np
import pytest

import slams
from slams import LiveSlam, Pose2, run
from slams.formats.occupancy import write_map
from slams.live import __main__ as command
from slams.live.options import topic_names
from slams.live.robot import Robot
from slams.live.slam import MAX_RESUME_GAP
from tests.floors import START, grid_of, seen, truth
from tests.rooms import ROOM, box, cast, laser, scan_at
from tests.slams.live.commands import PATIENCE, started
from tests.slams.live.robots import Bus, Ending, Stand, robot_log


def placed_log(n=24, rate=4.0):
    """A drive that begins at START in the room; a message holds all its numbers exactly."""
    lidar = messaged(laser(361))
    return slams.ScanLog(np.arange(n) / rate, seen(n, lidar), lidar, meta={"name": "placed"})


def messaged(lidar):
    """A laser as it comes out of a message, which has numbers of 32 bits."""
    names = ("angle_min", "angle_increment", "range_min", "range_max")
    return replace(lidar, **{name: float(np.float32(getattr(lidar, name))) for name in names})


def driven(stand, robot, moments):
    for moment in moments:
        robot.send(moment)
    stand.start_and_drive()
    return np.column_stack([stand.node.drive.t, np.array(stand.node.drive.poses)])


@pytest.mark.parametrize("algorithm", ["hector", "gmapping"])
def test_going_on_from_a_state_equals_never_having_stopped(algorithm, monkeypatch, tmp_path):
    def stand_of(**begin):
        bus = Bus()
        robot = Robot(robot_log(30, -0.1, gyro=False), bus.transport(), topic_names())
        return Stand(monkeypatch, algorithm, bus=bus, begin=begin), robot

    stand, robot = stand_of()
    whole = driven(stand, robot, robot.schedule)
    cut = next(k for k, moment in enumerate(robot.schedule) if moment.t > 1.65)
    first, robot = stand_of()
    before = driven(first, robot, robot.schedule[:cut])
    first.live.save(tmp_path / "s")
    second, robot = stand_of(state=tmp_path / "s")
    after = driven(second, robot, robot.schedule[cut:])
    assert 10 < len(before) < 20
    assert np.array_equal(np.vstack([before, after]), whole)
    assert np.array_equal(second.live.map().p, stand.live.map().p, equal_nan=True)
    assert second.node.report()["no_odometry"] == 0


def test_a_run_goes_on_from_a_nodes_state_behind_its_last_scan(tmp_path, capsys):
    log = placed_log()
    log.save(tmp_path / "log.npz")
    live = LiveSlam("hector", warm_up=False)
    for scan in log.select(10):
        live.push_scan(scan)
    live.save(tmp_path / "s")
    arguments = ("hector", tmp_path / "log.npz", "--resume-state", tmp_path / "s", "--out")
    assert run.main([*map(str, arguments), str(tmp_path / "o")]) == 0
    assert "continues at scan 10 of 24" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("gap", "goes_on"), [(0.5, True), (2.0 * MAX_RESUME_GAP, False), (-0.5, False)]
)
def test_wheels_count_on_only_for_a_while(gap, goes_on, tmp_path):
    live = LiveSlam("odometry", warm_up=False)
    live.push_scan(scan_at((0.0, 0.0, 0.0), t=100.0, odometry=Pose2(7.0, 0.0, 0.0)))
    live.save(tmp_path / "s")
    on = LiveSlam("odometry", warm_up=False, state=tmp_path / "s")
    scan = replace(scan_at((0.0, 0.0, 0.0), t=100.0 + gap, odometry=Pose2(8.0, 0.0, 0.0)), yaw=3.0)
    estimate = on.push_scan(scan)
    assert (estimate.map_to_odom is not None) == goes_on
    assert estimate.pose == Pose2(1.0 if goes_on else 0.0, 0.0, 0.0)
    assert on._scan.yaw is None
    on.push_scan(replace(scan, t=scan.t + 1.0))
    assert (on._scan.yaw, on._scan.odometry) == (3.0, scan.odometry)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The room as a map of map_server, and a log of a drive in it."""
    folder = tmp_path_factory.mktemp("room")
    write_map(folder, grid_of(ROOM))
    placed_log().save(folder / "placed.npz")
    return folder


def trajectory(folder):
    return np.loadtxt(folder / "trajectory.csv", delimiter=",", skiprows=1)


def test_a_map_that_stays_is_shown_at_once_and_the_place_found(folder, monkeypatch):
    stand = Stand(monkeypatch, "hector", begin={"map": folder / "map.yaml"}, map_every=0.01)
    log, blind = placed_log(), np.full(361, np.nan, np.float32)
    ranges = np.vstack([[blind] * 3, log.ranges[3:]])
    stand.play(slams.ScanLog(log.t, ranges, log.laser))
    stand.start()
    assert len(stand.bus.sent("/map")) == 1  # before any scan
    stand.drive()
    stand.look()
    stand.node.close()
    (shown,) = stand.bus.sent("/map")  # it stays as it is
    assert (shown.info.height, shown.info.width) == grid_of(ROOM).p.shape
    states = [message.status[0] for message in stand.bus.sent("/slam/state")]
    assert [s.message for s in states[:4]] == ["lost"] * 3 + ["matched"]
    assert states[0].level == 2
    assert float({pair.key: pair.value for pair in states[-1].values}["explained"]) > 0.9
    assert len(stand.bus.sent("/pose")) == 21
    assert stand.node.drive.t == log.t[3:].tolist()
    off = np.array(stand.node.drive.poses)[:, :2] - truth(24)[3:, :2]
    assert np.hypot(*off.T).max() < 0.05
    report = stand.node.report()
    assert report["sought"] == 3 and report["algorithm"]["explained"] > 0.9
    assert any(note.startswith("found at 0.3") and "after 3 scans" in note for note in stand.notes)


def test_a_place_in_doubt_is_told_and_nothing_is_published(monkeypatch, tmp_path):
    square, lidar = np.array(box(-2.0, -2.0, 2.0, 2.0)), laser(361)
    stand = Stand(monkeypatch, "hector", begin={"map": grid_of(square)})
    n = 10
    ranges = np.array([cast(square, (0.5, 0.2, 0.1), lidar)] * n, np.float32)
    stand.play(slams.ScanLog(np.arange(float(n)), ranges, lidar))
    stand.start()
    moved = len(stand.bus.sent("/tf"))
    stand.drive()
    stand.look()
    assert "/pose" not in stand.bus.raw and len(stand.bus.sent("/tf")) == moved
    assert len(stand.bus.sent("/slam/state")) == n
    (sentence,) = [note for note in stand.notes if "not localized in the map yet" in note]
    assert sentence.startswith("1 scans so far")  # and again after a while
    assert "most likely: " in sentence and "with probability 0." in sentence
    assert not stand.live.last.found
    assert np.isinf(stand.live.last.covariance[0, 0])


def test_a_start_is_taken(folder):
    live = LiveSlam("hector", map=folder / "map.yaml", map_start=(0.35, -0.2, 0.4), warm_up=False)
    for scan in placed_log(6):
        estimate = live.push_scan(scan)
        assert estimate.found and estimate.explained > 0.9
    assert np.hypot(*(np.array(estimate.pose) - truth()[5])[:2]) < 0.05
    assert "starts at 0.3" in live.notes[-1]
    assert np.array_equal(live.map().p, live.given.p, equal_nan=True)


def test_what_does_not_fit_is_refused(folder, tmp_path):
    state = tmp_path / "s"
    live = LiveSlam("odometry", warm_up=False)
    with pytest.raises(ValueError, match="nothing to save: no scan yet"):
        live.save(state)
    live.push_scan(scan_at((0.0, 0.0, 0.0)))
    live.save(state)
    for changes, error, sentence in (
        ({"map_start": (0, 0, 0)}, ValueError, "got a pose without a map"),
        ({"state": state, "map": folder / "map.yaml"}, ValueError, "map: got a state"),
        ({"state": folder / "map.yaml"}, ValueError, "not a state; expected a file of"),
        ({"state": tmp_path / "none"}, OSError, "none"),
        ({"map": folder / "map.yaml"}, TypeError, "odometry cannot localize in a map"),
    ):
        with pytest.raises(error, match=sentence):
            LiveSlam("odometry", warm_up=False, **changes)
    given = LiveSlam("hector", map=folder / "map.yaml", map_start=START, warm_up=False)
    with pytest.raises(ValueError, match="a given map does not change"):
        given.save(state)
    with pytest.raises(OSError, match="no such folder"):
        live.check_saving(tmp_path / "no" / "s")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--start=1,2,3"], "expected --localize MAP, too"),
        (["--map", "map.yaml", "--save-state", "x"], "got --save-state, too"),
        (["--localize", "map.yaml", "--resume-state", "x"], "got --resume-state, too"),
        (["--map", "map.yaml", "--start=1,2"], "got '1,2', expected x,y,theta in m and rad"),
        (["--map", "none.yaml"], "none.yaml: no such file"),
        (["--resume-state", "map.yaml"], "map.yaml: not a state; expected"),
        (["--save-state", "no/x"], "no: no such folder; make it first"),
    ],
)
def test_a_node_refuses_as_a_run_does(arguments, sentence, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(command, "transport_of", lambda *_: Bus().transport())
    for main, log in ((command.main, []), (run.main, ["placed.npz"])):
        assert main(["hector", *log, *arguments]) == 2
        error = capsys.readouterr().err
        assert sentence in error and error.count("\n") == 1


@pytest.mark.parametrize("failing", ["bag.mcap", "map.png", "state"])
def test_an_output_that_fails_leaves_the_others(failing, monkeypatch, tmp_path, capsys):
    def fail(*_, **__):
        raise OSError(f"{failing} fails")

    stand = Stand(monkeypatch)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "transport_of", lambda *_: stand.bus.transport())
    monkeypatch.setattr(command, "_end_event", lambda: Ending(9, lambda: stand.scan(0.0)))
    replaced = {"bag.mcap": "formats.mcap.McapFile.write", "map.png": "run.write_drive"}
    monkeypatch.setattr(f"slams.{replaced.get(failing, 'live.slam.save_after')}", fail)
    words = ["odometry", "-q", "--out", ".", "--record", "bag.mcap", "--save-state", "state"]
    assert command.main(words) == 2
    assert f"{failing} fails" in capsys.readouterr().err
    written = {name for name in ("bag.mcap", "map.png", "state") if (tmp_path / name).exists()}
    assert written == {"bag.mcap", "map.png", "state"} - {failing}


@pytest.mark.parametrize("before", [signal.SIG_DFL, signal.SIG_IGN])
def test_a_terminal_that_is_closed_ends_a_node_without_nohup(before, monkeypatch):
    handlers = {}
    monkeypatch.setattr(signal, "getsignal", lambda number: before)
    monkeypatch.setattr(signal, "signal", handlers.__setitem__)
    ending = command._end_event()
    assert (signal.SIGHUP in handlers) == (before == signal.SIG_DFL)
    handlers.get(signal.SIGHUP, handlers[signal.SIGTERM])()
    assert ending.is_set()


def test_each_drive_of_a_robot_has_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def claimed(*words):
        return command._folder("hector", command.parser().parse_args(["hector", *words]))

    first = claimed()
    first.mkdir(parents=True)
    (first / "map.png").touch()
    assert (first.name, claimed().name, claimed("--force")) == (
        "live-hector",
        "live-hector-2",
        first,
    )
    with pytest.raises(FileExistsError, match="results/live-hector: exists; --force"):
        claimed("--out", str(first))


def test_states_and_maps_over_the_network(folder, tmp_path):
    pytest.importorskip("cyclonedds", reason="needs the extra live")
    log, state = placed_log(), tmp_path / "room.state"
    log.rows(slice(None, 12)).save(tmp_path / "first.npz")
    log.rows(slice(12, None)).save(tmp_path / "second.npz")

    def played(name, *more, end=signal.SIGTERM):
        out = tmp_path / f"out-{name}-{len(more)}"
        live = started("slams.live", "hector", "--out", out, *more, folder=tmp_path)
        while "ready for scans" not in live.stderr.readline():
            assert live.poll() is None
        play = ("slams.play", f"{name}.npz", "--rate", 4, "--wait-for-subscriber", PATIENCE)
        assert started(*play, folder=tmp_path).wait(2 * PATIENCE) == 0
        live.send_signal(end)
        _, error = live.communicate(timeout=PATIENCE)
        assert live.returncode == 0, error
        return out

    parts = [played("first", "--save-state", state)]
    words = ("--resume-state", state, "--save-state", state)
    parts.append(played("second", *words, end=signal.SIGINT))
    whole = ["hector", str(folder / "placed.npz"), "-q", "--out", str(tmp_path / "run")]
    assert run.main(whole) == 0
    assert np.array_equal(np.vstack(list(map(trajectory, parts))), trajectory(tmp_path / "run"))
    assert (parts[1] / "map.pgm").read_bytes() == (tmp_path / "run" / "map.pgm").read_bytes()
    there = ("--localize", folder / "map.yaml")
    found = played("second", *there)
    again = ["hector", str(tmp_path / "second.npz"), "-q", *map(str, there)]
    assert run.main([*again, "--out", str(tmp_path / "localized")]) == 0
    assert np.array_equal(trajectory(found), trajectory(tmp_path / "localized"))
    node = json.loads((found / "summary.json").read_text())["node"]
    assert node["algorithm"]["explained"] > 0.9
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".")] == []
