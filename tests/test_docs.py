"""What the pages name exists: commands with their options, files, names of code, make's targets."""

import importlib
import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import slams
from bench import readme, sweep
from bench.run.single import params_of
from bench.sim.setting import Setting
from slams import run
from slams.__main__ import COMMANDS
from slams.registry import ENTRY_POINT_GROUP
from tests.places import ROOT

DOCS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
OTHERS = [path for path in readme.readmes() if path not in DOCS]
PARSERS = {
    module.removesuffix(".__main__"): importlib.import_module(module).parser()
    for module in [*COMMANDS.values(), "bench.readme"]
}
TOOLS = {"pytest", "pip"}  # of others, run as modules
FOREIGN = {"--constraint", "--array"}  # of schedulers
EXAMPLES = {"mine:Icp", "peers:Genz", "peers:Small", "peers:Yag"}  # of python.md and peers.md
CODE_FILES = [
    path
    for package in ("slams", "bench", "hector", "tsd", "crsm", "gmapping", "tests")
    for path in sorted((ROOT / package).rglob("*.py"))
]
SOURCES = "\n".join(path.read_text(encoding="utf-8") for path in CODE_FILES)
FILE = re.compile(r"[\w.*/-]*\w\.(py|md|json|png|pgm|toml|yaml|cff|slurm|html|npz|mcap|tum|typed)")
SUFFIXES = r"\.(bag|npz|dat|gz|py|relations|launch|yaml|tum)"
ids = pytest.mark.parametrize("path", DOCS, ids=lambda path: path.name)


def spans(text):
    """What stands in backticks, outside of code blocks."""
    text = re.sub(r"```.*?```", "", text, flags=re.S)
    return [" ".join(span.split()) for span in re.findall(r"`([^`]+)`", text)]


def blocks(text):
    """Indented lines of code, those that go on in the next joined."""
    return re.findall(r"^    (\S.*)$", text.replace("\\\n", " "), re.M)


def simple(line):
    """The commands of a line, as words; nothing where it is no line of a shell."""
    try:
        words = shlex.split(line, comments=True)
    except ValueError:
        return []
    parts, rest = [[]], words
    for word in rest:
        if word == "&&":
            parts.append([])
        else:
            parts[-1].append(word.removeprefix(".venv/bin/"))
    return parts


def program_of(words):
    """Our module that the words run, and its arguments; None for commands of others."""
    match words:
        case ["python", "-m", module, *rest]:
            return module, rest
        case ["slams", name, *rest] if name != "COMMAND":
            return COMMANDS[name].removesuffix(".__main__"), rest
        case [module, *rest] if module in PARSERS and rest:
            return module, rest
    return None


def commands(text):
    """Ours in a page: in blocks all of them, in a sentence those with arguments."""
    found = [program_of(words) for line in blocks(text) for words in simple(line)]
    inline = [program_of(words) for span in spans(text) for words in simple(span)]
    return [one for one in found if one] + [one for one in inline if one and one[1]]


def check_run(arguments):
    arguments.ros_params, arguments.params = [], None
    if arguments.algorithm not in EXAMPLES:
        run.chosen(arguments)


def check_compare(arguments):
    for label in set(arguments.algorithms or []) - EXAMPLES:
        params_of(label, arguments.sensor)
    for pair in [*arguments.ros_params, *arguments.trajectory, *arguments.map]:
        assert all(pair.partition("="))


def check_sweep(arguments):
    if arguments.degradations != ["list"]:
        arguments.logs = []
        sweep._plan(arguments)


def check_simulate(arguments):
    Setting(**{key: getattr(arguments, key) for key in ("arena", "sensor", "seed", "people")})


CHECKS = {
    "slams.run": check_run,
    "bench.compare": check_compare,
    "bench.sweep": check_sweep,
    "bench.simulate": check_simulate,
}


@ids
def test_every_command_is_one_that_its_program_takes(path):
    for module, words in commands(path.read_text(encoding="utf-8")):
        if module in PARSERS:
            arguments = PARSERS[module].parse_args([word for word in words if word != "..."])
            CHECKS.get(module, vars)(arguments)
        else:
            assert module in TOOLS or find_spec(module), (module, words)
            files = [word for word in words if word.endswith(".py")]
            assert all((ROOT / name).is_file() for name in files), words


def test_commands_are_found_on_the_pages():
    found = [module for path in DOCS for module, _ in commands(path.read_text(encoding="utf-8"))]
    assert {"slams.run", "bench.compare", "bench.sweep"} <= set(found) and len(found) > 40


