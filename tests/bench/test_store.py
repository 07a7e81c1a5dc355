"""Results in a folder: names, bytes, damage, a full disk."""

import json
import resource
from pathlib import Path

import numpy as np
import pytest

from bench.run.store import Store, canonical, code_version, digest
from bench.run.work import Task
from slams import summary

KEY = digest("some run")
VALUE = {"error_m": 0.1 + 0.2, "lost": False, "spans": [1.0, None, 1e-300], "failed": None}


def files(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*.json")}


def test_a_name_is_the_same_for_ever_whatever_the_order_of_keys_and_wherever_things_lie():
    what = {"log": "ab", "odometry": None, "seed": 3, "level": 0.1}
    task = Task("bench.run.some:run", what, where={"path": "elsewhere"})
    assert canonical(task.what) == '{"level":0.1,"log":"ab","odometry":null,"seed":3}'
    key = "ed32806b6ffc6277d785f9304b8f29d49956c95d94b22354e631ddb6c832c5d0"
    assert task.key_for("code") == key


def test_everything_given_is_in_the_name_to_the_last_bit():
    what = {"level": 0.1, "seed": 3, "label": "tsd"}
    changes = ({"level": np.nextafter(0.1, 1.0)}, {"seed": 4}, {"label": "tsd@paper"}, {"every": 1})
    names = [Task("m:f", what | change).key_for("code") for change in ({}, *changes)]
    names += [Task("m:g", what).key_for("code"), Task("m:f", what).key_for("other code")]
    names += [Task("m:f", {"level": 0.1, "seed": 3}).key_for("code")]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("odd", [float("nan"), float("inf"), {1, 2}, np.int64(3), Path("log")])
def test_what_has_no_exact_text_gets_no_name(odd):
    with pytest.raises((ValueError, TypeError)):
        _ = Task("m:f", {"odd": odd}).key


@pytest.fixture
def package(tmp_path, monkeypatch):
    folder = tmp_path / "toy_package"
    (folder / "inner").mkdir(parents=True)
    (folder / "__init__.py").write_text("")
    (folder / "inner" / "kernels.py").write_text("x = 1\n")
    (tmp_path / "toy_module.py").write_text("y = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    code_version.cache_clear()
    yield folder
    code_version.cache_clear()


def version_now(*packages):
    code_version.cache_clear()
    return code_version(packages)


def test_any_change_of_the_source_or_of_a_library_changes_the_version(package, monkeypatch):
    found = [version_now("toy_package")]
    (package / "inner" / "kernels.py").write_text("x = 2\n")
    found.append(version_now("toy_package"))
    (package / "inner" / "kernels.py").rename(package / "inner" / "other.py")
    found.append(version_now("toy_package"))
    (package / "more.py").write_text("")
    found.append(version_now("toy_package"))
    monkeypatch.setattr(summary, "version", lambda name: "0.0")
    found.append(version_now("toy_package"))
    assert len(set(found)) == 5


def test_line_ends_and_other_packages_do_not_change_the_version(package):
    before, of_module = version_now("toy_package"), version_now("toy_module")
    (package / "inner" / "kernels.py").write_bytes(b"x = 1\r\n")
    (package.parent / "toy_module.py").write_text("y = 2\n")
    assert version_now("toy_package") == before
    assert version_now("toy_module") != of_module, "a module is a package of one file"


@pytest.mark.parametrize("name", ["no_such_package", "toy_package.nothing", "sys", "", "a..b"])
def test_a_package_without_source_text_is_refused(package, name):
    with pytest.raises(LookupError, match="expected a package or module with source text"):
        version_now(name)


def test_a_result_comes_back_as_it_was_with_its_cost_beside(tmp_path):
    results = Store(tmp_path)
    assert results.read(KEY) is results.cost(KEY) is None
    results.write(KEY, VALUE, {"cpu_s": 1.5})
    assert (results.read(KEY), results.cost(KEY)) == (VALUE, {"cpu_s": 1.5})
    names = [f"{KEY[:2]}/{KEY}.cost.json", f"{KEY[:2]}/{KEY}.json"]
    assert sorted(files(tmp_path)) == names


def test_numbers_of_numpy_come_back_as_plain_ones(tmp_path):
    results, numbers = Store(tmp_path), (np.int64(3), np.float32(0.1), np.bool_(False))
    results.write(KEY, {"row": np.array([0.1, np.nan, np.inf]), "numbers": numbers})
    plain = [3, float(np.float32(0.1)), False]
    assert results.read(KEY) == {"row": [0.1, None, None], "numbers": plain}
    with pytest.raises(TypeError, match="has a set in it"):
        results.write(KEY, {"odd": {1}})


@pytest.mark.parametrize("name", ["result", "cost"])
def test_a_file_cut_off_anywhere_or_with_a_wrong_bit_counts_as_absent(tmp_path, name):
    results = Store(tmp_path)
    results.write(KEY, VALUE, VALUE)
    path = results.path(KEY) if name == "result" else results.path(KEY).with_suffix(".cost.json")
    whole = path.read_bytes()
    read = results.read if name == "result" else results.cost
    for length in range(len(whole) - 1):  # without the last, the end of line, it is whole
        path.write_bytes(whole[:length])
        assert read(KEY) is None, length
    rng = np.random.default_rng(0)
    for at in range(len(whole) - 1):
        flipped = bytearray(whole)
        flipped[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(flipped)
        assert read(KEY) in (None, VALUE), at
        assert read(KEY) is None or json.loads(flipped) == json.loads(whole), at


@pytest.mark.parametrize(
    "text", ["", "\0" * 300, "[]", "null", "7", '{"value":1}', "[" * 10**5, '{"value":NaN}']
)
def test_whatever_else_lies_there_counts_as_absent_and_is_replaced(tmp_path, text):
    """And a result of another name."""
    results, other = Store(tmp_path), digest("another run")
    results.write(KEY, VALUE)
    results.path(other).parent.mkdir()
    results.path(KEY).rename(results.path(other))
    results.path(KEY).write_text(text)
    assert results.read(KEY) is None and results.read(other) is None
    results.write(KEY, VALUE)
    assert results.read(KEY) == VALUE


def test_where_the_system_stops_a_file_midway_nothing_of_it_stays(tmp_path):
    """Files may not grow above 4 kB, as on a full disk."""
    results = Store(tmp_path)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        results.write(KEY, VALUE)
        with pytest.raises(RuntimeError, match="results so far are kept"):
            results.write("0" * 64, {"rows": list(range(5000))})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(files(tmp_path)) == [f"{KEY[:2]}/{KEY}.json"]
    assert list(tmp_path.rglob("*.part")) == []


def test_a_folder_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "results").write_text("")
    with pytest.raises(OSError, match="results"):
        Store(tmp_path / "results")
