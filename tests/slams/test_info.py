"""slams info: what is in a log, what is assumed, who can use it."""

from dataclasses import replace

import numpy as np
import pytest

from slams import info
from slams.ros.messages import SCAN_TYPE
from slams.scanlog import TimeSeries
from tests import bags
from tests.rooms import drive


def lines_of(capsys, *words):
    assert info.main([*map(str, words)]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    return printed.out.splitlines()


def recorded(make):
    """Two lasers, of which one has no transform; the odometry moves by tf; a gap of 1.1 s."""
    found = [
        ("/tf_static", 0.0, make.tf(0.0, ("base_link", "laser", (0.1, 0, 0), 0.0, 0.0))),
        ("/chat", 0.0, make.string("x")),
    ]
    for k in range(20):
        t = 0.1 * k + (1.0 if k > 10 else 0.0)
        found.append(("/scan", t, make.scan(t, [2.0] * 20, beam=0.001)))
        found.append(("/rear", t, make.scan(t, [2.0] * 20, frame="rear")))
        found.append(("/tf", t, make.tf(t, ("odom", "base_link", (0.01 * k, 0, 0), 0.0, 0.0))))
    return found


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_a_bag_is_shown_by_topics_frames_lasers_gaps_and_uses(kind, tmp_path, capsys):
    lines = lines_of(capsys, bags.write(tmp_path, kind, recorded))
    assert lines[0] == f"drive.{kind}: 62 messages"
    assert f"  /scan           20  {SCAN_TYPE}" in lines
    assert f"  /chat            1  {bags.STRING}" in lines
    assert "  frame base_link in odom: moves, 20 stamps" in lines
    assert "  frame laser in base_link: fixed" in lines
    assert "drive: 20 scans of 20 beams, 10.0 Hz, 2.9 s" in lines
    assert "odometry: 20 stamps, 10.0 Hz from tf odom" in lines
    assert "frames: scans /scan in laser" in lines
    assert "frames: poses are of base_link" in lines
    assert "each scan: swept in 20 ms, which is deskewed" in lines
    assert "gaps of the scans: 1, the longest 1.10 s after 1.0 s" in lines
    usable = "usable by: slams run, play, convert, compare (pose errors with --relations"
    assert any(line.startswith(usable) for line in lines)
    (rear,) = [line for line in lines if line.startswith("/rear cannot be used: ")]
    assert "laser's frame rear" in rear
    assert lines[-1] == "2 lasers: --scan-topic picks one, or several (given for each)"


def test_a_laser_that_is_picked_is_the_only_one_shown(tmp_path, capsys):
    lines = lines_of(capsys, bags.write(tmp_path, "mcap", recorded), "--scan-topic", "/scan")
    assert not any("rear" in line for line in lines if not line.startswith("  /rear"))


def test_topics_are_shown_of_a_bag_without_scans(tmp_path, capsys):
    path = bags.write(tmp_path, "bag", lambda make: [("/chat", 0.0, make.string("x"))])
    lines = lines_of(capsys, path)
    assert lines[1] == f"  /chat       1  {bags.STRING}"
    assert lines[2].startswith(f"the log cannot be used: {path}: no laser scans; expected")


def test_an_npz_with_a_truth_can_be_compared_and_swept(tmp_path, capsys):
    log = drive(n=5)
    level = replace(log.laser, mount_z=0.25)
    replace(log, laser=level, attitude=TimeSeries(log.t, np.zeros((5, 2)))).save(tmp_path / "a.npz")
    lines = lines_of(capsys, tmp_path / "a.npz")
    assert lines[0] == "room: 5 scans of 361 beams, 20.0 Hz, 0.2 s"
    assert lines[1].endswith(", 0.250 m above the floor")
    assert "attitude: 5 stamps, 20.0 Hz" in lines
    assert "each scan: taken as instantaneous, no time between beams is known" in lines
    assert lines[-1] == "usable by: slams run, play, convert, compare, sweep"


def test_a_source_of_other_keys_is_no_error(tmp_path, capsys):
    replace(drive(n=2), meta={"source": {"base_frame": "base"}}).save(tmp_path / "a.npz")
    assert not any(line.startswith("frames") for line in lines_of(capsys, tmp_path / "a.npz"))


def test_the_lasers_of_a_carmen_log_are_shown(tmp_path, capsys):
    pose = "0 0 0 0 0 0 1.0 host 1.0"
    (tmp_path / "a.log").write_text(f"FLASER 2 1.0 2.0 {pose}\nRLASER 2 1.0 2.0 {pose}\n" * 2)
    lines = lines_of(capsys, tmp_path / "a.log")
    assert lines[:2] == ["  FLASER  2 lines", "  RLASER  2 lines"]


def test_a_damaged_bag_is_refused_unless_salvaged(tmp_path, capsys):
    path = bags.write(tmp_path, "bag", recorded)
    path.write_bytes(path.read_bytes()[:-200])
    assert info.main([str(path)]) == 2
    assert "cut short or damaged" in capsys.readouterr().err
    lines = lines_of(capsys, path, "--salvage")
    assert any(line.startswith("assumed: cut short or damaged") for line in lines)
