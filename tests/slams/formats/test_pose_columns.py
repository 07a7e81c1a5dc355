"""Columns of trajectories: headers that come again, and names that others give them."""

import numpy as np
import pytest

from slams.formats.trajectory import read

HEADER = "t,x,y,theta\n"
ROWS = ["0.0,1.0,2.0,0.5\n", "0.1,1.5,2.5,0.6\n"]


def test_a_header_that_comes_again_between_the_rows_is_no_row(tmp_path):
    path = tmp_path / "joined.csv"
    path.write_text(HEADER + ROWS[0] + HEADER + ROWS[1])
    t, poses = read(path)
    assert t.tolist() == [0.0, 0.1]
    assert poses == pytest.approx(np.array([[1.0, 2.0, 0.5], [1.5, 2.5, 0.6]]))
