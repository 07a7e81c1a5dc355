"""What tables and sentences say of runs: units, ranks, who is left out."""

import pytest

from bench.report import run_tables, words
from bench.report.numbers import cell
from bench.results import Comparison, LogResult, Outcome, Reference


def row(name="a", error=0.002, ate=0.01, ms=1.0, factor=20.0, **more):
    """A run's row; `error` [m] over a second."""
    mean = {"mean": error}
    known = {
        "algorithm": name,
        "failed": None,
        "posed": 0.5,
        "used": ["laser"],
        "errors": {
            "ate_m": ate,
            "end_m": 0.02,
            "drift": 0.001,
            "dropped": 0,
            "spans": {"1 s": {"se2_translation_m": mean, "orientation_rad": {"mean": 2 * error}}},
        },
        "relations": None,
        "loss": {"lost": False, "by": "truth", "truth": {"completed": 1.0}, "report": {"scans": 3}},
        "cost": {"mean_ms": ms, "real_time_factor": factor},
    }
    return known | more


def strayed(name="a", by="truth", **more):
    verdict = {"at_s": 4.0, "after_m": 2.0, "completed": 0.25, "lost": True}
    other = {"at_s": 9.0, "after_m": None, "completed": 0.75, "lost": True}
    loss = {"lost": True, "by": by, "truth": verdict, "relations": other, "report": {"scans": 3}}
    return row(name, loss=loss, **more)


def compared(*logs):
    """A comparison of rows, log by log."""
    results = [
        LogResult(Reference({"name": f"l{k}", "notes": []}), [Outcome(row) for row in rows])
        for k, rows in enumerate(logs)
    ]
    return Comparison({}, results, [])


# runs


def test_a_glance_gives_multiples_of_the_bound():
    log = {"bound": {"spans": {"1 s": {"translation_m": 0.001, "rotation_rad": 0.1}}}}
    line = run_tables.glance_table(log, [row(error=0.002)]).loc["a"]
    assert line["x bound"] == pytest.approx(2.0)
    assert (line["1 s [mm]"], line["1 s [mrad]"], line["ATE [mm]"]) == (2.0, 4.0, 10.0)
    assert line["within limits [%]"] == 100.0 and line["posed [%]"] == 50.0


@pytest.mark.parametrize(("by", "at"), [("truth", 4.0), ("relations", 9.0)])
def test_a_lost_run_tells_when_by_what_judged_it(by, at):
    table = run_tables.overview_table({}, [strayed(by=by), row("b")])
    assert table.loc["a (lost)", "lost at [s]"] == at
    assert table.loc["a (lost)", "within limits [%]"] == 25.0
    assert table.loc["b"].isna()["lost at [s]"]


def test_a_figure_of_a_map_that_means_nothing_is_left_out():
    found = {
        "iou": {"value": 0.5, "meaningful": True},
        "adnn_to_truth": {"value": 0.02, "meaningful": True},
        "ssim": {"value": 0.9, "meaningful": False},
    }
    table = run_tables.map_table({}, [row(map=found)])
    assert table.to_dict("index") == {"a": {"IoU": 0.5, "ADNN to truth [mm]": 20.0}}


def test_over_logs_the_lost_rank_last_and_those_alike_share_their_ranks():
    comparison = compared(
        [row("a", 0.001), row("b", 0.002), row("c", 0.002), strayed("d")],
        [row("a", 0.005), row("b", 0.002), strayed("c"), strayed("d")],
    )
    table = run_tables.logs_table(comparison)
    assert table["mean rank"].tolist() == [1.5, 1.75, 3.0, 3.75]
    assert table["lost or failed"].tolist() == [0, 0, 1, 2]
    assert table["worst log"].tolist()[:3] == ["l1", "l0", "l1"]
    assert table["mean [mm]"].tolist()[:3] == [3.0, 2.0, 2.0]


# sentences


def test_the_answer_is_about_those_that_survive_most_and_not_about_baselines():
    logs = [
        [row("a", 0.003, ms=3.0), row("b", 0.002, ms=4.0), row("c", 0.001), row("odometry", 0.0)],
        [row("a", 0.003, ms=3.0), row("b", 0.002, ms=6.0), strayed("c"), row("odometry", 0.0)],
    ]
    accurate, survives, cheapest = words.answer(compared(*logs))
    assert accurate == "Most accurate: b (laser), 2.00 mm over a second."
    assert survives == "Survives most: a and b, 2 of 2 logs."
    assert cheapest == "Cheapest of those: a, 3.000 ms per scan."


def test_a_log_is_told_with_who_was_lost_and_who_is_too_slow():
    rows = [row("a", ms=2.0, factor=0.5), strayed("b", ms=3.0, factor=20.0)]
    text = " ".join(words.summary({}, rows))
    assert "a is the most accurate" in text
    assert "b was lost after 4.0 s and 2.0 m." in text
    assert "slower than the scans came: a." in text
    assert "every run kept up" in " ".join(words.summary({}, rows[1:]))


def test_nothing_and_what_is_no_number_is_a_dash():
    assert [cell("ATE [mm]", value) for value in (None, float("nan"), 1.234)] == ["-", "-", "1.23"]
