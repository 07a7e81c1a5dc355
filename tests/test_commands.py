"""`slams` without a command lists them, with one it is the command."""

import ast
import re
import sys
import tomllib
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest

from slams import __main__ as slams
from slams.registry import BUILT_IN, DESCRIPTIONS, names
from tests import try_wheel
from tests.places import ROOT
from tests.processes import python

OF_THE_HOUSE = {"bench.readme"}  # makes the pages of this project: nobody else's command
HEAVY = ("numpy", "numba", "pandas", "matplotlib", "cv2", "scipy", "rosbags", "PIL")


def programs():
    """Every module below slams and bench that is a command by itself."""
    for package in ("slams", "bench"):
        for path in sorted((ROOT / package).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            if '\nif __name__ == "__main__":' in text and path != Path(slams.__file__):
                yield ".".join(path.relative_to(ROOT).with_suffix("").parts)


def test_every_command_stands_in_the_list_with_what_it_does(capsys):
    assert set(slams.COMMANDS.values()) == set(programs()) - OF_THE_HOUSE
    assert slams.main([]) == slams.main(["--help"]) == 0
    printed = capsys.readouterr().out
    for name, module in slams.COMMANDS.items():
        path = ROOT / f"{module.replace('.', '/')}.py"
        line = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))).splitlines()[0]
        assert len(slams.purpose(module)) > 15
        assert slams.purpose(module) in line
        assert f"  slams {name} " in printed
        assert f"  {slams.purpose(module)}\n" in printed


def test_every_algorithm_has_its_idea_in_about_five_words(monkeypatch):
    assert set(DESCRIPTIONS) <= set(names())
    for name, idea in DESCRIPTIONS.items():
        assert 4 <= len(idea.replace("baseline: ", "").split()) <= 5 or name in ("odometry",), name
        assert idea in slams.listed()
    monkeypatch.setattr(slams, "names", lambda: [*DESCRIPTIONS, "theirs"])
    assert "  theirs    of another package\n" in slams.listed()


@pytest.mark.parametrize("words", [[], *([name, "--help"] for name in slams.COMMANDS)])
def test_no_help_loads_anything_heavy(words):
    code = (
        "import sys\nfrom slams.__main__ import main\n"
        f"try:\n    main({words})\nexcept SystemExit:\n    pass\n"
        f"print('loaded', [m for m in {HEAVY} if m in sys.modules])"
    )
    assert python("-c", code).stdout.endswith("loaded []\n")


def test_a_command_gets_its_words_and_gives_its_exit_code(capsys):
    assert slams.main(["run", "hector", "--show-params"]) == 0
    assert "resolution: 0.05" in capsys.readouterr().out
    assert slams.main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("slams 0.")


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A folder one is in with a module in it, and no way there from python's path."""
    code = "from slams.baselines import Odometry\nclass Mine(Odometry):\n    pass\n"
    (tmp_path / "mine_here.py").write_text(code)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])
    yield tmp_path
    sys.modules.pop("mine_here", None)


def test_a_module_of_ones_own_is_found_in_the_folder_one_is_in(elsewhere, capsys):
    before = list(sys.path)
    assert slams.main(["run", "mine_here:Mine", "--show-params"]) == 0
    assert sys.path == [*before, str(elsewhere)], "behind everything that is installed"
    assert slams.main(["run", "mine_here:Mine", "--show-params"]) == 0
    assert len(sys.path) == len(before) + 1
    assert "seed: 0" in capsys.readouterr().out


def test_python_asked_to_be_safe_looks_nowhere_else(elsewhere, monkeypatch, capsys):
    flags = {name: getattr(sys.flags, name) for name in dir(sys.flags) if name[0] != "_"}
    monkeypatch.setattr(sys, "flags", SimpleNamespace(**flags | {"safe_path": True}))
    assert slams.main(["run", "mine_here:Mine", "--show-params"]) == 2
    assert "there is no module 'mine_here'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("word", "hint"), [("rnu", "; did you mean 'run'?"), ("--quick", ""), ("", "")]
)
def test_an_unknown_command_is_one_sentence_and_exit_2(word, hint, capsys):
    assert slams.main([word]) == 2
    printed = capsys.readouterr()
    known = ", ".join(slams.COMMANDS)
    assert printed.out == ""
    assert printed.err == f"slams: unknown command {word!r}{hint} (known: {known})\n"


@pytest.mark.parametrize("name", slams.COMMANDS)
def test_every_option_has_a_help_and_is_known_by_its_whole_name_alone(name):
    parser = import_module(slams.COMMANDS[name]).parser()
    assert [action.dest for action in parser._actions if not action.help] == []
    assert not parser.allow_abbrev


TOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


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
