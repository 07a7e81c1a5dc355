"""Cases of a comparison as tasks: named by all that they follow from, their results as text.

What a run costs is part of its result here, so the machine is part of its name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from bench.results.arrays import pack_outcome, pack_reference
from bench.run.code import package_of, sources_with
from bench.run.store import plain
from bench.run.trial import content_of
from bench.run.work import Result, Task
from slams.registry import find

if TYPE_CHECKING:
    from bench.run.cases import Choice
    from slams.scanlog import ScanLog
    from slams.types import Floats

HERE = "bench.run.case_tasks"


class Given(NamedTuple):
    """A log of a comparison and what tells it from all others; `relations` (k, 5) or None."""

    log: ScanLog
    identity: dict[str, Any]
    relations: Floats | None


def given(log: ScanLog, relations: Floats | None) -> Given:
    """A log with its identity: everything that its rows follow from or name."""
    known = {
        "content": content_of(log),
        "name": log.name,
        "meta": plain(log.meta),
        "notes": list(log.notes),
        "relations": None if relations is None else relations.tolist(),
    }
    return Given(log, known, relations)


def reference_task(it: Given) -> Task:
    """What is known of a log besides its scans."""
    return Task(f"{HERE}:reference", {"log": it.identity}, sources_with(), {"given": it})


def run_task(
    it: Given, label: str, choice: Choice, machine: dict[str, Any], first: int | None = None
) -> Task:
    """A run of an algorithm; with `first`, only its error of the relations from that scan on."""
    entry = find(label)
    what = {
        "log": it.identity,
        "label": label,
        "parameters": choice.params(entry).as_dict(),
        "seen": {"realtime": choice.realtime, "slower": choice.slower},
        "machine": machine,
        "first": first,
    }
    packages = sources_with(package_of(entry.cls))
    return Task(f"{HERE}:run", what, packages, {"given": it, "choice": choice})


def reference(log: dict[str, Any], given: Given) -> Result:
    """Do `reference_task`: {"reference": text of `unpack_reference`}."""
    from bench.run import reference as known

    return Result({"reference": pack_reference(known.reference(given.log))})


def run(label: str, first: int | None, given: Given, choice: Choice, **_: Any) -> Result:
    """Do `run_task`: {"outcome": text of `unpack_outcome`}; with `first` {"error_m": m}."""
    from bench.run.cases import relation_error, replayed

    log = given.log if first is None else given.log.from_scan(first)
    outcome = replayed(label, log, choice, given.relations)
    if first is None:
        return Result({"outcome": pack_outcome(outcome)})
    return Result({"error_m": relation_error(outcome)})
