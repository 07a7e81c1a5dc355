"""report.html: complete, safe with any name, offline, small, and the same each time."""

import base64
import re
from html.parser import HTMLParser
from itertools import combinations

import cv2
import numpy as np
import pytest

from bench.judge import loss, metrics, verdicts
from bench.report import figures, outputs, tables
from bench.report.palette import COLORS, UNKNOWN_SHADE, shade
from bench.report.pareto import Point, front
from bench.results import Comparison, LogResult, Outcome, Reference
from bench.run.cases import Choice, facts, failed, replayed
from slams import OccupancyGrid, Params, Pose2
from tests.rooms import drive

BAD_NAME = "<script>alert('x')</script>"
VOID = {"meta", "input", "img", "br", "link"}
SPANS = {"update": 0.0005, "1 s": 0.0006}


class Still:
    """Thinks it stands where it began; knows a small map."""

    Params = Params
    step = 0.0

    def __init__(self, params):
        self.scans = 0

    def update(self, scan):
        self.scans += 1
        return Pose2(self.step * (self.scans - 1), 0.0, 0.0)

    def map(self):
        p = np.full((20, 30), np.nan, np.float32)
        p[5:15, 5:25], p[5, 5:25] = 0.1, 0.9
        return OccupancyGrid(p, 0.1, (-1.5, -1.0))

    def report(self):
        return {"odometry": 0}


class Poor(Still):
    """Odometry that takes every way for too long."""

    def update(self, scan):
        super().update(scan)
        self.first = scan.odometry if self.scans == 1 else self.first
        pose = self.first.between(scan.odometry)
        return Pose2(1.2 * pose.x, 1.2 * pose.y, pose.theta)


class Runaway(Still):
    step = 0.5


class Broken(Still):
    def update(self, scan):
        if self.scans == 30:
            raise ValueError("no <b>walls</b> & no hope")
        return super().update(scan)


