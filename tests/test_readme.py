"""The READMEs say what the code does."""

import json
import re
import shlex

import pytest

from bench import compare, readme
from bench.results import RESULTS_FORMAT
from bench.results import sweep as results
from tests.bench.test_answers import climbs
from tests.bench.test_sweep import sweep_of
from tests.places import ROOT

FRONT = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = sorted((ROOT / "docs").glob("*.md"))
README = "\n".join([FRONT, *(page.read_text(encoding="utf-8") for page in PAGES)])


@pytest.mark.parametrize("path", readme.readmes(), ids=lambda path: path.parent.name)
def test_generated_parts_equal_what_they_are_generated_from(path):
    text = path.read_text(encoding="utf-8")
    assert readme.PART.search(text)
    assert readme.rendered(text) == text, "run python -m bench.readme"


def test_the_measured_tables_are_generated():
    parts = [part for _, part, *_ in readme.PART.findall(FRONT)]
    assert parts == ["table", "choice"]
    assert sorted(part for _, part, *_ in readme.PART.findall(README)) == sorted(readme.PARTS)


def test_one_reads_the_front_page():
    assert len(FRONT.splitlines()) <= 130


def test_a_sweep_is_kept_with_what_its_tables_show(tmp_path, monkeypatch):
    trials = climbs([3] * 8) + climbs([1] * 8, algorithm="b")
    found = sweep_of(trials)
    found.facts["logs"][0]["setting"] = {"long": 1}
    results.save(tmp_path, found._replace(record=found.record | {"command": "c --quick --out d"}))
    for kind in ("SWEEP", "RESULTS"):
        monkeypatch.setattr(readme, kind, tmp_path / f"{kind.lower()}.kept")
    readme.adopt(tmp_path)
    text = readme.rendered("<!-- sweep -->\n<!-- end -->")
    assert "`c --quick`, on a <b>: 16 climbs over one drive" in text
    assert "| noise [m] | >0.2 | 0.0707 (0.05 to 0.1) |" in text
    assert "| **a** (lost less, p = 0.016) |" in text
    text = readme.rendered("<!-- choice -->\n<!-- end -->")
    assert "little (noise) | **a** (lost less, p = 0.016) |" in text
    text = readme.rendered("<!-- field -->\n<!-- end -->")
    assert "| b, laser alone | 0 of 8 |" in text
    assert "long" not in readme.SWEEP.read_text()


def test_every_public_log_with_figures_says_where_it_is_from():
    words = shlex.split(readme.read_figures(readme.PUBLIC)["command"])[3:]
    logs = compare.parser().parse_args(words).logs
    section = README.partition("## Public logs")[2]
    assert len(logs) >= 3
    for log in logs:
        assert re.search(rf"^\| `{re.escape(log)}` \| .* \| [\w.-]+/\w+", section, re.M), log


PACKAGES = [path.parent for path in readme.readmes()[1:] if path.name == "README.md"]


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_names_of_code_in_a_package_readme_exist(package):
    files = [path for folder in (package, ROOT / "slams") for path in folder.rglob("*.py")]
    code = [*map(str, files), *(path.read_text(encoding="utf-8") for path in files)]
    known = {word for text in code for word in re.findall(r"\w+", text)}
    known |= {path.stem for path in (ROOT / "tests").rglob("*.py")}
    text = readme.PART.sub("", (package / "README.md").read_text(encoding="utf-8"))
    for name in re.findall(r"`([A-Za-z_][\w./]*)(?:\(\))?(?:=\S*)?`", text):
        assert set(re.findall(r"\w+", name)) <= known, name


def test_of_results_with_variants_the_picture_is_kept_and_the_tables_stay(tmp_path, monkeypatch):
    monkeypatch.setattr(readme, "ROOT", tmp_path)
    monkeypatch.setattr(readme, "RESULTS", tmp_path / "kept.json")
    (tmp_path / "bench").mkdir()
    (tmp_path / "fig_errors.png").write_text("costs")
    rows = [{"algorithm": label} for label in ("gmapping", "gmapping:n_particles=5")]
    found = {"format": RESULTS_FORMAT, "command": "c", "logs": [{}], "rows": rows}
    (tmp_path / "results.json").write_text(json.dumps(found))
    readme.adopt(tmp_path)
    assert (tmp_path / "bench" / "fig_cost.png").read_text() == "costs"
    assert not readme.RESULTS.exists()


def several_logs(folder):
    """Results of two logs as bench.compare writes them, as far as the README needs them."""
    more = {"duration_s": 10.0, "meta": {"more": "than is shown"}}
    costs = (("hector", 0.26), ("mine:Slam", 12.34))
    rows = [
        {"algorithm": label, "log": log, "failed": None, "cost": {"mean_ms": ms}}
        for log in ("a", "b")
        for label, ms in costs
    ]
    rows[3] |= {"failed": "ValueError: no", "cost": None}
    sizes = (("a", 9, 3), ("b", 70, 5))
    logs = [{"name": log, "scans": scans, "beams": n} | more for log, scans, n in sizes]
    command = "slams compare ../logs/a.bag 'x y/b.npz' --out /somewhere/o --every 2"
    found = {"format": RESULTS_FORMAT, "command": command, "machine": {"cpu": "a core"}}
    (folder / "results.json").write_text(json.dumps(found | {"logs": logs, "rows": rows}))


def test_results_of_several_logs_become_the_table_of_public_logs(tmp_path, monkeypatch):
    for kind in ("PUBLIC", "RESULTS", "RELATIONS"):
        monkeypatch.setattr(readme, kind, tmp_path / f"{kind.lower()}.json")
    several_logs(tmp_path)
    readme.adopt(tmp_path)
    assert "more" not in (tmp_path / "public.json").read_text()
    text = readme.rendered("<!-- public -->\n<!-- end -->")
    assert "`slams compare a.bag b.npz --every 2`, CPU time of a scan on a core" in text
    assert "| log | scans x beams | lasts [s] | hector [ms] | mine:Slam [ms] |" in text
    assert "| a | 9 x 3 | 10 | 0.3 | 12.3 |\n| b | 70 x 5 | 10 | 0.3 | - |\n" in text
    assert readme.rendered(text) == text
