from dataclasses import dataclass

import pytest

from slams.params import Params, param


@dataclass(frozen=True)
class Example(Params):
    PRESETS = {"original": {"cell": 0.1, "mode": "b"}}

    cell: float = param(0.05, "m", "cell", source="paper, Table 1", low=0.01, high=1.0)
    steps: int = param(5, "1", "steps", source="original code", low=1)
    exact: bool = param(True, "1", "exact", source="ours: right")
    way: float = param(1.0, "m", "way", source="ours: no bound of its own", low=0.0)
    mode: str = param("a", "1", "mode", source="ours: two ways", choices=("a", "b"))


def test_presets():
    assert Example.preset().cell == 0.05
    assert Example.preset("original").cell == 0.1
    assert Example.presets() == ["default", "original"]
    with pytest.raises(LookupError, match="'orignal'; expected one of default, original"):
        Example.preset("orignal")


def test_int_becomes_float_and_text_is_read():
    p = Example(cell=1).replace(steps="7", exact="false", mode="b", cell="2e-2")
    assert (p.cell, p.steps, p.exact, p.mode) == (0.02, 7, False, "b")
    assert isinstance(Example(cell=1).cell, float)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"cell": 2.0}, r"parameter 'cell': got 2.0, expected 0.01 to 1 \[m\]"),
        ({"cell": float("nan")}, "parameter 'cell': got nan"),
        ({"cell": "wide"}, "parameter 'cell': got 'wide', expected float"),
        ({"cell": True}, "parameter 'cell': got True"),
        ({"steps": 2.5}, "parameter 'steps': got 2.5, expected int"),
        ({"steps": 0}, r"parameter 'steps': got 0, expected 1 to 1e[+]06"),
        ({"steps": 100_000_000}, r"'steps': got 100000000, expected 1 to 1e[+]06 \[1\]"),
        ({"way": float("inf")}, r"'way': got inf, expected 0 to 1000 \[m\]"),
        ({"way": "1e300"}, r"'way': got 1e[+]300, expected 0 to 1000 \[m\]"),
        ({"seed": 2**65}, r"'seed': got 3\d*, expected 0 to 1.84467e[+]19"),
        ({"exact": 1}, "parameter 'exact': got 1, expected bool"),
        ({"mode": "c"}, "parameter 'mode': got 'c', expected one of a, b"),
        ({"mode": 3}, "parameter 'mode': got 3, expected str"),
    ],
)
def test_a_bad_value_gets_one_clear_sentence(change, sentence):
    with pytest.raises(ValueError, match=sentence):
        Example().replace(**change)


def test_an_unknown_name_names_its_neighbor():
    with pytest.raises(LookupError, match="unknown parameter 'cel'; did you mean 'cell'"):
        Example().replace(cel=1.0)


def test_yaml(tmp_path):
    file = tmp_path / "p.yaml"
    file.write_text("cell: 0.2\nmode: b\n")
    assert Example().with_yaml(file).cell == 0.2
    file.write_text("")
    assert Example().with_yaml(file) == Example()
    file.write_text("- 1\n")
    with pytest.raises(ValueError, match="expected lines 'name: value'"):
        Example().with_yaml(file)
    file.write_text("a: [1")
    with pytest.raises(ValueError, match="not a YAML file"):
        Example().with_yaml(file)


def test_table_and_unit():
    names = [row[0] for row in Example().table()]
    assert names == ["seed", "cell", "steps", "exact", "way", "mode"]
    with pytest.raises(ValueError, match="unit 'mm'"):
        param(1.0, "mm", "x", source="y")


def test_only_what_is_declared_a_switch_is_one():
    @dataclass(frozen=True)
    class Switched(Example):
        part: bool = param(False, "1", "a mechanism", source="ours: a part", switch=True)

    assert Example.switches() == []  # `exact` is on or off, and no mechanism
    assert Switched.switches() == ["part"]
    with pytest.raises(ValueError, match=r"switch: got the default 0\.5, expected True or False"):
        param(0.5, "1", "x", source="y", switch=True)


@dataclass(frozen=True)
class OnSensors(Example):
    SENSORS = {"lds01": {"cell": 0.2}, "mine": {"steps": 9}}


def test_a_sensor_changes_what_it_says_on_top_of_any_preset():
    assert OnSensors().for_sensor("lds01").cell == 0.2
    p = OnSensors.preset("original").for_sensor("mine")
    assert (p.cell, p.mode, p.steps) == (0.1, "b", 9)
    assert OnSensors().for_sensor("utm30lx") == OnSensors()
    with pytest.raises(LookupError, match=r"unknown sensor 'lds03'; did you mean 'lds0[12]'.*mine"):
        OnSensors().for_sensor("lds03")
