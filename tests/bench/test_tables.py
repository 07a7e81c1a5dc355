"""What tables and sentences say of runs: units, ranks, rows that are left out."""

import pytest

from bench.report import tables, words
from bench.report.lines import cell, line
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


def test_the_one_table_has_error_loss_and_cost_in_their_units():
    cost = {"mean_ms": 0.5, "real_time_factor": 9.0, "peak_memory_mb": 70.0, "start_up_s": 0.25}
    table = tables.main_table({}, [row(error=0.002, cost=cost), strayed("b")])
    errors = {"1 s [mm]": 2.0, "ATE [mm]": 10.0, "lost": "no"}
    costs = {"CPU [ms]": 0.5, "memory [MB]": 70.0, "start-up [s]": 0.25}
    assert table.loc["a"].to_dict() == errors | costs | {"used": "laser"}
    assert table.loc["b (lost)", "lost"] == "after 4 s"


def test_the_papers_tables_have_the_error_per_update_in_meters_and_radians():
    figures = {"mean": 0.25, "std": 0.5, "min": 0.125, "max": 1.0}
    kinds = {"translation_m": figures, "orientation_rad": {k: 2.0 * v for k, v in figures.items()}}
    one = row()
    one["errors"]["spans"]["update"] = kinds
    for kind, found in kinds.items():
        expected = zip(("mean", "deviation", "min", "max"), found.values(), strict=True)
        assert line(one, tables._update(kind)) == dict(expected)


def test_relations_are_in_meters_and_radians_with_their_number():
    errors = {"translation_m": {"mean": 0.5, "std": 0.25}, "rotation_rad": {"mean": 2, "std": 1}}
    found = line(row(relations={"loops": errors | {"used": 7}}), tables._relations("loops", "l "))
    assert found == {"l [m]": 0.5, "l ± [m]": 0.25, "l [rad]": 2, "l ± [rad]": 1, "l relations": 7}


def test_without_a_truth_the_one_table_has_what_stands_for_it():
    rows = [unaided("a", 20.0, 0.01, 0.03), unaided("b", 25.0, 0.02, None)]
    table = tables.main_table({}, rows)
    figures = {"walls [x]": 1.25, "revisits [mm]": 20.0, "disagreement [mm]": 0}
    more = {"lost": "no", "CPU [ms]": 1.0, "used": "laser"}
    assert table.loc["b"].to_dict() | {"disagreement [mm]": 0} == figures | more
    assert tables.unaided_table({}, rows).empty
    truth = [unaided("a", 20.0, 0.01, 0.03) | {"errors": row()["errors"]}]
    assert tables.unaided_table({}, truth).loc["a", "disagreement [mm]"] == 30.0


def unaided(name, area, revisits, apart):
    found = {"walls_m2": area, "revisits_m": revisits, "revisits": 3}
    loss = {"lost": False, "by": "report", "report": {"scans": 0}}
    more = {"consistency": found, "disagreement_m": apart, "conflict": None}
    return row(name, errors=None, loss=loss, **more)


@pytest.mark.parametrize(("by", "at"), [("truth", "after 4 s"), ("relations", "after 9 s")])
def test_a_lost_run_tells_when_by_what_judged_it(by, at):
    assert tables.main_table({}, [strayed(by=by)]).loc["a (lost)", "lost"] == at
    table = tables.tables({"name": "l"}, [strayed(by=by), row("b")])["overview"].frame
    assert table.loc["a (lost)", "lost after [m]"] == 2.0
    assert table.loc["a (lost)", "within limits [%]"] == 25.0
    assert table.loc["b"].isna()["lost after [m]"] and table.loc["b", "drift [mm/m]"] == 1.0


def test_a_figure_of_a_map_that_means_nothing_is_left_out():
    found = {"iou": 0.5, "adnn_to_truth": 0.02, "coverage": None}
    table = tables.tables({"name": "l"}, [row(map=found)])["maps"].frame
    assert table.to_dict("index") == {"a": {"IoU": 0.5, "ADNN to truth [mm]": 20.0}}


def test_over_logs_the_lost_rank_last_and_those_alike_share_their_ranks():
    comparison = compared(
        [row("a", 0.001), row("b", 0.002), row("c", 0.002), strayed("d")],
        [row("a", 0.005), row("b", 0.002), strayed("c"), strayed("d")],
    )
    table = tables.logs_table(comparison)
    assert table["mean rank"].tolist() == [1.5, 1.75, 3.0, 3.75]
    assert table["lost or failed"].tolist() == [0, 0, 1, 2]
    assert table["worst log"].tolist()[:3] == ["l1", "l0", "l1"]
    assert table["mean [mm]"].tolist()[:3] == [3.0, 2.0, 2.0]


