"""How much runs withstand, which are beaten, which row is taken, and what the tables say of it."""

import math

import pytest

from bench.judge import answers, survival
from bench.judge.answers import SITUATIONS, analysis, questions
from bench.judge.statistics import wilson
from bench.report import sweep_figure, sweep_tables
from bench.sim.degrade import CATALOG
from bench.sweep import DEFAULT_DEGRADATIONS
from tests.bench.test_sweep import lost, sweep_of, trial

LEVELS = (0.05, 0.1, 0.2)


def climb(held, levels=LEVELS, **more):
    """The trials of a run that holds so many of the levels."""
    trials = [trial(level=level, **more) for level in levels[:held]]
    return trials + [lost(level=level, **more) for level in levels[held : held + 1]]


def climbs(counts, **more):
    return [one for k, held in enumerate(counts) for one in climb(held, log=f"l{k}", **more)]


def cells(trials, **more):
    return analysis(sweep_of(trials, **more)).cells


def test_a_run_holds_the_levels_before_the_one_that_lost_it_and_one_that_failed_none():
    trials = [*climbs([2, 0, 3]), trial(level=0.05, log="l3") | {"failed": "no"}]
    trials += climbs([1], odometry=True) + climbs([1], algorithm="b")
    found = survival.held(trials, False, ("noise",))
    assert found["a"] == {("l0", 0): 2, ("l1", 0): 0, ("l2", 0): 3, ("l3", 0): 0}
    assert found["b"] == {("l0", 0): 1}


def test_each_drive_has_one_vote_over_all_degradations_together():
    a = {("l0", 0): 2, ("l1", 0): 1, ("l1", 1): 3, ("l9", 0): 9}
    b = {("l0", 0): 2, ("l1", 0): 0, ("l1", 1): 9}
    assert survival.votes(a, b) == (0, 1), "both seeds of l1 are one drive"
    trials = climbs([2]) + [one | {"degradation": "beams"} for one in climbs([3])]
    assert survival.held(trials, False, ("noise", "beams")) == {"a": {("l0", 0): 5}}


def test_the_curve_falls_by_the_runs_that_each_level_lost():
    shares = survival.curve({("l", k): held for k, held in enumerate((0, 1, 1, 3))}, 3)
    assert [(one.k, one.n) for one in shares] == [(3, 4), (1, 4), (1, 4)]
    assert shares[0].low == pytest.approx(0.3006, abs=1e-3)  # Wilson's, by hand
    assert shares[0].high == pytest.approx(0.9544, abs=1e-3)


def crossing(counts, n=4, levels=LEVELS):
    return survival.critical([wilson(k, n) for k in counts], levels)


def test_the_critical_level_is_where_half_are_lost_between_levels_by_their_ratio():
    assert crossing((3, 1, 0)).level == pytest.approx(0.05 * math.sqrt(2.0))
    assert crossing((4, 4, 2)).level == pytest.approx(0.2)
    assert crossing((2, 1, 0)).level == 0.05
    assert crossing((1, 1, 0)).level == -math.inf
    assert crossing((4, 4, 4)).level == math.inf
    assert crossing((3, 1, 0), levels=(180.0, 45.0, 20.0)).level == pytest.approx(90.0)
    assert crossing((3, 1, 0), levels=(0.0, 4.0, 5.0)).level == pytest.approx(2.0)


def test_its_interval_ends_at_levels_that_surely_more_or_fewer_than_half_hold():
    few, many = crossing((3, 1, 0)), crossing((300, 100, 0), n=400)
    assert few[1:] == (-math.inf, 0.2)  # Wilson's: 0.30 to 0.95, 0.05 to 0.70, 0 to 0.49
    assert many[1:] == (0.05, 0.1)
    assert crossing((400, 210, 190), n=400)[1:] == (0.05, math.inf)


