"""The front page's table and its answer follow the committed results, whatever they come to be."""

import pytest

from bench import readme
from bench.report import pages
from bench.run import compare_options
from hector.params import HectorParams
from slams.registry import names
from tests.bench.test_answers import climb
from tests.bench.test_sweep import sweep_of


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


def test_the_table_joins_both_by_the_name(tmp_path):
    log = {"name": "n", "scans": 5, "beams": 3, "duration_s": 9.0}
    found = {
        "logs": [log],
        "rows": [row("hector", 0.003), row("tsd", 0.9, lost=True)],
        "command": "the command",
        "machine": {"cpu": "a core"},
    }
    trials = [*climb(2, algorithm="hector"), *climb(3, algorithm="hector", odometry=True)]
    trials += [*climb(1, algorithm="mine:Slam"), *climb(0, algorithm="tsd")]
    trials += climb(0, algorithm="tsd@paper")
    swept = sweep_of(trials)
    pages.adopt(tmp_path / "swept.json", swept)
    kept = readme.read_figures(tmp_path / "swept.json")
    lines = pages.front_table(found, kept).splitlines()
    idea = "gradient matching on grid pyramids"
    assert lines[0].count("|") == 7, "at most six columns"
    assert lines[2] == f"| [hector](hector/README.md) | {idea} | 3.00 | 66.7 | 100.0 | 0.250 |"
    assert lines[3] == "| mine:Slam | - | - | 33.3 | - | - |"
    assert lines[4].endswith(" | - | 0.0 | - | - |"), "a lost run has no error to show"
    assert "`the command`, n: 5 scans of 3 beams, 9 s, on a core. Levels held: `c`" in lines[6]


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
