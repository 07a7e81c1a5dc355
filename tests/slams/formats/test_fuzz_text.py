"""Hundreds of damaged files that are no bags: each is read or refused in one sentence."""

import gzip

import cv2
import numpy as np
import pytest
import yaml

from slams import convert
from slams.formats import occupancy, trajectory
from tests import bags
from tests.slams.formats.test_fuzz import CASES, bag, check_damaged, mutated, refused_in_a_sentence
from tests.slams.formats.test_text import FLASER, HEADER, RAW, ROBOT


def carmen(template):
    def text(folder):
        few = template.replace("181", "4").format("1.0 2.0 3.0 4.0", "")
        lines = ["ODOM 0 0 0.1 0 0 0 100.0 h 0", "TRUEPOS 0 0 0.1 0 0 0 100.0 h 0", few, few]
        return (HEADER + "\n".join(lines) + "\n").encode()

    return text


def npz(folder):
    convert.main([str(bags.write(folder, "mcap", bag)), str(folder / "whole.npz"), "-q"])
    return (folder / "whole.npz").read_bytes()


FILES = {
    "npz": npz,
    "flaser": carmen(FLASER),
    "rawlaser": carmen(RAW),
    "robotlaser": carmen(ROBOT),
    "carmen.gz": lambda folder: gzip.compress(carmen(FLASER)(folder) * 20, mtime=0),
}


@pytest.mark.parametrize("kind", FILES)
def test_damaged_logs(kind, tmp_path, capsys):
    check_damaged(kind, FILES[kind](tmp_path / "whole"), tmp_path, capsys)


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
        refused += refused_in_a_sentence(read, tmp_path)
    assert 0 < refused < CASES


@pytest.mark.parametrize("part", ["m.yaml", "m.pgm"])
def test_damaged_maps(part, tmp_path):
    cv2.imwrite(str(tmp_path / "m.pgm"), np.full((3, 4), 205, np.uint8))
    entries = {"image": "m.pgm", "resolution": 0.05, "origin": [0.0, 0.0, 0.0], "negate": 0}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(entries))
    whole, rng = (tmp_path / part).read_bytes(), np.random.default_rng(0)
    refused = 0
    for _ in range(CASES):
        (tmp_path / part).write_bytes(mutated(whole, rng))
        refused += refused_in_a_sentence(lambda: occupancy.read_map(tmp_path / "m.yaml"), tmp_path)
    assert 0 < refused < CASES
