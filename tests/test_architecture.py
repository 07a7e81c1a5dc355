"""The house rules that a reader relies on, checked on the source text."""

import ast
import re
import subprocess
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import numpy as np
import pytest

from slams.jit import fingerprint, kernel_files
from slams.registry import BUILT_IN, find
from tests.places import ROOT
from tests.processes import python

ALGORITHMS = sorted({t.partition(".")[0] for t in BUILT_IN.values()} - {"slams"})
PACKAGES = ["slams", "bench", *ALGORITHMS]
OURS = {"slams", "bench", "tests", "hector", "tsd", "crsm", "gmapping"}
FILES = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


def tree_of(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def imported(nodes):
    """What is imported anywhere, in functions too: modules, and what is of them."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{ast.unparse(node)}: a relative import"
            yield from ((node.module, alias.name) for alias in node.names)


def imports(path):
    return {module for module, _ in imported(ast.walk(tree_of(path)))}


def module_of(path, root):
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def run_time_nodes(node):
    """All nodes but those that only type checkers see."""
    yield node
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and ast.unparse(child.test).endswith("TYPE_CHECKING"):
            for other in child.orelse:
                yield from run_time_nodes(other)
        else:
            yield from run_time_nodes(child)


def import_graph(files, root):
    """Each module with those it imports; `from a import b` is the module a.b, if it is one."""
    modules = {module_of(path, root): path for path in files}
    graph = {}
    for module, path in modules.items():
        found = {
            f"{base}.{name}" if f"{base}.{name}" in modules else base
            for base, name in imported(run_time_nodes(tree_of(path)))
        }
        graph[module] = found & set(modules)
    return graph


def circle(graph):
    """The modules of one import circle, the first again at the end; none if there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def kernels():
    for path in FILES:
        for node in ast.walk(tree_of(path)):
            decorators = getattr(node, "decorator_list", [])
            if any("njit" in ast.unparse(decorator) for decorator in decorators):
                yield pytest.param(path, node, id=f"{path.parent.name}/{path.stem}.{node.name}")


@pytest.mark.parametrize("name", ALGORITHMS)
def test_an_algorithm_imports_only_itself_and_the_interface(name):
    parts = {
        "slams": "types params jit geometry grid_bounds cells scan refine",
        "slams.scan": "end_points params leveling noise_kernels scan_kernels tilt_kernels",
        "slams.refine": "lines params",
        "slams.frontend": "confident correlative degeneracy keyframes motion_filter params plain",
    }
    allowed = {f"{of}.{part}" for of, names in parts.items() for part in names.split()}
    for path in (ROOT / name).rglob("*.py"):
        for module in imports(path):
            top = module.partition(".")[0]
            assert top not in OURS - {name} or module in allowed, f"{path.name} imports {module}"


# of its package an original takes what decides nothing: names, gmapping's storage
NEUTRAL = {
    "hector": {"ros"},
    "tsd": {"ros"},
    "crsm": {"ros"},
    "gmapping": {"ros", "map", "tile_kernels", "particles", "render"},
}


@pytest.mark.parametrize("name", ALGORITHMS)
def test_nothing_of_the_default_stands_in_the_path_of_the_original(name):
    original = ROOT / name / "original"
    assert find(f"{name}@original").cls.__module__ == f"{name}.original.slam"
    for path in (ROOT / name).rglob("*.py"):
        ours = {m for m in imports(path) if m.partition(".")[0] == name}
        others = {m for m in ours if not m.startswith(f"{name}.original")}
        if original in path.parents:
            assert others <= {f"{name}.{part}" for part in NEUTRAL[name]}, path
        else:
            assert ours == others, f"{path.name} imports the original"


@pytest.mark.parametrize("name", ALGORITHMS)
def test_what_is_alike_has_one_file_name(name):
    files = {"slam.py", "map.py", "map_kernels.py", "match_kernels.py", "params.py"}
    for folder, more in ((ROOT / name, {"ros.py", "README.md"}), (ROOT / name / "original", set())):
        assert files | more <= {path.name for path in folder.iterdir()}


def test_the_kernels_of_every_folder_name_the_cache(tmp_path):
    with_kernels = {param.values[0] for param in kernels()}
    assert with_kernels <= set(kernel_files())
    for path in ("slams/geometry.py", "hector/map_kernels.py", "hector/original/map_kernels.py"):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text("a = 1\n")
        before = fingerprint(tmp_path)
        assert fingerprint(tmp_path) == before
        (tmp_path / path).write_text("a = 2\n")
        assert fingerprint(tmp_path) != before, path


def test_slams_and_bench_know_no_algorithm():
    for package in ("slams", "bench"):
        for path in (ROOT / package).rglob("*.py"):
            tops = {module.partition(".")[0] for module in imports(path)}
            assert not tops & set(ALGORITHMS), path
            assert package == "bench" or not tops & {"bench"}, path


@pytest.mark.parametrize(
    ("library", "places"),
    [
        ("numba", {"slams/jit.py"}),
        ("rosbags", {"slams/formats", "slams/ros"}),  # files; definitions of messages
        ("cyclonedds", {"slams/live"}),
        ("scipy", {"slams/loops/graph.py", "tsd/original", "bench"}),  # slow to import
    ],
)
def test_a_library_is_imported_in_its_places_alone(library, places):
    users = [path for path in FILES if library in {m.partition(".")[0] for m in imports(path)}]
    used = {p for p in places for path in users if path.is_relative_to(ROOT / p)}
    assert used == places
    assert all(any(path.is_relative_to(ROOT / p) for p in places) for path in users)


def test_no_modules_import_each_other_in_a_circle():
    graph = import_graph(FILES, ROOT)
    assert set(PACKAGES) <= set(graph)
    assert "slams.formats.trajectory" in graph["slams.formats.source"]
    assert "slams.formats.bag_salvage" in graph["slams.formats.recording"]  # in a function
    assert circle(graph) == []


@pytest.mark.parametrize("name", [*ALGORITHMS, *(f"{name}/original" for name in ALGORITHMS)])
def test_slam_is_a_page_without_kernels_or_loops_over_beams(name):
    text = (ROOT / name / "slam.py").read_text(encoding="utf-8")
    assert "njit" not in text
    assert "range(len(" not in text
    assert len(text.splitlines()) <= 260
    functions = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]
    update = next(node for node in functions if node.name == "update")
    assert update.end_lineno - update.lineno <= 32
    exported = ast.walk(tree_of(ROOT / name / "__init__.py"))
    everything = next(node for node in exported if isinstance(node, ast.Assign))
    assert len(ast.literal_eval(everything.value)) == 2


