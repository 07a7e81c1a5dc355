"""Saved states: going on equals never having stopped; a bad file is refused in one sentence."""

import hashlib
import json
import shutil
import zipfile
from collections import deque
from functools import partial

import numpy as np
import pytest

from slams import run
from slams.registry import find, label_of, names
from slams.state import load_state, read_state, save
from slams.state.classes import Home
from slams.state.graph import graph_of
from slams.state.memory import BLOCK, pack, unpack
from slams.state.rebuild import rebuild
from slams.types import Laser, Pose2, Scan
from tests.rooms import drive, laser

SCANS, CUTS = 30, (1, 11, 20)
LABELS = [
    label
    for name in names()
    if name != "kiss"
    for label in (name, *(f"{name}@{p}" for p in find(name).cls.Params.presets()[1:]))
]


def new(label):
    entry = find(label)
    return entry.cls(entry.params())


@pytest.fixture(scope="module")
def scans():
    return list(drive(n=SCANS, lidar=laser(181)))


@pytest.fixture(scope="module")
def kept(tmp_path_factory, scans):
    """A state of hector after a few scans; tests change copies of it."""
    path = tmp_path_factory.mktemp("state") / "hector.state"
    slam = new("hector")
    for scan in scans[:5]:
        slam.update(scan)
    save(slam, path, {"t": 1.5})
    return path


@pytest.mark.parametrize("label", LABELS)
def test_going_on_equals_never_having_stopped(label, scans, tmp_path):
    slam, poses = new(label), []
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
    slam = new("gmapping")
    for scan in scans[:3]:
        slam.update(scan)
    save(slam, tmp_path / "a")
    save(load_state(tmp_path / "a"), tmp_path / "b")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b"]


def test_classes_have_the_labels_that_find_them():
    for label in LABELS:
        own = find(label).cls
        assert find(label_of(own)).cls is own
    assert label_of(find("tests.slams.test_state:Keeper").cls) == "tests.slams.test_state:Keeper"


def copied(thing):
    graph = graph_of({"it": thing}, Home("tests"))
    packed = [pack(*span) for span in graph.spans]
    memory = b"".join(run.tobytes() for _, runs in packed for run in runs)
    kept, pieces = np.frombuffer(memory, np.uint8), []
    for piece, _ in packed:
        data, kept = unpack(piece, kept)
        pieces.append(data)
    nodes, roots = json.loads(json.dumps([graph.nodes, graph.roots]))
    return rebuild(roots, nodes, pieces, Home("tests"))["it"]


class Keeper:
    """An algorithm that keeps one of everything a state can hold."""

    Params = find("odometry").cls.Params

    def __init__(self, params):
        self.params = params
        self.fan = Laser(-1.0, 0.5, 5, 0.1, 30.0)
        self.fan.angles  # noqa: B018  (a cached property is no state)
        self.scan = Scan(0.5, np.arange(5, dtype=np.float32), self.fan, Pose2(1.0, -0.0, 3.0))
        self.scan.ranges.flags.writeable = False
        self.grid = np.full((300, 40), np.nan, np.float32)
        self.corner = self.grid[5:9, ::2]
        self.odd = [True, 1, 1.0, "a", None, float("inf"), np.float32(0.1), np.int64(3)]
        self.queue = deque([1, (2, self.grid)], maxlen=3)
        self.table = {(1, "b"): self.fan, self.fan: [], 2: {}}
        self.table["loop"] = self.table
        self.later = partial(self.reach, 2, at=[3])
        self.rng = np.random.default_rng(4)
        self.same_rng = self.rng
        self.none = np.zeros((0, 3), np.int32)

    def reach(self, a, at):
        return self, a, at

    def update(self, scan):
        return Pose2(0.0, 0.0, 0.0)

    def map(self):
        return None

    def report(self):
        return {}


