"""The plan of a sweep: what is tried by chance, how long it is, what became of it."""

import pytest

from bench import sweep
from bench.run import plan
from bench.sim.degrade import CATALOG
from slams import cli
from slams.formats.options import SourceOptions


def planned(chosen, rate=None):
    drives = plan.Drives(["rescue"], 2, 10.0, "utm30lx")
    logs = plan.logs_of([], drives, SourceOptions())
    return plan.Plan(["hector"], plan.conditions_of(chosen), logs, (False,), rate, None)


def test_each_drive_has_its_own_mishap_and_a_clean_one_none(tmp_path):
    for chosen, seeds in (("clean", [0, 0]), ("noise=0.05", [0, 1])):
        cases = planned([chosen]).cases(tmp_path)
        assert [case.known["seed"] for case in cases] == [0, 1]
        assert [case.task.what["condition"]["seed"] for case in cases] == seeds


def test_scans_are_as_many_as_the_rate_leaves(tmp_path):
    whole = [case.scans for case in planned(["clean"]).cases(tmp_path)]
    thin = [case.scans for case in planned(["clean"], rate=10.0).cases(tmp_path)]
    assert whole == [400, 400] and thin == pytest.approx([100, 100])
    fast = [case.scans for case in planned(["clean"], rate=1000.0).cases(tmp_path)]
    assert fast == whole


def test_a_name_alone_is_all_its_levels_and_levels_by_hand_are_one_climb():
    assert plan.conditions_of(["noise"]) == {"noise": CATALOG["noise"].levels}
    found = plan.conditions_of(["noise=0.3", "beams", "noise=0.01", "clean"])
    assert [(name, len(levels)) for name, levels in found.items()] == [
        *(("clean", 1), ("beams", 8), ("noise", 2)),
    ]
    assert found["noise"] == (0.3, 0.01)
    assert len(plan.conditions_of(["all"])) == len(CATALOG)


@pytest.mark.parametrize(
    ("words", "rate", "drives"),
    [
        ([], 10.0, 10),
        (["--quick"], 10.0, 5),
        (["--rate", "0"], None, 10),
        (["--rate", "5"], 5.0, 10),
    ],
)
def test_rate_and_drives_are_those_that_were_asked_for(words, rate, drives):
    arguments = sweep.parser().parse_args(["--arenas", "rescue", "--algorithms", "hector", *words])
    made = sweep._plan(arguments)
    assert (made.rate, len(made.logs)) == (rate, drives)
    assert made.sensor is None and made.odometry == (False, True)


def test_parameters_are_those_for_the_sensor_unless_it_is_the_usual_one():
    words = ["--arenas", "rescue", "--algorithms", "hector", "--sensor"]
    for name, sensor in (("utm30lx", None), ("rplidar-a1", "rplidar-a1")):
        assert sweep._plan(sweep.parser().parse_args([*words, name])).sensor == sensor


def test_a_sweep_of_which_nothing_came_fails(tmp_path, monkeypatch):
    failed = {"failed": "MemoryError"}
    monkeypatch.setattr(sweep, "_do", lambda cases, *_: {c.task.key: failed for c in cases})
    words = ["--arenas", "rescue", "--algorithms", "hector", "--degradations", "clean"]
    words += ["--seeds", "1", "-q", "--out", str(tmp_path / "out")]
    assert sweep.main(words) == cli.FAILED
    assert "MemoryError" in (tmp_path / "out" / "sweep.json").read_text()