@pytest.mark.parametrize(("path", "kernel"), list(kernels()))
def test_every_kernel_says_where_it_comes_from_and_takes_few_arguments(path, kernel):
    doc = ast.get_docstring(kernel) or ""
    assert re.search(r"\[[A-Z]\w+\d\d\]|\bours\b|\boriginal code\b", doc, re.I), doc
    assert len(kernel.args.args) <= 8
    body = "\n".join(ast.unparse(node) for node in kernel.body[1:])
    assert not re.search(r"\bprint\(|\braise\b|np\.linalg|\.sort\(|np\.sort|np\.median", body)


def test_no_file_is_too_long_to_read():
    most = 300  # lines
    assert [f"{p}" for p in FILES if len(p.read_text().splitlines()) > most] == []


def test_no_path_of_a_machine_stands_in_the_project():
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if not listed.stdout:
        pytest.skip("not a git checkout")
    for name in listed.stdout.split():
        if Path(name).suffix in (".py", ".md", ".toml", ".json", ".cff", ".yaml", ""):
            text = (ROOT / name).read_text(encoding="utf-8")
            found = re.search("/" + r"(work|root|home|tmp)/\w+", text)
            assert not found, (name, found)


STEPS = """
from slams.registry import find
from tests.rooms import laser, scan_at

def steps(label):
    entry = find(label)
    params = entry.params()
    slam = entry.cls(params.replace(map_size=256) if "original" in label else params)
    scans = [scan_at((0.1 * k, 0.0, 0.1 * k), laser(91), t=0.1 * k) for k in range(5)]
    return [tuple(map(float, slam.update(scan))) for scan in scans]
"""


@pytest.mark.parametrize("label", ["hector", "hector@original"])
def test_kernels_give_the_same_without_the_compiler(label):
    code = f"{STEPS}\nprint(steps({label!r}))"
    done = python("-W", "ignore", "-c", code, NUMBA_DISABLE_JIT="1")
    scope: dict = {}
    exec(STEPS, scope)
    expected = np.array(scope["steps"](label))
    assert np.array(ast.literal_eval(done.stdout)) == pytest.approx(expected, abs=1e-5)


def test_a_kernel_gives_the_same_bits_whatever_else_is_compiled(tmp_path):
    code = f"{STEPS}\nprint(steps('gmapping@paper'))"  # the order of fast sums may depend on it
    first = python("-c", code, NUMBA_CACHE_DIR=str(tmp_path)).stdout
    for file in tmp_path.rglob("climb_kernels*.nbi"):
        if "evaluate" not in file.name:
            file.unlink()
    assert python("-c", code, NUMBA_CACHE_DIR=str(tmp_path)).stdout == first != ""
