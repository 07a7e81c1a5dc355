"""Saved states: going on equals never having stopped; a bad file is refused in one sentence."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from slams.baselines import Odometry
from slams.formats.npz import write_npz
from slams.state import load_state, read_state, save
from slams.state.tree import Reader, Writer
from slams.types import Laser, Pose2, Scan
from tests.rooms import command, drive, driven, labels, laser, made

SCANS, CUTS = 30, (1, 11, 20)
LABELS = [label for label in labels() if label.partition("@")[0] != "kiss"]


@pytest.fixture(scope="module")
def scans():
    return list(drive(n=SCANS, lidar=laser(181)))


@pytest.fixture(scope="module")
def kept(tmp_path_factory, scans):
    """A state of hector after a few scans; tests change copies of it."""
    path = tmp_path_factory.mktemp("state") / "hector.state"
    save(driven("hector", scans[:5]), path, {"t": 1.5})
    return path


@pytest.mark.parametrize("label", LABELS)
def test_going_on_equals_never_having_stopped(label, scans, tmp_path):
    slam, poses = made(label), []
    for i, scan in enumerate(scans):
        if i in CUTS:
            save(slam, tmp_path / f"{i}")
        poses.append(slam.update(scan))
    for i in CUTS:
        again = load_state(tmp_path / f"{i}", label)
        assert type(again) is type(slam)
        assert [again.update(scan) for scan in scans[i:]] == poses[i:]
        assert again.report() == slam.report()
        one, other = again.map(), slam.map()
        assert np.array_equal(one.p, other.p, equal_nan=True)
        assert (one.origin, one.resolution) == (other.origin, other.resolution)


def test_saving_twice_gives_the_same_file(scans, tmp_path):
    save(driven("gmapping", scans[:3]), tmp_path / "a")
    save(load_state(tmp_path / "a"), tmp_path / "b")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b"]


def copied(thing):
    writer = Writer("tests")
    node = json.loads(json.dumps(writer.node(thing, "it")))
    arrays = {name: array.copy() for name, array in writer.arrays.items()}
    return Reader(arrays, "tests").read(node, "it")


class Slots:
    __slots__ = ("__hidden", "shown")

    def __init__(self):
        self.__hidden = self.shown = 7


class Slotted(Slots):
    __slots__ = "other"


class Keeper(Odometry):
    """An algorithm that keeps one of everything a state can hold."""

    def __init__(self, params):
        self.params = params
        self.fan = Laser(-1.0, 0.5, 5, 0.1, 30.0)
        self.fan.angles  # noqa: B018  (a cached property is no state)
        self.scan = Scan(0.5, np.arange(5, dtype=np.float32), self.fan, Pose2(1.0, -0.0, 3.0))
        self.scan.ranges.flags.writeable = False
        self.grid = np.full((300, 40), np.nan, np.float32)
        self.odd = [True, 1, 1.0, "a", None, float("inf"), np.float32(0.1), np.int64(3)]
        self.pair = (2, self.grid)
        self.table = {(1, "b"): self.fan, self.fan: [], 2: {}}
        self.table["loop"] = self.table["me"] = self
        self.rng = np.random.default_rng(4)
        self.same_rng = self.rng
        self.none = np.zeros((0, 3), np.int32)
        self.rows = np.zeros(5000, [("a", "f8"), ("b", "f8")])
        self.slotted = Slotted()


def test_what_refers_to_the_same_does_so_again():
    one = Keeper(Keeper.Params())
    one.rng.random(3)
    it = copied(one)
    assert it.odd == one.odd and [type(v) for v in it.odd] == [type(v) for v in one.odd]
    assert it.table["loop"] is it.table["me"] is it and it.table[it.fan] == []
    assert it.table[1, "b"] is it.fan is it.scan.laser
    assert "angles" in one.fan.__dict__ and "angles" not in it.fan.__dict__
    assert it.pair[1] is it.grid and np.isnan(it.grid).all()
    assert str(it.scan.odometry) == str(one.scan.odometry)  # a zero's sign, too
    assert not it.scan.ranges.flags.writeable and it.grid.flags.writeable
    assert it.same_rng is it.rng and it.rng.random() == one.rng.random()
    assert (it.none.shape, it.none.dtype) == ((0, 3), np.int32)
    assert it.rows.dtype == one.rows.dtype
    assert it.slotted.shown == it.slotted._Slots__hidden == 7


def test_an_algorithm_of_ones_own_is_saved_and_named_to_be_loaded(tmp_path):
    label = "tests.slams.test_state:Keeper"
    one = Keeper(Keeper.Params())
    save(one, tmp_path / "k")
    with pytest.raises(ValueError, match="pass algorithm="):
        load_state(tmp_path / "k")
    assert load_state(tmp_path / "k", label).rows.dtype == one.rows.dtype


GRID = np.zeros((4, 4))


@pytest.mark.parametrize(
    "bad", [{1, 2}, np.array([None]), len, Exception, 1j, Path(), GRID[1:-1, 1:-1]]
)
def test_what_is_no_data_is_refused_by_name(bad):
    with pytest.raises(TypeError, match=r"it\[1\] "):
        Writer("tests").node([GRID, bad], "it")


def rewritten(source, target, change):
    """A copy of a state with its head changed."""
    with np.load(source) as archive:
        arrays = dict(archive)
    head = json.loads(arrays.pop("head").tobytes())
    change(head)
    write_npz(target, arrays | {"head": np.frombuffer(json.dumps(head).encode(), np.uint8)})
    return target


def put(value, *path):
    """Sets what stands at a path in the head of a file."""

    def change(head):
        for key in path[:-1]:
            head = head[key]
        head[path[-1]] = value

    return change


def put_class(name):
    return put(name, "tree", "slam", 1)


def set_large(index, value):
    return lambda head: next(iter(head["large"].values())).__setitem__(index, value)


SLAM = "tree", "slam", 2
CHANGES = {
    "another format": (put("x", "format"), "saved with format x, expected slams-state-5"),
    "another release": (put("9.1", "slams"), "saved with slams 9.1, expected"),
    "unknown algorithm": (put("hectr", "algorithm"), "unknown algorithm"),
    "somebody's module": (put("os:Path", "algorithm"), "pass algorithm="),
    "another algorithm": (put("tsd", "algorithm"), "there is no class 'hector"),
    "a foreign class": (put_class("subprocess:Popen"), "there is no class"),
    "a module of ours": (put_class("slams.cli:Parser"), "there is no class"),
    "no such class": (put_class("hector.slam:Hectr"), "there is no class"),
    "a function": (put_class("hector.slam:estimator_for"), "there is no class"),
    "a number for a map": (put(3, *SLAM, "_map"), "slam._map is a number, expected hector.map"),
    "a missing attribute": (lambda head: head["tree"]["slam"][2].popitem(), "slam has no"),
    "a node of no kind": (put(["eval", "1"], *SLAM, "frozen"), "slam.frozen is malformed"),
    "other parameters": (put(-3, "tree", "params", 2, "seed"), "parameter 'seed': got -3"),
    "a giant": (set_large(1, [1 << 60, 4]), "damaged"),
    "a smaller array": (set_large(1, [4]), "could not broadcast"),
    "an array of another type": (set_large(0, "<c8"), "an array of complex64"),
    "no tree": (lambda head: head.pop("tree"), "damaged"),
}


@pytest.mark.parametrize("kind", CHANGES)
def test_a_changed_file_is_refused_in_one_sentence(kind, kept, tmp_path):
    change, sentence = CHANGES[kind]
    path = rewritten(kept, tmp_path / "x.state", change)
    with pytest.raises((ValueError, LookupError)) as caught:
        load_state(path)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


JUNK = (None, -1, 0, 10**30, "x", "<f8", "hector.slam:Hector", [], [0], {}, 1.5, True, "list")


def degraded(known, rng):
    """Somewhere in a nest of lists and dicts a value of another kind, or one less."""
    while True:
        keys = list(known) if isinstance(known, dict) else range(len(known))
        key = keys[rng.integers(len(keys))]
        if isinstance(known[key], (list, dict)) and known[key] and rng.random() < 0.8:
            known = known[key]
        elif rng.random() < 0.8:
            known[key] = JUNK[rng.integers(len(JUNK))]
            return
        else:
            del known[key]
            return


def test_whatever_stands_in_a_file_is_read_or_refused_in_one_sentence(kept, tmp_path):
    rng, said = np.random.default_rng(0), []
    for _ in range(80):
        path = rewritten(kept, tmp_path / "x", lambda head: degraded(head["tree"], rng))
        try:
            load_state(path)
        except ValueError as error:
            said.append(str(error))
    assert len(said) > 60
    assert all(text.startswith(str(path)) and "\n" not in text for text in said)


def test_the_old_state_stays_whole_when_saving_fails(kept, tmp_path, monkeypatch):
    path = tmp_path / "x.state"
    shutil.copy(kept, path)
    with monkeypatch.context() as patch:
        patch.setattr("zipfile.ZipFile.writestr", lambda *a, **k: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            save(made("hector"), path)
    assert path.read_bytes() == kept.read_bytes()
    assert [p.name for p in tmp_path.iterdir()] == ["x.state"]
    assert read_state(path).beside == {"t": 1.5}


def rows(folder):
    lines = (folder / "trajectory.tum").read_text().splitlines()
    return [line for line in lines if not line.startswith("#")]


def test_a_run_goes_on_where_another_stopped(tmp_path, capsys):
    log, state = tmp_path / "room.npz", tmp_path / "s"
    drive(n=SCANS, lidar=laser(181)).save(log)
    out = {name: tmp_path / name for name in ("whole", "first", "second")}
    quiet = ("hector", log, "--set", "levels=2", "-q")
    assert command(*quiet, "--out", out["whole"]) == 0
    assert command(*quiet, "--limit", "12", "--save-state", state, "--out", out["first"]) == 0
    again = ("hector", log, "--resume-state", state)
    assert command(*again, "--save-state", state, "--out", out["second"]) == 0
    assert "note: continues at scan 12 of 30" in capsys.readouterr().err
    lines = {name: rows(path) for name, path in out.items()}
    assert lines["first"] + lines["second"] == lines["whole"]
    assert (out["second"] / "map.pgm").read_bytes() == (out["whole"] / "map.pgm").read_bytes()
    summary = json.loads((out["second"] / "summary.json").read_text())
    assert summary["parameters"]["levels"] == 2
    assert summary["report"]["matched"] == summary["scans"] == 18
    assert command(*again) == 2
    assert "all its 30 scans are in the state already" in capsys.readouterr().err
    assert command(*again, "--set", "levels=3") == 2  # the default, but given
    assert "saved with levels 2, got 3" in capsys.readouterr().err


@pytest.mark.parametrize("failing", ["run.write_drive", "state.store.save_after"])
def test_an_output_that_fails_leaves_the_other(failing, tmp_path, monkeypatch, capsys):
    drive(n=3, lidar=laser(91)).save(tmp_path / "log.npz")
    monkeypatch.setattr(f"slams.{failing}", lambda *_: (tmp_path / "no" / "x").touch())
    words = ("odometry", tmp_path / "log.npz", "--out", tmp_path / "o", "--save-state")
    assert command(*words, tmp_path / "s") == 2
    assert (tmp_path / "s").exists() == (failing == "run.write_drive") != (tmp_path / "o").exists()
    assert "no such file" in capsys.readouterr().err


def test_every_other_scan_goes_on_in_step(tmp_path):
    log, state = tmp_path / "room.npz", tmp_path / "s"
    drive(n=20, lidar=laser(91)).save(log)
    part = ("odometry", log, "-q", "--every", "2", "--out")
    assert command(*part, tmp_path / "a", "--limit", "4", "--save-state", state) == 0
    assert command(*part, tmp_path / "b", "--resume-state", state) == 0
    t = [float(row.split()[0]) for row in rows(tmp_path / "b")]
    assert t == pytest.approx([0.4, 0.5, 0.6, 0.7, 0.8, 0.9])


def test_another_drive_is_taken_whole(kept, tmp_path):
    log = tmp_path / "other.npz"
    drive(n=6, seed=3, lidar=laser(181)).save(log)
    assert command("hector", log, "-q", "--resume-state", kept, "--out", tmp_path / "o") == 0
    assert json.loads((tmp_path / "o" / "summary.json").read_text())["scans"] == 6