@ids
def test_every_option_in_a_sentence_is_one_of_ours(path):
    known = {option for parser in PARSERS.values() for option in parser._option_string_actions}
    for span in spans(path.read_text(encoding="utf-8")):
        if span.startswith("--"):
            used = {word.partition("=")[0] for word in span.split() if word.startswith("--")}
            assert used <= known | FOREIGN, span


def examples():
    """Files that the pages' commands are given: those are the reader's."""
    found = [one for path in DOCS for one in commands(path.read_text(encoding="utf-8"))]
    parts = {part for _, words in found for word in words for part in re.split(r"[=/]", word)}
    return parts | {"mine.py", "peers.py", "MAP.yaml"}


def exists(name, page):
    """A file of the project, of a package, or one that the programs write."""
    places = (ROOT / name, page.parent / name)
    written = name in SOURCES or name.startswith("results/")  # git does not keep those
    return written or any(place.exists() for place in places)


@ids
def test_every_file_exists_or_is_written_by_the_programs(path):
    known = examples()
    tracked = {file.name for file in ROOT.glob("*/**/*.py")} | {"idea.png", "py.typed"}
    for span in spans(path.read_text(encoding="utf-8")):
        if FILE.fullmatch(span) or re.fullmatch(r"[\w./-]+/", span):
            inside = span in tracked or any(ROOT.glob(f"*/{span}"))
            assert inside or span in known or exists(span, path), span


def resolved(name):
    """Whether a dotted name leads to something: module, class, function, method, parameter."""
    words = re.sub(r"\(.*\)", "", name).split(".")
    for k in range(len(words), 0, -1):
        try:
            found = importlib.import_module(".".join(words[:k]))
        except ModuleNotFoundError:
            continue
        return reached(found, words[k:])
    if words[0] in slams.__all__:
        return reached(slams, words)
    return words[0] == "np" and reached(np, words[1:])


def reached(found, words):
    for word in words:
        found = getattr(found, word, None)
    return found is not None


@ids
def test_every_dotted_name_leads_to_something(path):
    for span in spans(path.read_text(encoding="utf-8")):
        plain = re.fullmatch(r"[A-Za-z_]\w*(\.\w+)+(\(.*\)(\.\w+\(\))?)?", span)
        if plain and not FILE.fullmatch(span) and not re.search(rf"{SUFFIXES}$", span):
            assert span == ENTRY_POINT_GROUP or resolved(span), span


def slug(heading):
    """The anchor that forges give a heading."""
    return re.sub(r"[^\w -]", "", heading.lower()).strip().replace(" ", "-")


@pytest.mark.parametrize("path", [*DOCS, *OTHERS], ids=str)
def test_links_find_their_file_and_section(path):
    text = path.read_text(encoding="utf-8")
    for name in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (path.parent / name).is_file(), name
    for name, anchor in re.findall(r"\]\(([^)#:]*)#([^)]+)\)", text):
        target = (path.parent / name) if name else path
        headings = re.findall(r"^#+ (.*)$", target.read_text(encoding="utf-8"), re.M)
        assert anchor in map(slug, headings), (name, anchor)


def test_the_front_page_leads_to_every_page():
    front = DOCS[0].read_text(encoding="utf-8")
    linked = set(re.findall(r"\]\(([^)#:]+)", front))
    pages = [path.relative_to(ROOT).as_posix() for path in DOCS[1:]]
    packages = [path.relative_to(ROOT).as_posix() for path in OTHERS]
    assert {*pages, *packages} <= linked


def test_every_generated_part_is_told_how_it_was_made():
    page = (ROOT / "docs" / "figures.md").read_text(encoding="utf-8")
    parts = {*readme.PARTS, "parameters", "ros-parameters"}
    assert set(re.findall(r"^\| `([a-z-]+)`|, `([a-z-]+)` \|", page, re.M))
    named = {span for line in page.splitlines() if line.startswith("| `") for span in spans(line)}
    assert parts <= named
    kept = {path.name for path in (ROOT / "bench").glob("readme_*.json")}
    assert kept == {Path(name).name for name in named if name.endswith(".json")}


@ids
def test_every_target_of_make_exists(path):
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    text = path.read_text(encoding="utf-8")
    lines = [*blocks(text), *spans(text)]
    for target in [match[1] for line in lines if (match := re.match(r"make ([a-z]+)", line))]:
        assert re.search(rf"^{target}:.*##", makefile, re.M), target
        assert target in re.search(r"^\.PHONY:(.*)$", makefile, re.M)[1].split()


@ids
def test_every_capital_name_stands_in_the_code(path):
    for span in spans(path.read_text(encoding="utf-8")):
        if re.fullmatch(r"[A-Z]\w+", span):
            assert re.search(rf"\b{span}\b", SOURCES), span
