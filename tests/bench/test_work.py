"""Where runs are done: the same bytes from everywhere, whatever dies on the way."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from bench.run import pool
from bench.run.store import Store
from bench.run.work import Task, perform, run_all
from tests.bench import toy_runs
from tests.bench.test_store import files
from tests.places import ROOT
from tests.processes import ends, in_session, processes_of, signal_group, signal_one
from tests.rooms import drive
from tests.slams.live.commands import PATIENCE, started

TOY = ("tests.bench.toy_runs",)


def toy(function, where=None, **what):
    return Task(f"tests.bench.toy_runs:{function}", what, TOY, where or {})


def toys(count, seconds=0.0, **where):
    return [toy("run", where | {"seconds": seconds}, n=n) for n in range(count)]


def results(folder):
    """Bytes of every result, what they cost left out."""
    return {name: of for name, of in files(folder).items() if not name.endswith(".cost.json")}


def do(tasks, store, jobs=1):
    """Do what the store has not; the values by the tasks' names."""
    todo = {task.key: task for task in tasks if store.read(task.key) is None}
    return dict(run_all(todo, store, jobs))


@pytest.fixture
def here(monkeypatch):
    monkeypatch.setattr(pool, "finished", toy_runs.here)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """What the toys come to in one process."""

    def of(count):
        store = Store(tmp_path_factory.mktemp("undisturbed"))
        for task in toys(count):
            result = perform(task, task.key)
            store.write(task.key, result.value, result.measured)
        return results(store.folder)

    return of


def test_a_value_is_the_same_fresh_and_stored_to_the_order_of_its_keys(tmp_path, here):
    store, (task,) = Store(tmp_path), toys(1)
    values = [*do([task], store).values(), store.read(task.key)]
    expected = [("n", 0), ("square", 0), ("third", 0.0)]
    assert [list(value.items()) for value in values] == [expected] * 2
    assert do([task], store) == {}


def test_what_is_raised_is_a_result_without_addresses_kept_if_it_is_the_algorithms(tmp_path, here):
    store = Store(tmp_path)
    for task, sentence, is_kept in (
        (toy("raises", n=1), "ZeroDivisionError: at 1, by <object object at 0x..>", True),
        (toy("leaves", n=1), "SystemExit: enough of 1", True),
        (toy("lacks_memory", n=1), "MemoryError: for 1", False),  # tells of the machine
    ):
        assert do([task], store) == {task.key: {"failed": sentence}}
        assert store.read(task.key) == ({"failed": sentence} if is_kept else None)


def test_other_code_than_the_sweep_was_started_with_is_no_result():
    task = toy("run", n=1)
    sentence = r"does not have the code .*tests\.bench\.toy_runs.* start again"
    with pytest.raises(RuntimeError, match=sentence):
        perform(task, task.key_for("older code"))
    absent = Task("absent:run", {}, ("absent_package",))
    with pytest.raises(RuntimeError, match="does not have the code"):
        perform(absent, "0" * 64)


def test_one_process_two_processes_and_merged_stores_leave_the_same_bytes(tmp_path, undisturbed):
    for jobs in (1, 2):
        do(toys(30), Store(tmp_path / f"{jobs}"), jobs)
        assert results(tmp_path / f"{jobs}") == undisturbed(30)
    merged = Store(tmp_path / "merged")
    for first in range(3):
        part = Store(tmp_path / f"part {first}")
        do(toys(30)[first::3], part)
        subprocess.run(["cp", "-r", f"{part.folder}/.", f"{merged.folder}"], check=True)
    assert results(merged.folder) == undisturbed(30)
    assert merged.cost(toys(1)[0].key).keys() == {"pid"}


def test_processes_stay_for_many_tasks(tmp_path):
    log = tmp_path / "log"
    do(toys(12, log=str(log)), Store(tmp_path / "store"), 2)
    pids = {line.split()[1] for line in log.read_text().splitlines()}
    assert len(pids) <= 2
    assert str(os.getpid()) not in pids


def test_a_task_that_ends_its_process_is_not_kept_and_the_others_do_not_notice(tmp_path):
    store, deadly = Store(tmp_path / "store"), toy("exits", n=-1)
    found = do([deadly, *toys(4)], store)
    assert found[deadly.key] == {"failed": "its process died (exit code 3)"}
    assert [key for key in found if store.read(key) is None] == [deadly.key]
    assert len(found) == 5


def raise_odd():
    raise type("OddError", (Exception,), {})("cannot be pickled", object())


def test_the_pool_gives_each_task_a_process_of_its_own_and_says_why_one_failed():
    calls = {"a": (os.getpid, ()), "b": (os.getpid, ()), "c": (os._exit, (3,)), "d": (os.kill, ())}
    calls |= {"odd": (raise_odd, ()), "exit": (sys.exit, ("enough",))}
    found = dict(pool.finished(calls, 1))
    assert found["a"].value != found["b"].value
    assert found["c"] == (None, "its process died (exit code 3)", True)
    assert found["d"].failure.startswith("TypeError: ") and not found["d"].died
    assert found["odd"].failure == "OddError: ('cannot be pickled', <object object at 0x..>)"
    assert found["exit"] == (None, "SystemExit: enough", False)


def interrupted():
    os.kill(os.getpid(), signal.SIGINT)
    return "went on"


def test_ctrl_c_is_for_the_parent_to_decide():
    """A terminal sends it to all; a task that ended with it would pass for one that failed."""
    ((_, ended),) = pool.finished({"a": (interrupted, ())}, 1)
    assert ended.value == "went on"


