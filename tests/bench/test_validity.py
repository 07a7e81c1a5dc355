"""Whether measures without a truth rank runs as the truth does: the table by hand, bad options."""

import pytest

from bench import validity
from bench.report.unaided import MEASURES


def run(drive, measure, ate, second):
    values = dict.fromkeys(MEASURES, measure)
    return {"drive": drive, "ate_m": ate, "second_m": second, "measures": values}


def test_the_correlation_is_that_of_ranks_within_each_drive():
    runs = [run("a", k, 10.0**k, -k) for k in range(4)]
    runs += [run("b", 1000.0 * k, (4 - k) * 1e-6, k) for k in range(5)]
    runs += [run("too few", k, k, k) for k in range(3)]
    runs[0]["measures"]["conflict [%]"] = None
    table = validity.table({"runs": runs})
    assert list(table.index) == list(MEASURES)
    assert table.loc["walls [x]"].to_dict() == {
        "runs": 12,
        "with ATE": pytest.approx(0.0),  # the mean of 1 and -1
        "with error over 1 s": pytest.approx(0.0),
    }
    assert table.loc["conflict [%]", "runs"] == 11
    assert table.loc["conflict [%]", "with ATE"] == pytest.approx(-1.0)


def test_every_condition_is_one_of_the_catalog_and_no_option_out_of_range(tmp_path, capsys):
    from bench.sim.degrade import parse

    for _, condition in validity.DRIVES:
        parse(condition)
    assert validity.main(["--drives", "0", "--out", str(tmp_path / "out")]) == 2
    assert "--drives: got 0, expected 1 to 10" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
