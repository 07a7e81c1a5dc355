"""A peer of another vendor: Fast DDS, ROS 2's usual one, where its library is installed."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from slams.ros.messages import MAP_TYPE, POSE_COV_TYPE, TF_TYPE, typestore
from tests.slams.live.commands import DOMAIN, PATIENCE, started
from tests.slams.live.robots import scan_record

pytest.importorskip("cyclonedds", reason="needs the extra live")

SOURCE = Path(__file__).with_name("fast_dds_peer.cpp")
HEADER = Path("/usr/include/fastdds/dds/domain/DomainParticipant.hpp")
TOPICS = {"rt/map": MAP_TYPE, "rt/tf": TF_TYPE, "rt/pose": POSE_COV_TYPE}


def test_a_robot_with_fast_dds_is_mapped_and_gets_map_pose_and_transform(tmp_path):
    if shutil.which("g++") is None or not HEADER.exists():
        pytest.skip("needs g++ and Fast DDS (Debian: libfastrtps-dev)")
    peer, libraries = str(tmp_path / "peer"), ("-lfastrtps", "-lfastcdr")
    words = ["g++", "-std=c++17", "-O0", str(SOURCE), *libraries, "-o", peer]
    built = subprocess.run(words, capture_output=True, text=True)
    if built.returncode:
        pytest.skip(f"the installed Fast DDS has another interface: {built.stderr[:200]}")
    (tmp_path / "scan.cdr").write_bytes(scan_record(0.0).data)
    more = ("--out", "out", "--map-every", 0.2)
    live = started("slams.live", "hector", *more, folder=tmp_path)
    assert "ready for scans on /scan" in live.stderr.readline()
    words = [peer, str(DOMAIN), "scan.cdr", str(int(PATIENCE))]
    robot = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert robot.returncode == 0, robot.stderr
    got = {}
    for line in robot.stdout.splitlines():
        topic, data = line.split()
        got[topic] = typestore().deserialize_cdr(bytes.fromhex(data), TOPICS[topic])
    edge, grid = got["rt/tf"].transforms[0], got["rt/map"]
    assert (edge.header.frame_id, edge.child_frame_id) == ("map", "laser")
    assert edge.transform.rotation.w == pytest.approx(1.0, abs=1e-3)
    assert grid.header.frame_id == "map"
    assert len(grid.data) == grid.info.width * grid.info.height
    assert {-1, 100} <= set(np.unique(grid.data).tolist())
    assert abs(got["rt/pose"].pose.pose.position.x) < 0.01
