"""The plan of a sweep: which algorithms run on which logs under which conditions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from bench.judge import loss
from bench.results.sweep import Cost, Sweep, Trial
from bench.run.compare_options import check_log_options
from bench.run.single import Single, algorithm_of, params_of
from bench.run.store import sources_of
from bench.run.trial import CLIMB_FUNCTION, content_of
from bench.run.work import Task
from bench.sim.degrade import CATALOG
from bench.sim.sensors import SENSORS
from bench.sim.setting import ARENAS, Setting, look_up
from slams import load
from slams.registry import find

if TYPE_CHECKING:
    from bench.run.store import Store
    from slams.formats.options import SourceOptions
    from slams.scanlog import ScanLog

ODOMETRY_SENSORS = frozenset({"odometry", "gyro"})
Conditions = dict[str, tuple[float, ...]]  # levels by degradation


class Drives(NamedTuple):
    """Simulated logs: `seeds` drives of `duration` [s] in each arena, with one sensor.

    Their seeds count up from `first`.
    """

    arenas: list[str]
    seeds: int
    duration: float
    sensor: str
    first: int = 0


class Given(NamedTuple):
    """A log of the plan, simulated or recorded.

    `place` is the kind of arena, or the log's name; `seed` that of the simulation or of the
    degradations; `identity` identifies the content. `lacks`: missing sensors that a degradation may
    need. `recorded` is the log if it was not simulated; `repeated`: not the log's first seed.
    """

    name: str
    place: str
    seed: int
    identity: dict[str, Any]
    lacks: frozenset[str] = frozenset()
    recorded: ScanLog | None = None
    repeated: bool = False


class Case(NamedTuple):
    """A planned climb: the common part of its trials, and the task."""

    known: Trial
    task: Task


@dataclass(frozen=True)
class Plan:
    """The inputs of a sweep; `rate` [Hz] is the maximum scan rate, None for all scans.

    An algorithm may be a variant, `bench.run.single`; `single` has the options of each.
    """

    algorithms: list[str]
    conditions: Conditions
    logs: list[Given]
    odometry: tuple[bool, ...]
    rate: float | None
    sensor: str | None
    single: Mapping[str, Single] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for algorithm in self.algorithms:
            self.parameters(algorithm)

    def parameters(self, algorithm: str) -> dict[str, Any]:
        """The resolved parameters of an algorithm or a variant, for the sensor.

        Raises:
            LookupError: no such algorithm or parameter.
            ValueError, OSError: an invalid value or file.
        """
        return params_of(algorithm, self.sensor, self.single).as_dict()

    def settings(self) -> dict[str, dict[str, Any]]:
        """Parameters that differ from the preset and are not part of the label, by algorithm.

        Algorithms without such parameters are omitted.
        """
        found: dict[str, dict[str, Any]] = {}
        for algorithm in self.single:
            preset = params_of(algorithm, self.sensor).as_dict()
            now = self.parameters(algorithm)
            found[algorithm] = {key: value for key, value in now.items() if value != preset[key]}
        return {algorithm: changes for algorithm, changes in found.items() if changes}

    def cases(self, place: Path) -> list[Case]:
        """All climbs, by log and condition; recorded logs are saved in the folder `place`."""
        found: list[Case] = []
        for given in self.logs:
            recorded = _kept(given, place)
            for name in self.conditions:
                for odometry in self.odometry:
                    if _applies(given, name, odometry):
                        found += [
                            self._case(given, name, odometry, algorithm, recorded)
                            for algorithm in self.algorithms
                        ]
        return found

    def gathered(
        self, cases: list[Case], done: Mapping[str, Any], store: Store, record: dict[str, Any]
    ) -> Sweep:
        """All trials with their figures, of finished and kept climbs."""
        trials: list[Trial] = []
        costs: list[Cost | None] = []
        for case in cases:
            value: Any = done.get(case.task.key) or store.read(case.task.key)
            spent = (store.cost(case.task.key) or {"costs": []})["costs"]
            levels = case.task.what["condition"]["levels"]
            tried = value.get("trials", [value])  # a failure before the first level is one trial
            for k, (level, trial) in enumerate(zip(levels, tried, strict=False)):
                trials.append(case.known | {"level": level} | cast("Trial", trial))
                costs.append(spent[k] if k < len(spent) else None)
        return Sweep(self.facts(), trials, costs, record)

    def facts(self) -> dict[str, Any]:
        """The facts of a `Sweep`, which tell it from one of other settings."""
        recorded = any(one.recorded is not None for one in self.logs)
        entries = [CATALOG[name] for name in self.conditions]
        settings = self.settings()
        return {
            "units": {entry.name: entry.unit for entry in entries},
            "meanings": {entry.name: entry.meaning for entry in entries},
            "levels": {name: list(levels) for name, levels in self.conditions.items()},
            "logs": [
                {"name": one.name, "place": one.place, "seed": one.seed, **one.identity}
                for one in self.logs
            ],
            "algorithms": self.algorithms,
            "odometry": list(self.odometry),
            "rate": self.rate,
            "sensor": self.sensor or (None if recorded else "utm30lx"),
            "lost": loss.words(),
            **({"settings": settings} if settings else {}),
        }

    def _case(
        self, given: Given, degradation: str, odometry: bool, algorithm: str, recorded: str | None
    ) -> Case:
        """One algorithm on one log under one condition; `recorded` is the local path of the log."""
        known: Trial = {
            "algorithm": algorithm,
            "log": given.name,
            "place": given.place,
            "seed": given.seed,
            "degradation": degradation,
            "odometry": odometry,
        }
        name, levels = algorithm_of(algorithm), self.conditions[degradation]
        what = {
            "log": given.identity,
            "condition": {
                "degradation": degradation,
                "levels": levels,
                "seed": given.seed if CATALOG[degradation].random else 0,
                "rate": self.rate,
            },
            "algorithm": name,
            "parameters": self.parameters(algorithm),
            "odometry": odometry,
        }
        sources = sources_of(find(name).cls)
        return Case(known, Task(CLIMB_FUNCTION, what, sources, {"recorded": recorded}))


def conditions_of(chosen: list[str]) -> Conditions:
    """The chosen degradations in the order of the catalog, their levels from mild to severe.

    A name without a level has all levels of the catalog, `noise=0.05 noise=0.1` these two. "all"
    means all degradations.

    Raises:
        LookupError: no such degradation.
        ValueError: no such level.
    """
    found: dict[str, list[float]] = {}
    for text in list(CATALOG) if chosen == ["all"] else chosen:
        name, equals, level = map(str.strip, text.partition("="))
        entry = look_up("degradation", name, CATALOG)
        if equals:
            found.setdefault(name, []).append(entry.checked(level))
        else:
            found[name] = [float(level) for level in entry.levels]
    return {name: CATALOG[name].ordered(found[name]) for name in CATALOG if name in found}


def logs_of(paths: list[str], drives: Drives, options: SourceOptions) -> list[Given]:
    """The given logs, else simulated ones.

    Raises:
        OSError: a log cannot be opened.
        ValueError: a file is not a log or has no ground truth; options for logs without a log.
        LookupError: no such arena or sensor.
    """
    if not paths:
        check_log_options(paths, options)
    seeds = range(drives.first, drives.first + drives.seeds)
    if not paths:
        return [_simulated(arena, seed, drives) for seed in seeds for arena in drives.arenas]
    found = [_recorded(path, options) for path in paths]
    names = [given.name for given in found]
    if len(set(names)) < len(names):
        raise ValueError(f"logs: got the names {', '.join(names)}, expected different ones")
    return [g._replace(seed=seed, repeated=seed > drives.first) for g in found for seed in seeds]


def _simulated(arena: str, seed: int, drives: Drives) -> Given:
    look_up("arena", arena, ARENAS)
    look_up("sensor", drives.sensor, SENSORS)
    setting = Setting(arena=arena, seed=seed, duration=drives.duration, sensor=drives.sensor)
    return Given(f"{arena}-{drives.sensor}-{seed}", arena, seed, {"setting": asdict(setting)})


def _recorded(path: str, options: SourceOptions) -> Given:
    log = load(path, options).of_one_laser()
    if log.truth is None:
        raise ValueError(
            f"{path}: has no ground truth; a sweep needs one (--truth FILE), slams compare does not"
        )
    lacks = {"odometry": log.odom is None, "gyro": log.yaw_rate is None}
    missing = frozenset(name for name, absent in lacks.items() if absent)
    return Given(log.name, log.name, 0, {"content": content_of(log)}, missing, log)


def _kept(given: Given, place: Path) -> str | None:
    """The path of a recorded log, saved as npz under the hash of its content."""
    if given.recorded is None:
        return None
    path = (place / f"{given.identity['content']}.npz").resolve()
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        given.recorded.save(path)
    return str(path)


def _applies(given: Given, name: str, odometry: bool) -> bool:
    """Whether a run differs from all others.

    It does not if the degradation affects an unused sensor, if it has another seed but no chance,
    or if it uses the odometry of a log without odometry.
    """
    missing = given.lacks if odometry else ODOMETRY_SENSORS
    repeated = given.repeated and not CATALOG[name].random
    no_odometry = odometry and missing == ODOMETRY_SENSORS
    return not repeated and not no_odometry and not missing & set(CATALOG[name].needs)
