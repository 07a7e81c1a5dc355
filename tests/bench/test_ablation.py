"""Settings of single rows of a sweep, and the table of what each mechanism is worth."""

import csv
from dataclasses import dataclass
from math import comb

import pytest

from bench import ablation, sweep
from bench.judge.answers import analysis
from bench.judge.statistics import mcnemar
from bench.report import sweep_tables
from bench.results import sweep as results
from bench.run import single
from slams import Pose2
from slams.baselines import BaselineParams, Odometry
from slams.params import param
from slams.registry import find

TOY = "tests.bench.test_ablation:Toy"


@dataclass(frozen=True)
class ToyParams(BaselineParams):
    steady: bool = param(True, "1", "stay where one is", source="ours: toy", switch=True)
    loud: bool = param(False, "1", "no mechanism", source="ours: toy")
    odd: bool = param(False, "1", "changes nothing", source="ours: toy", switch=True)


class Toy(Odometry):
    """Follows the wheels, lost without; unsteady, it jumps by kilometers."""

    Params = ToyParams

    def __init__(self, params):
        super().__init__(params)
        self.params, self.scans = params, 0

    def update(self, scan):
        self.scans += 1
        pose = super().update(scan)
        return pose if self.params.steady else Pose2(pose.x + 1e3 * self.scans, pose.y, pose.theta)


def planned(*words):
    usual = ["--seeds", "2", "--degradations", "noise=0.05"]
    usual += [] if words[0].endswith(".npz") else ["--arenas", "ring"]
    return sweep._plan(sweep.parser().parse_args([*words, *usual]))


def test_a_variant_of_a_variant_has_both_settings_and_the_later_value():
    assert single.variant("a:b", c="1") == "a:b:c=1"
    assert single.variant("a:b:c=1,d=2", e="3", c="4") == "a:b:c=4,d=2,e=3"


def test_a_variant_is_the_run_that_set_makes_under_its_own_name(tmp_path):
    asked = planned("--algorithms", TOY, f"{TOY}:steady=false").cases(tmp_path)
    given = planned("--algorithms", TOY, "--set", f"{TOY}:steady=false").cases(tmp_path)
    keys = {}
    for name, cases in (("asked", asked), ("given", given)):
        for case in cases:
            keys.setdefault((name, case.known["algorithm"]), []).append(case.task.key)
    assert list(keys) == [("asked", TOY), ("asked", f"{TOY}:steady=false"), ("given", TOY)]
    assert keys["asked", f"{TOY}:steady=false"] == keys["given", TOY]
    assert not set(keys["asked", TOY]) & set(keys["given", TOY])


def test_the_nearer_setting_wins(tmp_path):
    (tmp_path / "p.yaml").write_text("seed: 1\nloud: true\nodd: true\n")
    rows = [TOY, f"{TOY}:seed=4", "odometry"]
    made = planned("--algorithms", *rows, "--params", f"{TOY}:{tmp_path / 'p.yaml'}", "--set",
                   f"{TOY}:seed=3", "--set", "seed=2", "--set", "loud=false", "--set",
                   "steady=false")  # fmt: skip
    toy = ToyParams(steady=False, loud=False, odd=True)
    assert made.parameters(TOY) == toy.replace(seed=3).as_dict()
    assert made.parameters(rows[1]) == toy.replace(seed=4).as_dict()
    assert made.parameters("odometry")["seed"] == 2
    said = {"steady": False, "odd": True}
    assert made.settings() == {TOY: said | {"seed": 3}, rows[1]: said, "odometry": {"seed": 2}}


def test_the_drives_count_from_the_first_seed(room_file):
    for words, seeds in (([], [0, 1]), (["--seed", "7"], [7, 8])):
        made = planned("--algorithms", "odometry", *words)
        assert [given.seed for given in made.logs] == seeds
        assert [given.name for given in made.logs] == [f"ring-utm30lx-{k}" for k in seeds]
        assert [given.identity["setting"]["seed"] for given in made.logs] == seeds
        assert "settings" not in made.gathered([], {}, None, {}).facts
    given = planned(room_file, "--algorithms", "odometry", "--seed", "7").logs
    assert [one.seed for one in given] == [7, 8]


def test_the_file_and_the_heading_say_what_was_set(room_file, tmp_path, here):
    out = tmp_path / "out"
    words = [room_file, "--degradations", "clean", "--seeds", "1", "-q"]
    words += ["--out", str(out), "--algorithms", TOY, f"{TOY}:odd=true", "--jobs", "1"]
    assert sweep.main([*words, "--set", f"{TOY}:loud=true"]) == 0
    found = results.read(out)
    rows = [TOY, f"{TOY}:odd=true"]
    assert found.facts["settings"] == {row: {"loud": True} for row in rows}
    assert list(dict.fromkeys(t["algorithm"] for t in found.trials)) == rows
    assert not any(t["failed"] for t in found.trials)
    head = sweep_tables.head(analysis(found), found.facts)
    assert " climbs over one drive (room at 10 Hz); lost" in head, "of no simulated laser"
    assert head.endswith(f"; {TOY} with loud=true; {rows[1]} with loud=true")


def test_the_switches_of_the_house_are_mechanisms_that_are_on():
    for name in ("hector", "tsd", "crsm", "gmapping"):
        params = find(name).params()
        switches = {key for key, spec in params.specs().items() if spec.switch}
        assert {"refine", "relocate"} <= switches
        assert not {"wheels", "gyro"} & switches
        assert all(getattr(params, switch) is True for switch in switches)
    assert ablation.rows_of("hector@paper")["refine=true"] == "hector@paper:refine=true"
    assert ablation.rows_of("hector:refine=false")["refine=true"] == "hector:refine=true"


def test_mcnemar_counts_the_coins_that_fall_as_far_from_even():
    for a, b in ((0, 0), (5, 0), (1, 7), (6, 4), (3, 3)):
        n = a + b
        ways = sum(comb(n, k) for k in range(n + 1) if abs(2 * k - n) >= abs(a - b))
        assert mcnemar(a, b) == pytest.approx(ways / 2**n)


def test_every_switch_gets_a_row_beside_the_whole(tmp_path, capsys, here, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "results" / "ablation-tests-bench-test_ablation-Toy"
    words = [TOY, "--arenas", "ring", "--seeds", "2", "--seed", "3", "--duration", "2"]
    words += ["--degradations", "noise=0.05", "noise=0.1", "--jobs", "1"]
    assert ablation.main(words) == 0
    assert ablation.main([*words, "--rate", "5"]) == 2
    with (out / "ablation.csv").open() as file:
        lines = {line[TOY]: line for line in csv.DictReader(file)}
    assert list(lines) == ["all", "steady=false", "odd=true"]
    for mode, kept in (("laser alone", "0 of 4"), ("with odometry", "4 of 4")):
        survived = [line[f"levels held, {mode}"] for line in lines.values()]
        assert survived == [kept, "0 of 4", kept]
    errors = [line["1 s, with odometry [mm]"] for line in lines.values()]
    assert errors[0] == errors[2] != errors[1] == ""
    assert [line["p"] for line in lines.values()] == ["", "0.5", "1"]  # two drives: 2 / 2^2
    assert all(float(line["CPU a scan [ms]"]) > 0.0 for line in lines.values())
    page = (out / "ablation.md").read_text()
    assert f"slams ablation {TOY}" in page and "| steady=false | 0 of 4 |" in page
    assert "steady=false" in capsys.readouterr().out
