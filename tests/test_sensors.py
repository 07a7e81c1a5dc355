"""Sensor presets: known lasers, known parameters, and worth having."""

import pytest

from bench.sim.sensors import SENSORS
from slams.params import LASERS
from slams.registry import find
from tests.rooms import ALGORITHMS


def test_the_lasers_are_those_of_the_simulator():
    assert sorted(LASERS) == sorted(SENSORS)


@pytest.mark.parametrize("sensor", LASERS)
@pytest.mark.parametrize("name", ALGORITHMS)
def test_every_preset_takes_every_sensor(name, sensor):
    for preset in find(name).cls.Params.presets():
        params = find(f"{name}@{preset}").params()
        assert set(params.SENSORS) <= set(LASERS)
        changed = params.for_sensor(sensor)
        assert changed.as_dict() == params.as_dict() | params.SENSORS.get(sensor, {})