def test_figures_of_a_row_count_levels_clean_logs_and_what_was_reported():
    trials = [
        trial(ate_m=0.02, second_m=0.002, odometry=True, wheels_ate_m=0.01, false_alarms=5),
        trial(level=0.05, ate_m=0.04, second_m=0.004, odometry=True, wheels_ate_m=0.05),
        lost(level=0.1, odometry=True, wheels_ate_m=0.05),
        lost(log="l1", level=0.05, odometry=True) | {"right_again": True, "said_in_time": 1},
        trial(log="l2", level=0.05, odometry=True) | {"failed": "it fell over"},
        trial(second_m=0.9),
    ]
    found = survival.figures(sweep_of(trials), "a", True)
    assert found.levels == (1, 9)
    assert str(found.clean) == "1 of 1"
    assert (found.second_m, found.clean_m) == pytest.approx((0.003, 0.002))
    assert str(found.worse_than_wheels) == "2 of 3"
    assert str(found.right_again) == "1 of 2"
    assert str(found.reported_in_time) == "1 of 2"
    assert found.false_share == pytest.approx(5 / 400)
    assert found.used == ["laser"]
    assert found.cpu_scan == pytest.approx(0.003)  # 0.1 to 0.5 s of 100 scans
    assert found.dearest == pytest.approx(3.0)


TESTS = 2  # of each pair: survival and accuracy


def test_every_degradation_tells_of_one_situation():
    named = [name for names in SITUATIONS.values() for name in names]
    assert sorted(named) == sorted(CATALOG)
    assert set(DEFAULT_DEGRADATIONS) <= set(CATALOG)


def test_rows_compete_within_their_preset_unless_one_would_be_alone():
    rows = ["a", "b", "a@paper", "b@paper:x=1", "m:C"]
    assert list(questions(rows).values()) == [["a", "b", "m:C"], ["a@paper", "b@paper:x=1"]]
    assert questions(["a", "b", "a@paper"]) == {answers.SINGLE_QUESTION: ["a", "b", "a@paper"]}


def test_p_values_of_a_question_are_corrected_together():
    trials = climbs([3] * 9) + climbs([1] * 9, algorithm="b")
    (alone,) = cells(trials)
    assert alone.beaten["b"][1] == pytest.approx(TESTS * 2.0 / 2**9)
    both = trials + [one | {"odometry": True} for one in trials]
    assert [cell.beaten["b"][1] for cell in cells(both)] == pytest.approx([TESTS * 4.0 / 2**9] * 2)
    presets = [one | {"algorithm": f"{one['algorithm']}@paper"} for one in trials]
    assert cells(trials + presets)[0].beaten["b"][1] == pytest.approx(TESTS * 2.0 / 2**9)
    names = {label: climbs([3] * 9, algorithm=label) for label in "ac"}
    three = cells([*names["a"], *names["c"], *climbs([1] * 9, algorithm="b")])
    assert three[0].unbeaten == ["a", "c"]
    assert three[0].beaten["b"][1] == pytest.approx(3 * TESTS * 2.0 / 2**9)


def test_of_rows_that_survive_alike_the_more_accurate_wins_by_name():
    rough = [0.002 + 1e-5 * k for k in range(9)]
    trials = climbs([2] * 9, second_m=0.001)
    for k, error in enumerate(rough):
        trials += climb(2, algorithm="b", log=f"l{k}", second_m=error)
    (cell,) = cells(trials)
    assert cell.beaten == {"b": ("a", pytest.approx(TESTS * 2.0 / 2**9), "more accurate")}
    assert sweep_tables.answer(cell) == "**a** (more accurate, p = 0.0078)"


def test_a_row_in_bold_won_against_each_other_row():
    wins = [("b", "c", 1e-5), ("a", "b", 1e-4), ("a", "c", 1e-3)]
    tests = [answers.Test(0, winner, loser, "lost less", p) for winner, loser, p in wins]
    (cell,) = cells(climbs([3] * 9) + climbs([1] * 9, algorithm="b"))
    for some, said in ((tests, "**a** (lost less, p = 0.001)"), (tests[:2], "a or c within")):
        (beaten,) = answers._beaten(1, some)
        assert sweep_tables.answer(cell._replace(beaten=beaten)).startswith(said)


def test_seeds_of_one_log_are_one_drive():
    pairs = [
        climb(held, algorithm=row, seed=k) for k in range(9) for row, held in (("a", 3), ("b", 1))
    ]
    found = sweep_of([one for of in pairs for one in of])
    (cell,) = analysis(found).cells
    assert sweep_tables.answer(cell) == "one drive cannot decide: take a"
    assert sweep_tables.head(analysis(found), found.facts).startswith("18 climbs over one drive")


