"""What a wheel of this project brings; `make dist` builds one and tries it."""

import re
import tomllib
import zipfile

import pytest

from slams.registry import BUILT_IN
from tests import try_wheel
from tests.places import ROOT

TOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = TOOLS["project"]


def test_the_wheel_brings_every_package_and_each_has_types():
    packages = TOOLS["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    folders = {path.parent.name for path in ROOT.glob("*/__init__.py")} - {"tests"}
    assert set(packages) == folders == try_wheel.PACKAGES == set(TOOLS["tool"]["mypy"]["packages"])
    assert {target.partition(".")[0] for target in BUILT_IN.values()} <= folders
    assert [name for name in packages if not (ROOT / name / "py.typed").is_file()] == []


def test_the_front_page_names_what_the_wheel_brings():
    limits = (ROOT / "README.md").read_text(encoding="utf-8").partition("## Limits")[2]
    listed = re.search(r"top-level packages (.*?)\.", limits)[1]
    assert set(re.findall(r"`(\w+)`", listed)) == try_wheel.PACKAGES


def test_a_stranger_learns_whose_it_is_and_what_it_needs():
    assert PROJECT["authors"]
    assert PROJECT["license"] == "BSD-3-Clause"
    assert (ROOT / PROJECT["readme"]).is_file()
    least = PROJECT["requires-python"].removeprefix(">=")
    versions = [c.rpartition(" ")[2] for c in PROJECT["classifiers"] if "Python :: 3." in c]
    assert versions[0] == least


def test_make_dist_tries_what_it_built():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    recipe = makefile.partition("\ndist:")[2].partition("\n\n")[0]
    assert recipe.index("-m build") < recipe.index("tests/try_wheel.py dist/*.whl")
    assert any(need.startswith("build") for need in PROJECT["optional-dependencies"]["dist"])


@pytest.mark.parametrize("missing", ["tsd/py.typed", "tsd/__init__.py", None])
def test_a_wheel_without_a_package_or_its_types_is_refused(missing, tmp_path):
    names = [f"{p}/{n}" for p in try_wheel.PACKAGES for n in ("__init__.py", "py.typed")]
    with zipfile.ZipFile(tmp_path / "a.whl", "w") as archive:
        for name in [*names, "slams-0.1.0.dist-info/METADATA"]:
            if name != missing and not (missing == "tsd/__init__.py" and name.startswith("tsd/")):
                archive.writestr(name, "")
    found = try_wheel.packages_of(tmp_path / "a.whl")
    assert (found == dict.fromkeys(try_wheel.PACKAGES, True)) == (missing is None)