def test_what_refers_to_the_same_does_so_again():
    one = Keeper(Keeper.Params())
    one.rng.random(3)
    it = copied(one)
    assert it.odd == one.odd and [type(v) for v in it.odd] == [type(v) for v in one.odd]
    assert it.table["loop"] is it.table and it.table[it.fan] == []
    assert it.table[1, "b"] is it.fan is it.scan.laser
    assert "angles" in one.fan.__dict__ and "angles" not in it.fan.__dict__
    assert it.queue.maxlen == 3 and it.queue[1][1] is it.grid
    assert it.later() == (it, 2, [3]) and it.later.func.__self__ is it
    assert str(it.scan.odometry) == str(one.scan.odometry)  # a zero's sign, too
    assert not it.scan.ranges.flags.writeable
    assert it.same_rng is it.rng and it.rng.random() == one.rng.random()
    assert (it.none.shape, it.none.dtype) == ((0, 3), np.int32)
    it.grid[6, 4] = 7.0
    assert it.corner[1, 2] == 7.0 and it.corner.strides == one.corner.strides


def test_a_row_of_a_log_does_not_bring_the_log(scans):
    log = np.zeros((2000, 1081), np.float32)
    graph = graph_of({"it": [log[3], log[900], log[3, 5:]]}, Home("tests"))
    assert [high - low for low, high in graph.spans] == [4 * 1081] * 2


@pytest.mark.parametrize("filling", [0.0, np.nan, -1.5])
def test_untouched_blocks_take_no_room(filling):
    array = np.full(100 * BLOCK + 3, filling, np.float32)
    array[70000:70010] = 5.0
    low = array.__array_interface__["data"][0]
    piece, kept = pack(low, low + array.nbytes)
    data = np.concatenate(list(kept))
    assert len(data) <= 2 * BLOCK
    whole, rest = unpack(piece, data)
    assert len(rest) == 0 and bytes(whole) == array.tobytes()


def test_what_no_state_can_keep_is_named(tmp_path):
    with pytest.raises(TypeError, match=r"kiss cannot be saved: slam\._new is of the class"):
        save(new("kiss"), tmp_path / "k")
    for bad in (
        {1, 2},
        np.array([None]),
        np.random.Generator(np.random.MT19937(0)),
        len,
        Exception,
    ):
        with pytest.raises(TypeError, match=r"it\[0\] "):
            graph_of({"it": [bad]}, Home("tests"))
    assert list(tmp_path.iterdir()) == []


def rewritten(source, target, change, sign=True):
    """A copy of a state with its texts changed, its digest right again if `sign`."""
    with zipfile.ZipFile(source) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    head, known = json.loads(parts["head.json"]), json.loads(parts["nodes.json"])
    changed = change(head, known)
    memory = changed if isinstance(changed, bytes) else parts["memory.bin"]
    text = json.dumps(known).encode()
    if sign:
        head["sha256"] = hashlib.sha256(text + memory).hexdigest()
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("memory.bin", memory)
        archive.writestr("nodes.json", text)
        archive.writestr("head.json", json.dumps(head))
    return target


def first(known, kind):
    return next(node for node in known["nodes"] if node[0] == kind)


def set_in(kind, index, value):
    def change(head, known):
        first(known, kind)[index] = value

    return change


def set_head(key, value):
    return lambda head, known: head.update({key: value})


def set_attribute(name, value):
    def change(head, known):
        known["nodes"][0][2] = [[k, value if k == name else v] for k, v in known["nodes"][0][2]]

    return change


def add_attribute(name):
    return lambda head, known: known["nodes"][0][2].append([name, 1])