class Page(HTMLParser):
    """Elements in order, ids, text; fails where the nesting is wrong."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.raw = text
        self.open, self.elements, self.words, self.scripts = [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        kind = self.open[-1] if self.open else ""
        (self.scripts if kind in ("script", "style") else self.words).append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())

    def all(self, tag, **wanted):
        return [
            attrs
            for name, attrs in self.elements
            if name == tag and all(v in (attrs.get(k) or "").split() for k, v in wanted.items())
        ]


LABELS = {"poor": Poor, "still": Still, "runaway": Runaway, "broken": Broken}


def outcomes(log, names, choice=None):
    made = []
    for name in names:
        known = f"tests.bench.test_html:{LABELS[name].__name__}" if name in LABELS else name
        try:
            outcome = replayed(known, log, choice or Choice())
        except ValueError as error:
            outcome = failed(known, log, f"ValueError: {error}")
        outcome.row["algorithm"] = name
        outcome.row.setdefault("map", None)
        made.append(outcome)
    return made


def done_of(log, made):
    entry, truth = facts(log), log.truth_at(log.t)
    way = None if truth is None else metrics.common(log.t, truth, truth).truth
    entry["verdicts"] = verdicts.on_one_log(made)
    grid = made[0].grid if truth is not None else None
    start = Pose2(*truth[0].tolist()) if truth is not None else None
    return LogResult(Reference(entry, way, grid, start), made)


def written(folder, done, **more):
    made = {
        "command": "python -m bench.compare a.npz --quick",
        "odometry": True,
        "versions": {"python": "3.11.7"},
        "machine": {"cpu": "a <fast> one", "threads": {"OMP_NUM_THREADS": "1"}},
    } | more
    outputs.write(folder, Comparison(made, [done], []))
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def comparison():
    """A good, a poor, a lost and a failed run; the poor one has a hostile name."""
    log = drive(n=120)
    made = outcomes(log, ["odometry", "poor", "runaway", "broken"], Choice())
    made[1].row["algorithm"] = BAD_NAME
    return done_of(log, made)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("report")


@pytest.fixture(scope="module")
def page(comparison, folder):
    return Page(written(folder, comparison))


def test_headings_and_sections_are_there_in_order(page):
    names = re.findall(r'<h2 id="[\w-]+">([^<]+)</h2>', page.raw)
    assert names == [
        "Which one",
        "Maps",
        "Errors",
        "Tables and histograms of the paper",
        "Trajectories",
        "All tables",
        "Significance",
        "How it was run",
        "Definitions",
    ]
    assert f"Take {BAD_NAME}" in page.text, "a baseline is no algorithm to take"
    anchors = {attrs["href"][1:] for attrs in page.all("a")}
    assert anchors == {name.lower().replace(" ", "-") for name in names}
    ids = [attrs["id"] for _, attrs in page.elements if "id" in attrs]
    assert sorted(ids) == sorted(set(ids))
    assert anchors <= set(ids)
    assert page.all("html", lang="en")


def test_one_table_maps_and_curves_are_seen_at_first_and_the_rest_is_folded(comparison, page):
    made = tables.tables(comparison.reference.entry, [o.row for o in comparison.outcomes])
    titles = [attrs["aria-label"] for attrs in page.all("div", role="region")]
    wanted = [one.title for one in made.values()]
    assert sorted(titles[: len(wanted)]) == sorted(wanted)
    assert titles[0] == made["main"].title
    assert [title.partition(":")[0] for title in titles[1:3]] == ["Table I", "Table II"]
    seen = page.raw.partition("<details>")[0]
    assert seen.count("<table>") == 1
    assert seen.count("<figure>") == 2, "maps, errors with costs"


def test_names_of_outsiders_are_text(page):
    assert BAD_NAME not in page.raw
    assert "<b>walls" not in page.raw
    assert "<fast>" not in page.raw
    assert page.text.count(BAD_NAME) > 5
    assert "broken failed: ValueError: no <b>walls</b> & no hope" in page.text
    assert len(page.all("script")) == 1
    handlers = [key for _, attrs in page.elements for key in attrs if key.startswith("on")]
    assert handlers == []


def test_nothing_is_loaded_from_anywhere(page):
    for tag, attrs in page.elements:
        for key in ("href", "src", "xlink:href", "srcset", "action"):
            value = attrs.get(key)
            assert value is None or value.startswith(("#", "data:image/png;base64,")), (tag, value)
    code = " ".join(page.scripts)
    for word in ("http", "//cdn", "@import", "url(", "fetch(", "XMLHttpRequest", "import("):
        assert word not in code, word
    policy = page.all("meta", **{"http-equiv": "Content-Security-Policy"})
    assert policy[0]["content"].startswith("default-src 'none'")


def test_the_page_says_how_the_runs_were_made_and_what_came_of_them(comparison, page):
    assert "runaway (lost)" in page.text
    assert re.search(r"Lost or failed: runaway after \d+ s and broken \(failed\)\.", page.text)
    assert f"odometry is better than {BAD_NAME} on this log by" in page.text
    assert "python -m bench.compare a.npz --quick" in page.text
    assert '"OMP_NUM_THREADS": "1"' in page.text
    assert f"{BAD_NAME}: parameters and report" in page.text
    mean = comparison.rows[0]["errors"]["spans"]["update"]["translation_m"]["mean"]
    assert f"{mean:.5f}" in page.text, "as in every other format"
    assert all(attrs.get("data-label") for attrs in page.all("td")), "for a narrow screen"


def test_definitions_have_the_constants_of_the_code(page, monkeypatch, comparison, tmp_path):
    assert "a pose error exceeds 0.5 m or 0.3 rad" in page.text
    monkeypatch.setattr(loss, "MAX_POSITION_ERROR", 7.25)
    changed = Page(written(tmp_path, comparison)).text
    assert "a pose error exceeds 7.25 m or" in changed
    assert f"is also given over {', '.join(metrics.SPANS[1:])} (" in changed
    assert "more than 5 % of the relations" in page.text
    assert "for more than 5 % of the scans" in page.text


def test_pictures_are_the_png_files_and_have_words(page, folder):
    shown = [base64.b64decode(attrs["src"].partition(",")[2]) for attrs in page.all("img")]
    names = "fig4_maps", "fig_errors", "fig2_translation", "fig3_orientation", "fig_trajectories"
    assert shown == [(folder / f"{name}.png").read_bytes() for name in names]
    assert all((folder / f"{name}.pdf").stat().st_size > 1000 for name in names)
    assert all(attrs["alt"] for attrs in page.all("img"))
    assert {attrs["scope"] for attrs in page.all("th")} == {"col", "row"}
    assert len(page.all("table")) == len(page.all("caption"))


def test_same_results_same_bytes(comparison, page, tmp_path):
    assert written(tmp_path, comparison) == page.raw


def test_a_log_without_truth(tmp_path):
    log = drive(n=60)
    log = type(log)(log.t, log.ranges, log.laser, log.odom, None, log.yaw_rate, {"name": "blind"})
    page = Page(written(tmp_path, done_of(log, outcomes(log, ["odometry", "poor"]))))
    assert "The log has neither ground truth nor relations" in page.text
    headings = page.raw
    assert 'id="trajectories"' in headings
    assert 'id="errors"' not in headings


def test_a_log_too_short_for_a_second_is_judged_by_updates(tmp_path, monkeypatch):
    titles = []
    monkeypatch.setattr(figures, "shares_below", lambda axes, of, what, looks: titles.append(what))
    log = drive(n=10)
    written(tmp_path, done_of(log, outcomes(log, ["odometry", "poor"])))
    assert titles == ["error per update"]


def test_all_runs_failed(tmp_path):
    log = drive(n=60)
    made = outcomes(log, ["broken"])
    page = Page(written(tmp_path, done_of(log, made)))
    assert "broken failed: ValueError" in page.text
    assert page.all("img") == []


def test_by_relations(tmp_path):
    log = drive(n=60)
    made = outcomes(log, ["odometry", "poor"])
    for k, outcome in enumerate(made):
        error = {"mean": 0.01 * (2 - k), "std": 0.0, "min": 0.0, "max": 0.0}
        every = dict.fromkeys(("translation_m", "rotation_rad"), error) | {"used": 5}
        outcome.row["relations"] = {"used": 5, "given": 5, "all": every}
        outcome.row["errors"] = None
    done = done_of(log, [Outcome(o.row, o.t, o.poses, o.grid) for o in made])
    page = Page(written(tmp_path, done))
    assert "Take poor: 10.00 mm by the relations" in page.text


def test_unknown_is_darker_than_free_and_lighter_than_occupied_however_unsure():
    p = np.linspace(0.0, 1.0, 1001)
    shades = shade(p)
    assert (shades[p < 0.5] > UNKNOWN_SHADE + 0.1).all()
    assert (shades[p > 0.5] < UNKNOWN_SHADE - 0.1).all()
    assert shade(np.array([np.nan, 0.5])).tolist() == [UNKNOWN_SHADE, UNKNOWN_SHADE]


def test_the_front_has_those_that_none_beats_in_both():
    cheap, good = Point("a", 1.0, 5.0, False), Point("b", 2.0, 1.0, False)
    worse = [Point("c", 2.0, 5.0, False), Point("d", 3.0, 1.0, False), Point("e", 0.1, 0.1, True)]
    assert front([*worse, good, cheap]) == [cheap, good]


def test_colors_are_easily_distinguished():
    apart = [difference(a, b) for a, b in combinations(COLORS, 2)]
    assert min(apart) > 20.0, "a distance in CIELAB"


def difference(a, b):
    """Distance of two colors in CIELAB."""
    image = np.array([[[int(c[k : k + 2], 16) / 255 for k in (1, 3, 5)] for c in (a, b)]])
    one, other = cv2.cvtColor(image.astype(np.float32), cv2.COLOR_RGB2LAB)[0]
    return float(np.linalg.norm(one - other))