DRIVER = """
import sys
from bench.run import pool
from bench.run.store import Store
from bench.run.work import Task, run_all
from tests.bench import toy_runs

folder, count, seconds, log, who, jobs = sys.argv[1:]
where = {"seconds": float(seconds), "log": log, "who": who}
tasks = [
    Task("tests.bench.toy_runs:run", {"n": n}, ("tests.bench.toy_runs",), where)
    for n in range(int(count))
]
store = Store(folder)
print("ready", flush=True)
if not int(jobs):
    pool.finished = toy_runs.here
todo = {task.key: task for task in tasks if store.read(task.key) is None}
work = run_all(todo, store, int(jobs))  # with a name: lives as long as the interpreter
for _ in work:
    """


def driver(folder, count, seconds, log, who=0, jobs=2, then="pass"):
    """A sweep in a session of its own, past its imports."""
    words = [folder, count, seconds, log, who, jobs]
    process = in_session([sys.executable, "-c", DRIVER + then, *words], cwd=ROOT)
    assert process.stdout.readline() == "ready\n"
    return process


def begun(log):
    """Who began what in which process: (who, pid, n) each."""
    return [tuple(map(int, line.split())) for line in log.read_text().splitlines()]


def wait_for(what, process):
    deadline = time.monotonic() + PATIENCE
    while not what():
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline
        time.sleep(0.01)


def ended(process, send, number, within=PATIENCE):
    """Sends it a signal; its exit code and last words, when none of its processes is left."""
    send(process, number)
    _, said = process.communicate(timeout=within)
    assert ends(processes_of(process.pid), within)
    return process.returncode, said


def test_killed_at_any_instant_and_started_again_it_ends_with_the_same_bytes(tmp_path, undisturbed):
    """25 kills at random instants; whenever all is done, it starts anew in another folder."""
    count, seconds, rng, log = 24, 0.006, np.random.default_rng(12), tmp_path / "log"
    names = {toy("run", n=n).key: n for n in range(count)}
    wanted, kills, completed = undisturbed(count), 0, 0
    start = time.monotonic()
    driver(tmp_path / "first", count, seconds, log, jobs=0).communicate()
    whole = time.monotonic() - start  # s
    for who in range(1, 200):
        folder = tmp_path / f"store {completed}"
        there = results(folder)
        jobs = 2 if who % 4 == 0 else 0  # with processes of its own now and then: they cost time
        longest = (1.2 if jobs else 0.7) * whole
        process = driver(folder, count, seconds, log, who, jobs)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.communicate(timeout=rng.uniform(0.0, longest) if kills < 25 else 60.0)
        process.kill()
        process.communicate()
        mine = [(pid, n) for by, pid, n in begun(log) if by == who]
        assert ends({pid for pid, _ in mine})
        done = [n for _, n in mine]
        assert len(done) == len(set(done))
        assert not set(done) & {names[Path(name).stem] for name in there}
        assert there.items() <= results(folder).items() <= wanted.items()
        if process.returncode == 0:
            assert results(folder) == wanted
            completed += 1
        kills += process.returncode == -signal.SIGKILL
        if kills == 25 and process.returncode == 0:
            break
    assert (kills, process.returncode) == (25, 0)
    assert completed >= 2


@pytest.mark.parametrize(
    ("send", "number"),
    [
        (signal_one, signal.SIGTERM),
        (signal_one, signal.SIGKILL),
        (signal_one, signal.SIGINT),
        (signal_group, signal.SIGINT),
    ],
)
def test_whatever_ends_it_leaves_no_process_behind(tmp_path, send, number):
    log = tmp_path / "log"
    log.touch()
    process = driver(tmp_path / "store", 4, 60.0, log)
    wait_for(lambda: len(begun(log)) >= 2, process)
    returned, said = ended(process, send, number, 0.5 * PATIENCE)
    assert returned == -number
    assert "Process SpawnProcess" not in said  # the workers do not join in with tracebacks
    assert results(tmp_path / "store") == {}


def test_an_exception_nobody_catches_does_not_wait_for_the_others(tmp_path):
    """Its traceback keeps the work alive until the interpreter is gone."""
    log = tmp_path / "log"
    log.touch()
    process = driver(tmp_path / "store", 9, 0.5, log, then="raise ValueError('mine')")
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert said.rstrip().endswith("ValueError: mine")
    assert ends(processes_of(process.pid))
    assert len(results(tmp_path / "store")) == 1


PLUGIN = """
import time
from pathlib import Path
from slams.baselines import Odometry

class Stuck(Odometry):
    def update(self, scan):
        (Path(__file__).parent / "stuck").touch()
        while True:
            time.sleep(0.01)
"""


def test_a_comparison_that_is_ended_leaves_nothing(tmp_path):
    """Ended by SIGTERM, then by Ctrl-C, in the midst of a run."""
    (tmp_path / "plugin.py").write_text(PLUGIN)
    drive(n=8).save(tmp_path / "room.npz")
    words = ["bench.compare", "room.npz", "--out", "out", "--jobs", "2"]
    words += ["--algorithms", "odometry", "plugin:Stuck"]
    for send, number, code, word in (
        (signal_one, signal.SIGTERM, 143, "terminated"),
        (signal_group, signal.SIGINT, 130, "interrupted"),
    ):
        (tmp_path / "stuck").unlink(missing_ok=True)
        process = started(*words, folder=tmp_path)
        wait_for((tmp_path / "stuck").exists, process)
        returned, said = ended(process, send, number)
        assert (returned, said.splitlines()[-1]) == (code, f"slams compare: {word}")
        assert "Traceback" not in said
        assert list(tmp_path.glob(".*.part")) == []
        assert not (tmp_path / "out").exists()