CHANGES = {
    "another format": (set_head("format", "x"), "expected 'slams-state'"),
    "newer": (
        set_head("version", 9),
        "a state of version 9, written by slams 0.1.0; this one reads",
    ),
    "unknown algorithm": (set_head("algorithm", "hectr"), "unknown algorithm"),
    "somebody's module": (set_head("algorithm", "os:Path"), "say so"),
    "another algorithm": (
        set_head("algorithm", "tsd"),
        "there is no class 'hector.slam:Hector' for a state of tsd",
    ),
    "a foreign class": (set_in("object", 1, "subprocess:Popen"), "there is no class"),
    "a module of ours": (set_in("object", 1, "slams.cli:Parser"), "there is no class"),
    "no such class": (set_in("object", 1, "hector.slam:Hectr"), "there is no class"),
    "a function": (set_in("object", 1, "hector.slam:_solvers"), "there is no class"),
    "too many fields": (set_in("named", 2, [1] * 9), "fields, got 9"),
    "a type of Python": (set_in("array", 2, "|O"), "expected numbers"),
    "another type": (set_in("array", 2, "<i4"), "is a int32 array"),
    "names that are none": (set_in("array", 2, "named x os.system"), "node"),
    "names for plain numbers": (set_in("array", 2, "named x"), "array"),
    "more rows": (set_in("array", 3, [99999, 400]), "node"),
    "before the memory": (set_in("array", 5, -8), "node"),
    "no such piece": (set_in("array", 1, 10**6), "piece 1000000 of"),
    "no such node": (set_attribute("_map", [10**6]), "there is no node"),
    "a number for a map": (
        set_attribute("_map", 3),
        "slam._map is a number, expected of hector.map",
    ),
    "a missing attribute": (
        lambda head, known: known["nodes"][0][2].pop(),
        "slam has no",
    ),
    "a hidden method": (add_attribute("update"), "cannot have an attribute 'update'"),
    "a dunder": (add_attribute("__class__"), "cannot have an attribute"),
    "other parameters": (
        lambda head, known: (
            [
                n[2].__setitem__(0, ["seed", -3])
                for n in known["nodes"]
                if n[0] == "object" and n[1] == "hector.params:HectorParams"
            ]
            and None
        ),
        "parameter 'seed': got -3",
    ),
    "a giant": (lambda head, known: known["pieces"][0].__setitem__(1, 1 << 60), "expected"),
    "overlapping blocks": (
        lambda head, known: known["pieces"][0].__setitem__(3, [[0, 1], [0, 1]]),
        "blocks 0 and 1 more",
    ),
    "less memory": (lambda head, known: b"123", "have 3 bytes, expected"),
    "no nodes": (lambda head, known: known.pop("nodes"), "damaged"),
}


@pytest.mark.parametrize("kind", CHANGES)
def test_a_changed_file_is_refused_in_one_sentence(kind, kept, tmp_path):
    change, sentence = CHANGES[kind]
    path = rewritten(kept, tmp_path / "x.state", change)
    with pytest.raises((ValueError, LookupError)) as caught:
        load_state(path)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


JUNK = (
    None,
    -1,
    0,
    10**9,
    10**30,
    "x",
    "<f8",
    "hector.slam:Hector",
    [],
    [0],
    {},
    1.5,
    True,
    "list",
)


def spoiled(known, rng):
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


def test_whatever_stands_in_a_signed_file_is_read_or_refused_in_one_sentence(kept, tmp_path):
    rng, said = np.random.default_rng(0), []
    for _ in range(80):
        path = rewritten(kept, tmp_path / "x", lambda head, known: spoiled(known, rng))
        try:
            load_state(path)
        except ValueError as error:
            said.append(str(error))
    assert len(said) > 60
    assert all(text.startswith(str(path)) and "\n" not in text for text in said)


def test_an_unsigned_change_is_noticed(kept, tmp_path):
    path = rewritten(kept, tmp_path / "x", set_attribute("frozen", True), sign=False)
    with pytest.raises(ValueError, match="its sha256 differs"):
        load_state(path)
    assert load_state(rewritten(kept, path, set_attribute("frozen", True))).frozen is True


