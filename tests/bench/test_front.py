"""The front page's table and its answer follow the committed results, whatever they come to be."""

import pytest

from bench.report import front
from bench.run import compare_options
from bench.sim.degrade import CATALOG
from bench.sweep import QUICK
from hector.params import HectorParams
from slams.registry import names
from tests.bench.test_sweep import lost, sweep_of, trial


def runs(kept, of, **more):
    """`of` runs of one kind, `kept` of which kept their way."""
    return [trial(log=f"l{k}", **more) for k in range(kept)] + [
        lost(log=f"l{k}", **more) for k in range(kept, of)
    ]


def beams(kept, of, **more):
    return [one | {"degradation": "beams"} for one in runs(kept, of, level=45.0, **more)]


def test_every_degradation_tells_of_one_situation():
    listed = [name for names in front.SITUATIONS.values() for name in names]
    assert sorted(listed) == sorted(CATALOG)
    assert {one.partition("=")[0] for one in QUICK} <= set(listed)


def test_who_kept_most_runs_is_named_first_and_of_equals_the_cheapest():
    trials = runs(8, 8, algorithm="dear") + runs(8, 8, algorithm="cheap")
    found = sweep_of(trials)
    costs = [{"cpu_s": 9.0 - k, "longest_ms": 1.0} for k in range(len(trials) // 2)] * 2
    costs = [cost | {"cpu_s": cost["cpu_s"] / 4} if k > 7 else cost for k, cost in enumerate(costs)]
    (line, *_) = front.choice(found._replace(costs=costs)).splitlines()
    assert line == (
        "- **A good laser, nothing in the way** (clean): laser alone **cheap** or dear 8 of 8."
    )


def test_far_behind_is_only_who_is_so_by_more_than_chance():
    trials = beams(20, 20, algorithm="best") + beams(17, 20, algorithm="near")
    trials += beams(8, 20, algorithm="far") + beams(20, 20, algorithm="other", odometry=True)
    (line, *answer) = front.choice(sweep_of(trials)).splitlines()
    assert "(beams=45): laser alone **best** 20 of 20, then near 17, far behind far 8; " in line
    assert line.endswith("with odometry **other** 20 of 20.")
    assert [one.partition(":")[0] for one in answer] == ["- Laser alone", "- With odometry"]


def test_a_run_that_failed_has_no_cost_and_counts_as_lost():
    trials = [one | {"failed": "ValueError: no"} for one in runs(2, 2, algorithm="a")]
    found = sweep_of(trials)._replace(costs=[None, None])
    assert "laser alone **a** 0 of 2." in front.choice(found)


def row(name, error, **loss):
    moments = {"mean": error}
    return {
        "algorithm": name,
        "failed": None,
        "posed": None,
        "used": ["laser"],
        "relations": None,
        "errors": {
            "ate_m": 0.001,
            "spans": {"1 s": {"se2_translation_m": moments, "orientation_rad": moments}},
        },
        "loss": {"lost": False, "by": "truth"} | loss,
        "cost": {"mean_ms": 0.25},
    }


def test_the_table_joins_both_by_the_name():
    bound = {"spans": {"1 s": {"translation_m": 0.002}}}
    log = {"name": "n", "scans": 5, "beams": 3, "duration_s": 9.0, "bound": bound}
    found = {
        "logs": [log],
        "rows": [row("hector", 0.003), row("tsd", 0.9, lost=True)],
        "command": "the command",
        "machine": {"cpu": "a core"},
    }
    trials = runs(3, 4, algorithm="hector") + runs(1, 2, algorithm="hector", odometry=True)
    trials += runs(2, 2, algorithm="mine:Slam") + runs(2, 2, algorithm="tsd")
    lines = front.table(found, sweep_of(trials)).splitlines()
    idea = "gradient matching on grid pyramids"
    assert lines[0].count("|") == 7, "at most six columns"
    assert lines[2] == f"| [hector](hector/README.md) | {idea} | 3.00 | 3 of 4 | 1 of 2 | 0.250 |"
    assert lines[3] == "| mine:Slam | - | - | 2 of 2 | - | - |"
    assert lines[4].endswith(" | - | 2 of 2 | - | - |"), "a lost run has no error to show"
    assert "`the command`, n: 5 scans of 3 beams, 9 s, on a core. Survived: `c`" in lines[6]


@pytest.fixture
def paper(monkeypatch):
    presets = dict(HectorParams.PRESETS) | {"paper": {"levels": 2}}
    monkeypatch.setattr(HectorParams, "PRESETS", presets)


def asked(*words):
    return compare_options.labels_of(compare_options.parser().parse_args(words))


def test_the_ideas_are_compared_where_there_are_any(paper, monkeypatch):
    known = asked()
    assert known[-len(names()) :] == names()
    assert "hector@paper" in known
    full = asked("--full")
    assert full[0] == "hector@original"
    assert full[4:] == known
    assert asked("--full", "--algorithms", "kiss") == asked("--algorithms", "kiss") == ["kiss"]
    monkeypatch.setattr(HectorParams, "PRESETS", {})
    assert "hector@paper" not in asked()
