"""Runs of a comparison as tasks: what they are named by, how they travel, options of one alone."""

import math

import numpy as np
import pytest

from bench.judge.metrics import Common
from bench.results import Outcome, Reference
from bench.results.arrays import pack_outcome, pack_reference, unpack_outcome, unpack_reference
from bench.run import compare_options
from bench.run.cases import Choice
from bench.run.comparing import Job, Wanted, plan
from bench.run.single import common_seed, singles
from slams.registry import find
from slams.types import OccupancyGrid, Pose2
from tests.rooms import drive

HERE = {"cpu": "a", "processes": 2}
GRID = OccupancyGrid(np.array([[0.1, np.nan]], np.float32), 0.05, (-1.0, 2.5))


def same(a, b):
    assert type(a) is type(b)
    if isinstance(a, np.ndarray):
        np.testing.assert_array_equal(a, b)
        assert a.dtype == b.dtype
    elif isinstance(a, (OccupancyGrid, Common)):
        values = [vars(x) if hasattr(x, "__dict__") else x._asdict() for x in (a, b)]
        for key in values[0]:
            same(values[0][key], values[1][key])
    else:
        assert a == b


def test_a_run_and_a_log_come_back_from_their_text():
    rng = np.random.default_rng(0)
    poses = rng.random((5, 3))
    common = Common(rng.random(4), poses[:4], poses[:4] + 0.1, 1)
    row = {"z": 0.1 + 0.2, "algorithm": "tsd", "spans": {"update": 1, "1 s": None}}
    made = Outcome(row, rng.random(5), poses, rng.random(5), GRID, common, Pose2(1.0, 2.0, 3.0))
    found = unpack_outcome(pack_outcome(made))
    assert list(found.row["spans"]) == ["update", "1 s"], "tables have this order"
    for name in ("row", "t", "poses", "seconds", "grid", "common", "frame"):
        same(getattr(made, name), getattr(found, name))
    bare = unpack_outcome(pack_outcome(Outcome({"odd": math.inf})))
    assert (bare.row, bare.grid, bare.common) == ({"odd": None}, None, None)
    known = Reference({"name": "a"}, poses, GRID, Pose2(1.0, 0.0, 0.0))
    for a, b in zip(known, unpack_reference(pack_reference(known)), strict=True):
        same(a, b)


def names(log, choice=None, relations=None, machine=HERE):
    found = plan(["hector", "odometry"], [log], choice or Choice(), Wanted(relations, 2), machine)
    return {job: task.key for job, task in found.tasks.items()}


@pytest.mark.parametrize(
    ("changed", "hector_alone"),
    [
        ({"choice": Choice(single=singles(["hector"], [], ["hector:resolution=0.1"], []))}, True),
        ({"choice": Choice(seed=3)}, False),
        ({"choice": Choice(realtime=True)}, False),
        ({"machine": {"cpu": "b", "processes": 2}}, False),
        ({"relations": np.ones((1, 5))}, False),
    ],
)
def test_all_that_a_run_follows_from_is_in_its_name(changed, hector_alone):
    log = drive(n=60)
    relations = np.zeros((1, 5))
    before, after = (
        names(log, relations=relations),
        names(log, **{"relations": relations} | changed),
    )
    differ = {job for job in before if before[job] != after[job]}
    runs = {job for job in before if job.label is not None}
    hectors = {job for job in runs if job.label == "hector"}
    assert {job for job in differ if job.label} == (hectors if hector_alone else runs)
    assert len(set(before.values())) == len(before) == 5
    assert names(log, relations=relations) == before


def test_another_log_another_name_and_only_its_truth_matters_to_the_reference():
    log = drive(n=8)
    before, after = names(log), names(log.select(odometry=False))
    assert not set(before.values()) & set(after.values())
    assert names(log, Choice(seed=3))[Job(None, 0)] == before[Job(None, 0)]


# options of single algorithms


def choice_of(*words):
    arguments = compare_options.parser().parse_args(words)
    labels = compare_options.labels_of(arguments)
    choice, _, _ = compare_options.checked(arguments, labels)
    return {label: choice.params(find(label)) for label in labels}


def test_parameters_of_one_algorithm_leave_the_others_alone(tmp_path):
    (tmp_path / "a.yaml").write_text("cell: 0.1\nseed: 4\n")
    plain = choice_of("--algorithms", "tsd", "tsd@original", "crsm")
    given = ["--params", f"tsd:{tmp_path / 'a.yaml'}", "--set", "tsd:cell=0.05"]
    given += ["--seed", "3", "--seed", "crsm:5", "--set", "slams.baselines:Odometry:seed=9"]
    found = choice_of(
        "--algorithms", "tsd", "tsd@original", "crsm", "slams.baselines:Odometry", *given
    )
    assert found["tsd"] == plain["tsd"].replace(cell=0.05, seed=4)
    assert found["tsd@original"] == plain["tsd@original"].replace(seed=3)
    assert found["crsm"] == plain["crsm"].replace(seed=5)
    assert found["slams.baselines:Odometry"].seed == 9


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--set", "cel=1"], "got 'cel=1', expected a parameter of tsd; did you mean 'cell'"),
        (["--set", "cell"], "got 'cell', expected ALGORITHM:KEY=VALUE"),
        (["--set", "nobody:cell=0.05"], "expected ALGORITHM:KEY=VALUE of one that is compared"),
        (["--set", "tsd:cell"], "--set: got 'cell', expected KEY=VALUE"),
        (["--set", "tsd:cel=1"], "did you mean 'cell'"),
        (["--set", "tsd:cell=-1"], "parameter 'cell': got '-1'|parameter 'cell': got -1"),
        (["--params", "tsd:"], "got 'tsd:', expected ALGORITHM:FILE"),
        (["--params", "tsd:none.yaml"], "none.yaml"),
        (["--seed", "tsd:x"], "parameter 'seed'"),
        (["--seed", "x"], "--seed: got 'x', expected a number, or ALGORITHM:N"),
        (["--seed", "hector:1"], "expected ALGORITHM:N of one that is compared: tsd"),
    ],
)
def test_what_is_of_no_algorithm_is_refused_in_one_sentence(words, sentence):
    with pytest.raises((ValueError, LookupError, OSError), match=sentence):
        choice_of("--algorithms", "tsd", *words)


def test_the_last_seed_for_all_counts():
    assert common_seed(["1", "tsd:2", "3"]) == (3, ["tsd:2"])
    assert common_seed([]) == (None, [])
