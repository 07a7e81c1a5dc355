"""Hundreds of damaged files of every kind: each is read or refused in one sentence."""

import gzip

import numpy as np
import pytest

import slams
from slams import convert
from slams.formats import occupancy, trajectory
from slams.registry import find
from slams.ros import ros_params
from slams.state import load_state, save
from slams.types import OccupancyGrid
from tests import bags
from tests.rooms import settled
from tests.slams.formats.test_text import FLASER, HEADER, RAW, ROBOT
from tests.slams.ros.test_ros_params import HECTOR_LAUNCH, TREES

CASES = 800
EXTREMES = (b"\xff\xff\xff\xff", b"\0\0\0\0", b"\xff\xff\xff\x7f", b"\0\0\x80\x7f")
WORDS = (b"nan", b"inf", b"-1", b"1e400", b" ", b"\n", b"0", b"99999999999", b"-", b"\0", b"<{&")


def mutated(data, rng):
    """A few bytes changed, lost or put in between; sometimes the end missing."""
    data = bytearray(data)
    for _ in range(rng.integers(1, 6)):
        at, kind = int(rng.integers(0, len(data) + 1)), rng.integers(0, 7)
        if kind == 0:
            data[at : at + 1] = bytes([rng.integers(0, 256)])
        elif kind == 1 and at < len(data):
            data[at] ^= 1 << int(rng.integers(0, 8))
        elif kind == 2:
            del data[at : at + int(rng.integers(1, 64))]
        elif kind == 3:
            data[at:at] = rng.integers(0, 256, rng.integers(1, 16), np.uint8).tobytes()
        elif kind == 4:
            data[at : at + 4] = EXTREMES[rng.integers(0, len(EXTREMES))]
        elif kind == 5:
            data[at : at + int(rng.integers(0, 4))] = WORDS[rng.integers(0, len(WORDS))]
        elif rng.random() < 0.3:
            del data[at:]
    return bytes(data)


def bag(make):
    messages = [("/tf_static", 1.0, make.tf(1.0, ("base_link", "laser", (0.1, 0, 0), 0.1, 0.0)))]
    for i in range(3):
        t = 1.0 + 0.1 * i
        messages += [
            ("/scan", t, make.scan(t, [1.0, 2.0, 3.0])),
            ("/imu", t, make.imu(t, (0.0, 0.0, 1.0))),
            ("/tf", t, make.tf(t, ("odom", "base_link", (i, 0, 0), 0.0, 0.0))),
        ]
    return messages


def carmen(template):
    few = template.replace("181", "4").format("1.0 2.0 3.0 4.0", "")
    lines = ["ODOM 0 0 0.1 0 0 0 100.0 h 0", "TRUEPOS 0 0 0.1 0 0 0 100.0 h 0", few, few]
    return (HEADER + "\n".join(lines) + "\n").encode()


def npz(folder):
    bag_path = bags.write(folder, "mcap", bag)
    assert convert.main([str(bag_path), str(folder / "whole.npz"), "-q"]) == 0
    return (folder / "whole.npz").read_bytes()


LOGS = {
    kind: lambda folder, kind=kind: bags.write(folder, kind, bag).read_bytes()
    for kind in bags.KINDS[:5]
} | {
    "npz": npz,
    "flaser": lambda _: carmen(FLASER),
    "rawlaser": lambda _: carmen(RAW),
    "robotlaser": lambda _: carmen(ROBOT),
    "carmen.gz": lambda _: gzip.compress(carmen(FLASER) * 20, mtime=0),
}
PARAMETERS = {
    "launch": ("hector", HECTOR_LAUNCH),
    "ROS 1 yaml": ("gmapping", TREES["a dump"]),
    "ROS 2 yaml": ("gmapping", TREES["ROS 2, two nodes"]),
}


def check(read, path, whole, cases=CASES, package=""):
    """Every damaged copy is read, or refused by one line that names the file or a ROS package."""
    rng = np.random.default_rng(0)
    sentences = []
    for case in range(cases):
        path.write_bytes(mutated(whole, rng))
        try:
            read(path, case)
        except (ValueError, OSError) as error:
            sentences.append(str(error))
    assert 0 < len(sentences) < cases
    for sentence in sentences:
        assert len(sentence.splitlines()) == 1, sentence
        assert str(path.parent) in sentence or (package and sentence.startswith(package)), sentence


@pytest.mark.parametrize("kind", LOGS)
def test_damaged_logs(kind, tmp_path):
    whole = LOGS[kind](tmp_path / "whole")
    (tmp_path / "cases").mkdir()
    path = tmp_path / "cases" / f"x.{kind.partition('-')[0]}"
    check(lambda path, case: slams.load(path, salvage=case % 2 == 1), path, whole)
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("kind", ["bag", "flaser", "npz"])
def test_a_command_ends_with_its_whole_output_or_one_line(kind, tmp_path, capsys):
    whole, rng = LOGS[kind](tmp_path / "whole"), np.random.default_rng(1)
    path, out, codes = tmp_path / "x", tmp_path / "out.npz", set()
    for _ in range(40):
        path.write_bytes(mutated(whole, rng))
        codes.add(code := convert.main([str(path), str(out), "-q"]))
        assert (code == 0) == out.exists() == (capsys.readouterr().err.count("\n") == 0)
        if out.exists():
            slams.load(out)
            out.unlink()
    assert codes == {0, 2}


def test_damaged_metadata_of_a_folder(tmp_path):
    path = bags.write(tmp_path, "folder-mcap", bag) / "metadata.yaml"
    whole = path.read_bytes()  # of which the library takes long to read the yaml
    check(lambda path, _: slams.load(path.parent), path, whole, CASES // 4)


def test_damaged_states(tmp_path):
    def read(path, _):  # some bits of a zip mean nothing
        np.testing.assert_array_equal(load_state(path).map().p, slam.map().p)

    slam = settled("hector", 3)
    save(slam, tmp_path / "whole")
    check(read, tmp_path / "x.state", (tmp_path / "whole").read_bytes(), CASES // 8)


def test_damaged_trajectories(tmp_path):
    def read(path, _):
        t, poses = trajectory.read(path)
        assert poses.shape == (len(t), 3)

    trajectory.write_tum(tmp_path / "whole", np.arange(5.0), np.ones((5, 3)))
    check(read, tmp_path / "t", (tmp_path / "whole").read_bytes())


@pytest.mark.parametrize("part", ["map.yaml", "map.pgm"])
def test_damaged_maps(part, tmp_path):
    unknown = np.full((3, 4), np.nan, np.float32)
    occupancy.write_map(tmp_path, OccupancyGrid(unknown, 0.05, (0.0, 0.0)))
    path = tmp_path / part
    check(lambda *_: occupancy.read_map(tmp_path / "map.yaml"), path, path.read_bytes())


@pytest.mark.parametrize("kind", PARAMETERS)
def test_damaged_parameter_files(kind, tmp_path):
    label, text = PARAMETERS[kind]
    params = find(label).params()

    def read(path, _):
        ros_params.report(ros_params.take(params, [path]), label)

    check(read, tmp_path / "file", text.encode(), package=params.ROS.package)