def test_a_difference_within_the_same_accuracy_is_none():
    logs = {(f"l{k}", 0, "noise", 0.1): 0.001 + 1e-5 * k for k in range(20)}
    assert answers.error_ratio(logs, {key: 1.2 * of for key, of in logs.items()})[1] == 1.0
    ratio, p = answers.error_ratio(logs, {key: 1.3 * of for key, of in logs.items()})
    assert ratio == pytest.approx(1.0 / 1.3)
    assert p < 0.001
    assert answers.error_ratio(logs, {}) == (1.0, 1.0)


def test_a_tie_is_called_one_and_the_cheapest_as_accurate_is_taken():
    held = [3] * 6 + [2, 1, 2, 1, 2, 2]
    trials = climbs(held, algorithm="exact", second_m=0.001)
    trials += climbs(held[::-1], algorithm="cheap", second_m=0.0012)
    trials += climbs(held, algorithm="rough", second_m=0.01)
    found = sweep_of(trials)
    cost = {"exact": 3.0, "cheap": 2.0, "rough": 1.0}
    costs = [{"cpu_s": cost[one["algorithm"]]} for one in trials]
    (cell,) = analysis(found._replace(costs=costs)).cells
    assert list(cell.beaten) == ["rough"] and not cell.equal
    assert sweep_tables.answer(cell) == "exact or cheap within chance: take cheap"
    (cell,) = cells([one for one in trials if one["algorithm"] != "rough"])
    assert sweep_tables.answer(cell) == "equal within chance: take exact"


def test_accuracy_and_cost_are_those_of_levels_that_all_rows_held():
    trials = climb(1, second_m=0.002) + climb(1, algorithm="b", second_m=0.001)
    trials[1:1] = [trial(level=0.1, second_m=0.5)]
    (cell,) = cells(trials)
    assert cell.error_m == {"a": 0.002, "b": 0.001}
    assert cell.take == "b"
    (cell,) = cells(trials + climb(0, algorithm="c"))
    assert cell.error_m == {"a": 0.002, "b": 0.001}, "a row that holds nothing hides nothing"


def test_situations_are_answered_together_and_apart():
    trials = climbs([3] * 9) + climbs([1] * 9, algorithm="b")
    trials += [one | {"degradation": "people"} for one in trials]
    levels = {"noise": list(LEVELS), "people": list(LEVELS)}
    found = analysis(sweep_of(trials, levels=levels))
    titles = [cell.title for cell in found.situations]
    assert titles[0] == "A laser that measures little (noise)"
    assert titles[1:] == ["People, glass, dust (people)", answers.ALL_DEGRADATIONS]
    (table,) = sweep_tables.choices(found)
    assert table.title.startswith("The programs to use")
    answer = table.frame.loc[answers.ALL_DEGRADATIONS, "laser alone"]
    assert answer == "**a** (lost less, p = 0.023)"


def shown(counts, levels=LEVELS, n=4):
    shares = [wilson(k, n) for k in counts]
    return sweep_tables.shown_level(survival.critical(shares, levels), shares, levels)


def test_a_cell_shows_level_and_interval_and_what_lies_beyond_the_levels():
    assert shown((3, 1, 0)) == "0.0707 (<0.05 to 0.2)"
    assert shown((20, 20, 20), n=20) == ">0.2"
    assert shown((0, 0, 0), n=20) == "<0.05"
    assert shown((0, 0, 0), (180.0, 45.0, 20.0), 20) == ">180"
    assert shown((20, 20, 20), (180.0, 45.0, 20.0), 20) == "<20"
    assert shown((3,), (1.0,)) == "3 of 4"


