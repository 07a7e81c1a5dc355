"""python tests/try_wheel.py FILE.whl: install a wheel into an empty environment and use it there.

As a stranger would: nothing of the checkout is in reach, the log is simulated by the wheel itself.
"""

import json
import os
import subprocess
import sys
import tempfile
import venv
import zipfile
from pathlib import Path

ALGORITHMS = ("hector", "tsd", "crsm", "gmapping")
PACKAGES = {"slams", "bench", *ALGORITHMS}
SECONDS = 2.0  # of the simulated log
FARTHEST = 0.05  # m, end of a run from the truth


def packages_of(wheel):
    """Its top-level packages, each with whether it tells type checkers that it has types."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    tops = {name.partition("/")[0] for name in names if ".dist-info/" not in name}
    return {top: f"{top}/py.typed" in names for top in tops}


def environment(folder):
    """A new environment with the wheel and what it needs; the folder of its commands."""
    venv.create(folder, with_pip=True)
    return folder / ("Scripts" if os.name == "nt" else "bin")


def said(*words, cwd):
    """What a command says; its failure is ours."""
    clean = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    done = subprocess.run(
        [*map(str, words)], cwd=cwd, env=clean, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"{' '.join(map(str, words))}: exit code {done.returncode}\n{done.stderr}")
    return done.stdout


def used(commands, place):
    """Every command answers, and all four make a map of a simulated drive."""
    where = said(commands / "python", "-c", "import slams; print(slams.__file__)", cwd=place)
    assert Path(where.strip()).is_relative_to(commands.parent), where
    assert "slams compare" in said(commands / "slams", cwd=place)
    for script in ("run", "convert", "compare", "simulate", "sweep"):
        assert "usage:" in said(commands / "slams", script, "--help", cwd=place)
    said(commands / "slams", "simulate", "log.npz", "--duration", SECONDS, cwd=place)
    for name in ALGORITHMS:
        said(commands / "slams", "run", name, "log.npz", "--out", name, cwd=place)
        found = json.loads((place / name / "summary.json").read_text())
        assert found["errors"]["end_m"] < FARTHEST, (name, found["errors"])
        assert (place / name / "map.pgm").stat().st_size > 1000
    printed = said(commands / "slams", "compare", "log.npz", "--algorithms", "hector", cwd=place)
    assert (place / "results" / "compare" / "report.html").stat().st_size > 10_000, printed


def main(wheel):
    found = packages_of(wheel)
    assert found == dict.fromkeys(PACKAGES, True), found
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "elsewhere"
        place.mkdir()
        commands = environment(Path(folder) / "empty")
        quiet = ("--quiet", "--disable-pip-version-check")
        said(commands / "python", "-m", "pip", "install", *quiet, wheel, cwd=place)
        used(commands, place)
    print(f"{wheel.name}: installed in an empty environment, all four made a map there")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