def pair(a, b, p_value):
    return {"a": a, "b": b, "measure": "translation", "p_value": p_value, "next": True}


def test_the_answer_is_the_cheapest_of_those_as_accurate_within_chance():
    rows = [row("a", 0.0021, ms=3.0), row("b", 0.002, ms=4.0), row("c", 0.003, ms=1.0)]
    rows += [row("e", 0.0026, ms=0.5)]
    rows += [strayed("d", error=0.001), row("odometry", 0.0, ms=0.1)]
    found = compared(rows)
    verdicts = [pair("b", "a", 0.3), pair("c", "b", 0.001), pair("e", "b", 0.9)]
    found.logs[0].entry["verdicts"] = verdicts
    assert words.answer(found) == [
        "Take a: 2.10 mm over 1 s, 3.000 ms per scan.",
        "As accurate within chance, but slower: b.",
        "Next: e 2.60 mm, 0.500 ms per scan and c 3.00 mm, 1.000 ms per scan.",
        "Lost or failed: d after 4 s.",
    ]


def test_errors_are_compared_over_one_span_and_costs_only_if_known():
    slow = row("b", 0.005, cost=None)
    slow["errors"]["spans"] = {"10 s": slow["errors"]["spans"]["1 s"]}
    both = row("a", 0.001)
    both["errors"]["spans"]["10 s"] = row(error=0.006)["errors"]["spans"]["1 s"]
    found = compared([both, slow])
    found.logs[0].entry["verdicts"] = [pair("a", "b", 0.3)]
    assert tables.main_table({}, [both, slow])["10 s [mm]"].tolist() == [6.0, 5.0]
    assert tables.logs_table(found)["mean rank"].tolist() == [2.0, 1.0]
    assert words.answer(found)[:2] == [
        "Take a: 6.00 mm over 10 s, 1.000 ms per scan.",
        "As accurate within chance: b.",
    ]


def test_over_logs_those_lost_least_come_first_and_the_verdicts_are_those_over_all():
    logs = [
        [row("a", 0.003), row("b", 0.002), row("c", 0.001), row("odometry", 0.0)],
        [row("a", 0.003), row("b", 0.002, factor=0.5), strayed("c"), row("odometry", 0.0)],
    ]
    found = compared(*logs)._replace(over_logs=[pair("a", "b", 0.001)])
    take, following, lost, slow = words.answer(found)
    assert take == "Take b: 2.00 mm over 1 s, 1.000 ms per scan."
    assert following == "Next: a 3.00 mm, 1.000 ms per scan."
    assert (lost, slow) == ("Lost or failed: c on 1 of 2 logs.", "Slower than real time: b.")


def test_if_all_are_lost_the_answer_says_so_and_still_names_the_best():
    found = words.answer(compared([strayed("a", error=0.002), strayed("b", error=0.001)]))
    assert found[0] == "Every algorithm was lost on 1 of 1 log."
    assert found[1].startswith("The most accurate one is still b: 1.00 mm over 1 s")
    failed = {"algorithm": "a", "failed": "ValueError: no"}
    assert words.answer(compared([failed])) == [
        "Every algorithm was lost or failed: none can be recommended here."
    ]


def test_without_a_truth_the_answer_is_by_mean_ranks():
    rows = [unaided("a", 20.0, 0.02, 0.03), unaided("b", 21.0, 0.01, 0.02)]
    rows += [unaided("odometry", 19.0, 0.0, 0.01)]
    take, ranks = words.answer(compared(rows))
    assert take == "Without a truth: take a, first by wall area and error at revisits."
    assert ranks.startswith("Mean ranks: a (1.5) and b (1.5). ")
    take, ranks = words.answer(compared([*rows, unaided("c", 19.0, 0.0, 0.9)]))
    assert take == "Without a truth: take b, first by agreement with the others."
    assert ranks.startswith("Mean ranks: b (1.0), a (2.0) and c (3.0). ")


def test_nothing_and_what_is_no_number_is_a_dash():
    assert [cell("ATE [mm]", value) for value in (None, float("nan"), 1.234)] == ["-", "-", "1.23"]


def test_over_logs_without_a_truth_a_run_is_not_lost_for_that():
    loss = {"lost": False, "by": "report", "report": {"scans": 0}}
    table = tables.logs_table(compared(*[[row("a", errors=None, loss=loss)]] * 2))
    assert table.loc["a"].to_dict() == {"logs": 2, "lost or failed": 0}