def test_conditions_in_which_all_are_equal_are_named_and_not_shown():
    trials = climbs([2, 1]) + climbs([2, 1], algorithm="b")
    trials += climbs([2, 1], degradation="beams")
    trials += climbs([1, 1], algorithm="b", degradation="beams")
    levels = {"noise": list(LEVELS), "beams": list(LEVELS)}
    found = sweep_of(trials, levels=levels)
    made = sweep_tables.tables(analysis(found), found.facts)["critical-1"]
    assert list(made.frame.index) == ["beams [1]"]
    assert made.title.endswith("not shown, as all rows are equal in every run: noise")


def test_the_terminal_answers_before_it_shows_tables():
    trials = climbs([3] * 8) + climbs([1] * 8, algorithm="b")
    found = sweep_of(trials)
    text = sweep_tables.terminal(analysis(found), found.facts)
    assert text.index("a (lost less, p = 0.016)") < text.index("levels held [%]")
    assert "lost = too far off" in text and "**" not in text


def test_the_curves_are_written_with_their_bands():
    trials = climbs([2, 0]) + climbs([1, 1], algorithm="b")
    frame = sweep_tables.curve_table(analysis(sweep_of(trials)))
    own = frame[frame["algorithm"] == "a"]
    assert own["level"].tolist() == list(LEVELS)
    assert own["share"].tolist() == [0.5, 0.5, 0.0]
    assert (own["low"] < own["share"]).tolist() == [True, True, False]


def test_a_curve_of_errors_counts_lost_runs_and_levels_behind_them_among_all():
    found = sweep_of(climb(2, second_m=0.002) + climb(0, log="l1"))
    errors = sweep_figure.errors_of(found, "a", False)
    assert errors.tolist() == [0.002, 0.002, *4 * [math.inf]], "two climbs of three levels"


def test_accuracy_does_not_make_up_for_lost_runs():
    trials = climbs([3] * 6, second_m=0.004) + climbs([1] * 6, algorithm="b", second_m=0.001)
    held = survival.held(trials, False, ("noise",))
    tests = answers._tests(0, held, survival.errors(trials, False, ("noise",)))
    assert [(test.winner, test.reason, test.p) for test in tests] == [
        ("a", "lost less", pytest.approx(2.0 / 2**6)),
        ("b", "more accurate", 1.0),
    ]


@pytest.mark.parametrize("clean", [False, True])
def test_the_picture_has_panels_of_errors_by_question_and_of_costs(clean, tmp_path, monkeypatch):
    drawn = []
    canvas = sweep_figure.FigureCanvasAgg
    monkeypatch.setattr(canvas, "print_figure", lambda self, path, **_: drawn.append(self.figure))
    names = ("a", "b", "a@paper", "b@paper")
    trials = [one for name in names for one in climbs([2, 1], algorithm=name, second_m=0.004)]
    levels = {"noise": list(LEVELS), "beams": list(LEVELS)}
    for name in names if clean else ():
        trials += climbs([1], levels=(0.0,), algorithm=name, second_m=0.001)
        trials += [one | {"degradation": "beams"} for one in climbs([2], algorithm=name)]
        levels["clean"] = [0.0]
    trials += climbs([1], odometry=True)
    found = sweep_of(trials, levels=levels)
    sweep_figure.draw(found, analysis(found), tmp_path / "it.png")
    panels = [axes for axes in drawn[0].axes if axes.get_visible()]
    titles = [axes.get_title() for axes in panels]
    assert titles[:2] == [answers.QUESTIONS[""], answers.QUESTIONS["paper"]]
    assert len(titles) == 4 and len(panels[3].get_lines()) == 3
    *rows, front = panels[2].get_lines()
    ways, places = rows[::2], rows[1::2]
    assert [len(line.get_xdata()) for line in ways] == [3 if clean else 1] * len(names)
    assert [line.get_ydata().tolist() for line in places] == [[1.0 if clean else 4.0]] * len(names)
    assert front.get_xdata()[0] == min(line.get_xdata()[0] for line in places)


def test_the_costs_of_a_level_are_of_runs_that_held_it_where_half_of_the_drives_did():
    trials = climbs([3, 2, 1], second_m=0.002) + climbs([3], algorithm="b")
    points = sweep_figure.costs(sweep_of(trials), "a", False, "noise")
    assert [point.name for point in points] == [f"{level:g}" for level in LEVELS[:2]]
    assert {point.error_mm for point in points} == {2.0}
