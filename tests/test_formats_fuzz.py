"""Thousands of damaged files: each is read or refused in one sentence, and nothing is left."""

import gzip
import time

import cv2
import numpy as np
import pytest
import yaml

import slams
from slams import convert
from slams.formats import occupancy, trajectory
from tests import bags
from tests.test_formats_text import FLASER, HEADER, RAW, ROBOT

CASES, SLOWEST = 2000, 5.0  # [s] that one file may take on a busy machine
EXTREMES = (b"\xff\xff\xff\xff", b"\0\0\0\0", b"\xff\xff\xff\x7f", b"\0\0\x80\x7f")
WORDS = (b"nan", b"inf", b"-1", b"1e400", b" ", b"\n", b"0", b"99999999999", b"-", b"\0")


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
    def text(folder):
        few = template.replace("181", "4").format("1.0 2.0 3.0 4.0", "")
        lines = ["ODOM 0 0 0.1 0 0 0 100.0 h 0", "TRUEPOS 0 0 0.1 0 0 0 100.0 h 0", few, few]
        return (HEADER + "\n".join(lines) + "\n").encode()

    return text


def recorded(kind):
    return lambda folder: bags.write(folder, kind, bag).read_bytes()


def npz(folder):
    convert.main([str(bags.write(folder, "mcap", bag)), str(folder / "whole.npz"), "-q"])
    return (folder / "whole.npz").read_bytes()


def dat(folder):
    row = "212387282 14710 29221 25178 " + "0 " * 21 + "1000 " * 682 + "\n"
    return (row * 2).encode()


FILES = {
    "bag": recorded("bag"),
    "bag-bz2": recorded("bag-bz2"),
    "bag-lz4": recorded("bag-lz4"),
    "mcap": recorded("mcap"),
    "db3": recorded("db3"),
    "npz": npz,
    "flaser": carmen(FLASER),
    "rawlaser": carmen(RAW),
    "robotlaser": carmen(ROBOT),
    "carmen.gz": lambda folder: gzip.compress(carmen(FLASER)(folder) * 20, mtime=0),
    "dat": dat,
}


@pytest.mark.parametrize("kind", FILES)
def test_damaged_logs(kind, tmp_path, capsys):
    whole = FILES[kind](tmp_path / "whole") if kind != "npz" else npz(tmp_path)
    rng = np.random.default_rng(0)
    folder = tmp_path / "cases"
    folder.mkdir()
    path, out = folder / f"x.{kind.partition('-')[0]}", folder / "out.npz"
    refused = 0
    for case in range(CASES):
        path.write_bytes(mutated(whole, rng))
        salvage = case % 2 == 1
        start = time.perf_counter()
        if case % 20 == 0:
            refused += convert.main([str(path), str(out), "-q"]) == 2
            check_output(out, capsys.readouterr().err)
        else:
            refused += refused_in_a_sentence(lambda: slams.load(path, salvage=salvage))  # noqa: B023
        assert time.perf_counter() - start < SLOWEST, case
    assert list(folder.iterdir()) == [path]
    assert 0 < refused < CASES


def check_output(out, err):
    """Either the whole output or one line of refusal."""
    assert out.exists() == (err == "")
    if out.exists():
        slams.load(out)
        out.unlink()
    else:
        assert err.count("\n") == 1


def test_damaged_metadata_of_a_folder(tmp_path, capsys):
    folder = bags.write(tmp_path, "folder-mcap", bag)
    whole = (folder / "metadata.yaml").read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(CASES // 20):  # the library takes long to read yaml
        (folder / "metadata.yaml").write_bytes(mutated(whole, rng))
        code = convert.main([str(folder), str(tmp_path / "out.npz"), "-q"])
        assert code in (0, 2)
        assert capsys.readouterr().err.count("\n") == (code == 2)


def refused_in_a_sentence(work):
    """Whether the work raised one of the two errors that users see."""
    try:
        work()
    except (ValueError, OSError) as error:
        return len(str(error).splitlines()) == 1
    return False


@pytest.mark.parametrize("kind", ["tum", "csv"])
def test_damaged_trajectories(kind, tmp_path):
    t, poses = np.arange(5.0), np.ones((5, 3))
    path = tmp_path / "t"
    (trajectory.write_tum if kind == "tum" else trajectory.write_csv)(path, t, poses)
    whole, rng = path.read_bytes(), np.random.default_rng(0)

    def read():
        read_t, read_poses = trajectory.read(path)
        assert read_poses.shape == (len(read_t), 3)

    refused = 0
    for _ in range(CASES):
        path.write_bytes(mutated(whole, rng))
        refused += refused_in_a_sentence(read)
    assert 0 < refused < CASES


@pytest.mark.parametrize("part", ["m.yaml", "m.pgm"])
def test_damaged_maps(part, tmp_path):
    cv2.imwrite(str(tmp_path / "m.pgm"), np.full((3, 4), 205, np.uint8))
    entries = {"image": "m.pgm", "resolution": 0.05, "origin": [0.0, 0.0, 0.0], "negate": 0}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(entries))
    whole, rng = (tmp_path / part).read_bytes(), np.random.default_rng(0)
    refused = 0
    for _ in range(CASES // 4):
        (tmp_path / part).write_bytes(mutated(whole, rng))
        refused += refused_in_a_sentence(lambda: occupancy.read_map(tmp_path / "m.yaml"))
    assert 0 < refused < CASES // 4