def test_a_damaged_file_is_refused_in_one_sentence(kept, tmp_path):
    data, rng = kept.read_bytes(), np.random.default_rng(0)
    path = tmp_path / "x.state"
    cuts = [data[:n] for n in (0, 3, 100, len(data) // 2, len(data) - 1)]
    flips = []
    for at in rng.integers(0, len(data), 60).tolist():
        flips.append(data[:at] + bytes([data[at] ^ (1 << (at % 8))]) + data[at + 1 :])
    said, whole = [], load_state(kept)
    for case in [*cuts, *flips, b"just text", b"PK\x03\x04 not quite"]:
        path.write_bytes(case)
        try:  # some bits of a zip mean nothing: how far back the zeros are that are repeated
            np.testing.assert_array_equal(load_state(path).map().p, whole.map().p)
        except ValueError as error:
            said.append(str(error))
    assert all(text.startswith(str(path)) and "\n" not in text for text in said)
    assert len(said) >= 50
    with pytest.raises(FileNotFoundError, match="no such file"):
        load_state(tmp_path / "none")


def test_the_old_state_stays_whole_when_saving_fails(kept, tmp_path, monkeypatch):
    path = tmp_path / "x.state"
    shutil.copy(kept, path)
    with monkeypatch.context() as patch:
        patch.setattr("slams.state.archive.json.dumps", lambda *a, **k: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            save(new("hector"), path)
    assert path.read_bytes() == kept.read_bytes()
    assert [p.name for p in tmp_path.iterdir()] == ["x.state"]
    assert read_state(path).beside == {"t": 1.5}


def rows(folder):
    lines = (folder / "trajectory.tum").read_text().splitlines()
    return [line for line in lines if not line.startswith("#")]


def command(*arguments):
    return run.main([str(argument) for argument in arguments])


def test_a_run_goes_on_where_another_stopped(tmp_path, capsys):
    log, state = tmp_path / "room.npz", tmp_path / "s"
    drive(n=SCANS, lidar=laser(181)).save(log)
    out = {name: tmp_path / name for name in ("whole", "first", "second")}
    quiet = ("hector", log, "--set", "levels=2", "-q")
    assert command(*quiet, "--out", out["whole"]) == 0
    assert command(*quiet, "--limit", "12", "--save-state", state, "--out", out["first"]) == 0
    again = ("hector", log, "--resume-state", state)
    assert command(*again, "--save-state", state, "--out", out["second"]) == 0
    assert "note: goes on at scan 12 of 30" in capsys.readouterr().err
    lines = {name: rows(path) for name, path in out.items()}
    assert lines["first"] + lines["second"] == lines["whole"]
    assert (out["second"] / "map.pgm").read_bytes() == (out["whole"] / "map.pgm").read_bytes()
    summary = json.loads((out["second"] / "summary.json").read_text())
    assert summary["parameters"]["levels"] == 2
    assert command(*again) == 2
    assert "all its 30 scans are in the state already" in capsys.readouterr().err


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


def test_what_does_not_fit_a_run_is_refused(kept, tmp_path, capsys):
    log = tmp_path / "room.npz"
    drive(n=3, lidar=laser(91)).save(log)
    resume = ["--resume-state", kept]
    for arguments, sentence in (
        (["tsd", log, *resume], "the state of hector, expected one of tsd"),
        (
            ["hector", log, *resume, "--set", "resolution=0.1"],
            "saved with resolution 0.05, got 0.1",
        ),
        (["hector", log, "--resume-state", log], "not a state: no head.json"),
        (["hector", log, "--resume-state", tmp_path], "is a directory; expected a state"),
        (["hector", log, "--save-state", tmp_path / "no" / "x"], "no such folder"),
        (["hector", log, "--save-state", tmp_path], "is a folder"),
        (["kiss", log, "--save-state", tmp_path / "k"], "kiss cannot be saved"),
    ):
        assert command(*arguments, "--out", tmp_path / "out") == 2
        captured = capsys.readouterr()
        assert sentence in captured.err and captured.err.count("\n") == 1
    assert not (tmp_path / "out").exists()
