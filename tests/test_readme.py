"""The READMEs say what the code does."""

import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

from bench import compare, ranking, readme, simulate
from slams import check, convert, metrics, run
from slams.player import replay
from slams.registry import find
from tests.rooms import drive

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", readme.readmes(), ids=lambda path: path.parent.name)
def test_generated_parts_equal_what_they_are_generated_from(path):
    text = path.read_text(encoding="utf-8")
    assert readme.PART.search(text)
    assert readme.rendered(text) == text, "run python -m bench.readme"


def test_the_commands_of_the_readme_are_ones_the_programs_take():
    parsers = {
        "slams.run": run.parser(),
        "bench.compare": compare.parser(),
        "bench.simulate": simulate.parser(),
        "bench.ranking": ranking.parser(),
        "slams.convert": convert.parser(),
        "slams.check": check.parser(),
    }
    lines = re.findall(r"^    python -m (.*)$", README.replace("\n--", " --"), re.M)
    lines += re.findall(r"`python -m ([^`]*)`", README.replace("\n", " "))
    assert len(lines) >= 8
    for line in lines:
        module, *arguments = shlex.split(line, comments=True)
        if module in parsers and (arguments or module != "bench.simulate"):
            parsers[module].parse_args(arguments)


def test_the_targets_of_make_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"^    make (\w+)", README, re.M):
        assert re.search(rf"^{target}:", makefile, re.M)


def test_linked_files_exist():
    for path in readme.readmes():
        for link in re.findall(r"\]\(([^)#:]+)\)", path.read_text(encoding="utf-8")):
            assert (path.parent / link).is_file(), link


@pytest.fixture
def example(tmp_path, monkeypatch):
    code = next(b for b in re.findall(r"```python\n(.*?)```", README, re.S) if "class Icp" in b)
    assert len([line for line in code.splitlines() if line.strip()]) <= 30
    (tmp_path / "mine.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    yield find("mine:Icp")
    sys.modules.pop("mine", None)


def test_the_example_algorithm_works(example):
    log = drive(n=60)
    done = replay(example.cls(example.params()), log)
    truth = log.truth_at(done.t)
    assert metrics.relative_errors(done.poses, truth, 1)[0].mean() < 0.02
    assert np.isnan(example.cls(example.params()).map().p).all()
