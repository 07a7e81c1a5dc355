"""Where the laser of a CARMEN log sits, though some of its lines are odd."""

import pytest

from slams.formats.carmen import read
from slams.formats.options import SourceOptions
from slams.types import Pose2


def test_the_mount_is_what_most_lines_agree_on(tmp_path):
    lines = []
    for k in range(9):
        robot = Pose2(0.1 * k, 0.0, 0.02 * k)
        mount = Pose2(0.9, 0.0, 0.0) if k in (0, 5) else Pose2(0.2, 0.0, 0.0)
        laser = robot @ mount
        numbers = " ".join(f"{v:.6f}" for v in (*laser, *robot))
        lines.append(f"FLASER 3 1.0 1.1 1.2 {numbers} {k}.0 host {k}.0")
    path = tmp_path / "odd.log"
    path.write_text("\n".join(lines) + "\n")
    log = read(path, SourceOptions())
    assert log.laser.mount == pytest.approx(Pose2(0.2, 0.0, 0.0), abs=1e-5)
    assert not any("do not move together" in note for note in log.notes)
