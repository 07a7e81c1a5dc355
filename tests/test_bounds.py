"""Parameters, every class of them: what they tell, and that no value takes all memory or hangs."""

import importlib
import mmap
import pkgutil
import tracemalloc
import typing

import numpy as np
import pytest

import slams.frontend
from bench.sim.sensors import SENSORS
from slams.params import LASER_MODELS, MAX_COUNT, MAX_LENGTH, MAX_NUMBER, MAX_SEED, Params
from slams.registry import find
from tests.rooms import ALGORITHMS, ORIGINALS

# that an algorithm reserves with all counts at their greatest and cells at their least
MOST_GB = 5.0
MOST_STEPS = 10_000  # of anything that a scan waits for, or that is waited for in scans
# crsm@original draws so many steps, of 40 rays each; many particles make each map smaller
CHEAP = {"iterations": 1_000_000, "n_particles": 20_000}
SIZES = {"map_size", "side", "max_tiles", "max_cells"}  # cells and tiles: memory, tested below
LABELS = [*ALGORITHMS, *ORIGINALS]


def classes():
    """Every class of parameters there is in this code."""
    for module in pkgutil.iter_modules(slams.frontend.__path__, "slams.frontend."):
        importlib.import_module(module.name)
    for label in (*LABELS, "odometry", "kiss"):
        find(label)

    def below(cls):
        return {cls}.union(*(below(sub) for sub in cls.__subclasses__()))

    ours = {"slams", "hector", "tsd", "crsm", "gmapping"}
    found = [cls for cls in below(Params) if cls.__module__.partition(".")[0] in ours]
    return sorted(found, key=lambda cls: (cls.__module__, cls.__qualname__))


def bounds(cls):
    """Least and greatest value of every parameter that is a number."""
    kinds = typing.get_type_hints(cls)
    numbers = {name: spec for name, spec in cls.specs().items() if kinds[name] in (int, float)}
    return {name: spec.bounds(kinds[name]) for name, spec in numbers.items()}


CLASSES = classes()


def test_all_classes_are_walked():
    names = {cls.__module__ for cls in CLASSES}
    assert {"hector.params", "hector.original.params", "slams.frontend.params"} <= names
    assert len(CLASSES) >= 11


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: f"{cls.__module__}.{cls.__name__}")
def test_every_parameter_tells_what_it_is_and_every_number_its_bounds(cls):
    kinds, specs = typing.get_type_hints(cls), cls.specs()
    for name, spec in specs.items():
        assert spec.unit and len(spec.meaning) > 5 and len(spec.source) >= 4, name
    for name, (low, high) in bounds(cls).items():
        assert low < high <= MAX_SEED, name
        if kinds[name] is int and name != "seed":
            assert specs[name].low is not None, f"{name} has no least value"
            assert specs[name].high is not None, f"{name} has no greatest value"
            assert name in SIZES or high <= CHEAP.get(name, MOST_STEPS), name
        if kinds[name] is float:
            assert high <= (MAX_LENGTH if specs[name].unit == "m" else MAX_NUMBER), name
        for value in (low, high):
            assert getattr(cls().replace(**{name: value}), name) == value
        for value in (high * 1.01 + 1.0, 1e300):
            with pytest.raises(ValueError, match=f"parameter '{name}': got"):
                cls().replace(**{name: kinds[name](value)})
    assert MAX_COUNT <= 1e6


@pytest.mark.parametrize("label", LABELS)
def test_the_greatest_of_everything_fits_into_memory(label, monkeypatch):
    """Arrays are reserved and not filled: what is written to later is what counts here."""

    def full(shape, fill_value, dtype=None):
        return np.empty(shape, dtype or np.asarray(fill_value).dtype)

    monkeypatch.setattr(np, "full", full)
    monkeypatch.setattr(np, "zeros_like", lambda a, dtype=None: np.zeros(a.shape, dtype or a.dtype))
    addresses, mapped = [], mmap.mmap  # room that takes memory only where something is written
    monkeypatch.setattr(mmap, "mmap", lambda *a: addresses.append(a[1]) or mapped(*a))
    entry = find(label)
    cls = type(entry.params())
    kinds = typing.get_type_hints(cls)
    greatest = {name: int(h) for name, (_, h) in bounds(cls).items() if kinds[name] is int}
    least = {n: b[0] for n, b in bounds(cls).items() if n in ("cell", "resolution", "coarse_cell")}
    params = entry.params().replace(**greatest | least)
    tracemalloc.start()
    try:
        slam = entry.cls(params)
        reserved = tracemalloc.get_traced_memory()[1] / 1e9
    finally:
        tracemalloc.stop()
    assert reserved < MOST_GB, f"{slam.params}: {reserved:.1f} GB"
    assert reserved + sum(addresses) / 1e9 > 0.001, "something was reserved at all"


def test_the_lasers_are_those_of_the_simulator():
    assert sorted(LASER_MODELS) == sorted(SENSORS)


@pytest.mark.parametrize("sensor", LASER_MODELS)
@pytest.mark.parametrize("name", ALGORITHMS)
def test_every_preset_takes_every_sensor(name, sensor):
    for preset in find(name).cls.Params.presets():
        params = find(f"{name}@{preset}").params()
        assert set(params.SENSORS) <= set(LASER_MODELS)
        changed = params.for_sensor(sensor)
        assert changed.as_dict() == params.as_dict() | params.SENSORS.get(sensor, {})
