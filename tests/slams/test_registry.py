import sys
import types

import pytest

from slams import registry
from slams.registry import create, find, names


def test_built_ins_resolve_and_every_one_has_a_default_preset():
    for name in names():
        entry = find(name)
        assert entry.preset == "default"
        assert entry.params() == entry.cls.Params()


def test_presets_of_a_name():
    entry = find("hector@original")
    assert entry.params().levels == 2
    with pytest.raises(LookupError, match="hector has no preset 'orig'; expected one of default"):
        find("hector@orig")


@pytest.mark.parametrize("name", ["hector", "tsd", "crsm", "gmapping"])
def test_an_original_is_a_class_with_parameters_of_its_own(name):
    default, original = find(name), find(f"{name}@original")
    assert original.label == f"{name}@original"
    assert original.preset == "original"
    assert original.cls is not default.cls
    assert original.params() == original.cls.Params()
    assert not issubclass(original.cls.Params, default.cls.Params)
    assert isinstance(create(f"{name}@original", seed=3), original.cls)
    with pytest.raises(LookupError, match=rf"class of its own, {name}.original:Original; slams.fi"):
        default.cls.Params.preset("original")


def test_presets_of_an_outsider_are_values_or_a_class(outsider):
    class Params(find("odometry").cls.Params):
        PRESETS = {"lucky": {"seed": 7}, "other": "outsider:Other", "gone": "outsider:Gone"}

    class Other(outsider.Mine):
        Params = find("odometry").cls.Params

    outsider.Mine.Params, outsider.Other = Params, Other
    assert find("outsider:Mine@lucky").params().seed == 7
    assert find("outsider:Mine@lucky").cls is outsider.Mine
    assert find("outsider:Mine@other").cls is Other
    assert find("outsider:Mine@other").params() == Other.Params()
    with pytest.raises(LookupError, match="'outsider:Mine@gone': there is no 'Gone' in 'outsider'"):
        find("outsider:Mine@gone")


def test_unknown_names_name_their_neighbor():
    with pytest.raises(LookupError, match="unknown algorithm 'hecto'; did you mean 'hector'"):
        find("hecto")


@pytest.fixture
def outsider():
    module = types.ModuleType("outsider")

    class Mine:
        Params = find("odometry").cls.Params
        update = map = report = None

        def __init__(self, params):
            self.params = params

    class Foreign(Mine):
        Params = type("Settings", (), {"__module__": "outsider"})

    class Filled(Mine):
        Params = Mine.Params()

    module.Mine, module.Foreign, module.Filled, module.other = Mine, Foreign, Filled, 3
    sys.modules["outsider"] = module
    yield module
    del sys.modules["outsider"]


def test_a_class_by_module_and_name(outsider):
    assert find("outsider:Mine").cls is outsider.Mine
    assert isinstance(create("outsider:Mine", seed=3), outsider.Mine)


@pytest.mark.parametrize(
    ("name", "error", "sentence"),
    [
        ("outsider:None_", LookupError, "there is no 'None_' in 'outsider'"),
        ("no_such_module:X", LookupError, "there is no module 'no_such_module'"),
        ("outsider:other", TypeError, "outsider:other is not a SLAM algorithm"),
        (
            "outsider:Foreign",
            TypeError,
            "Foreign: its Params is <class 'outsider.Settings'>, exp",
        ),
        ("outsider:Filled", TypeError, r"Filled: its Params is BaselineParams\(seed=0, .*, expec"),
    ],
)
def test_what_is_not_an_algorithm_is_refused(outsider, name, error, sentence):
    with pytest.raises(error, match=sentence):
        find(name)


def test_an_entry_point_is_found_and_does_not_shadow_a_built_in(outsider, monkeypatch):
    from importlib.metadata import EntryPoint

    points = [
        EntryPoint("mine", "outsider:Mine", registry.GROUP),
        EntryPoint("hector", "outsider:Mine", registry.GROUP),
    ]
    monkeypatch.setattr(registry, "entry_points", lambda group: points)
    assert find("mine").cls is outsider.Mine
    assert find("hector").cls is not outsider.Mine
    assert names().count("hector") == 1
