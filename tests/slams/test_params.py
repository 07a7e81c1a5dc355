"""Parameters, poses, lasers and scans."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slams.geometry import inverse3, solve3
from slams.geometry import wrap_angle as compiled
from slams.params import Params, param
from slams.types import IDENTITY, Pose2, Scan, wrap_angle
from tests.rooms import laser


@dataclass(frozen=True)
class Example(Params):
    PRESETS = {"original": {"cell": 0.1, "mode": "b"}}

    cell: float = param(0.05, "m", "cell", source="paper, Table 1", low=0.01, high=1.0)
    steps: int = param(5, "1", "steps", source="original code", low=1)
    exact: bool = param(True, "1", "exact", source="ours: right")
    way: float = param(1.0, "m", "way", source="ours: no bound of its own", low=0.0)
    mode: str = param("a", "1", "mode", source="ours: two ways", choices=("a", "b"))


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
        ({"way": float("inf")}, r"'way': got inf, expected 0 to 1000 \[m\]"),
        ({"seed": 2**65}, r"'seed': got 3\d*, expected 0 to 1.84467e[+]19"),
        ({"exact": 1}, "parameter 'exact': got 1, expected bool"),
        ({"mode": "c"}, "parameter 'mode': got 'c', expected one of a, b"),
        ({"mode": 3}, "parameter 'mode': got 3, expected str"),
    ],
)
def test_a_bad_value_gets_one_clear_sentence(change, sentence):
    with pytest.raises(ValueError, match=sentence):
        Example().replace(**change)


def test_yaml(tmp_path):
    file = tmp_path / "p.yaml"
    file.write_text("cell: 0.2\nmode: b\n")
    assert Example().with_yaml(file).cell == 0.2
    file.write_text("")
    assert Example().with_yaml(file) == Example()
    for text, sentence in (("- 1\n", "expected lines 'name: value'"), ("a: [1", "not a YAML file")):
        file.write_text(text)
        with pytest.raises(ValueError, match=sentence):
            Example().with_yaml(file)


def test_a_unit_that_nobody_knows_is_refused():
    with pytest.raises(ValueError, match="unit 'mm'"):
        param(1.0, "mm", "x", source="y")


def test_only_what_is_declared_a_switch_is_one():
    @dataclass(frozen=True)
    class Switched(Example):
        part: bool = param(False, "1", "a mechanism", source="ours: a part", switch=True)

    assert not any(spec.switch for spec in Example.specs().values())  # nor is `exact`, on or off
    assert [name for name, spec in Switched.specs().items() if spec.switch] == ["part"]
    with pytest.raises(ValueError, match=r"switch: got the default 0\.5, expected True or False"):
        param(0.5, "1", "x", source="y", switch=True)


@dataclass(frozen=True)
class OnSensors(Example):
    SENSORS = {"lds01": {"cell": 0.2}, "mine": {"steps": 9}}


def test_a_sensor_changes_what_it_says_on_top_of_any_preset():
    assert OnSensors().for_sensor("lds01").cell == 0.2
    p = OnSensors(**OnSensors.PRESETS["original"]).for_sensor("mine")
    assert (p.cell, p.mode, p.steps) == (0.1, "b", 9)
    assert OnSensors().for_sensor("utm30lx") == OnSensors()
    with pytest.raises(LookupError, match=r"unknown sensor 'lds03'; did you mean 'lds0[12]'.*mine"):
        OnSensors().for_sensor("lds03")


number = st.floats(-50.0, 50.0)
poses = st.builds(Pose2, number, number, st.floats(-math.pi, math.pi))


def close(a, b):
    turn = wrap_angle(a.theta - b.theta)
    return math.hypot(a.x - b.x, a.y - b.y) < 1e-9 and abs(turn) < 1e-9


@given(poses, poses)
def test_inverse_undoes_and_between_is_the_step_to_the_other(a, b):
    assert close(a @ a.inverse(), IDENTITY)
    assert close(a.inverse() @ a, IDENTITY)
    assert close(a @ a.between(b), b)
    assert close(a.between(b), a.inverse() @ b)


def test_composition_by_hand():
    found = Pose2(1.0, 2.0, math.pi / 2) @ Pose2(3.0, 0.0, 0.1)
    assert close(found, Pose2(1.0, 5.0, math.pi / 2 + 0.1))


def test_transform_moves_points_like_poses():
    pose = Pose2(1.0, -2.0, 0.7)
    moved = pose.transform(np.array([[3.0, 4.0]]))[0]
    expected = pose @ Pose2(3.0, 4.0, 0.0)
    assert moved == pytest.approx([expected.x, expected.y])


def test_poses_do_not_add():
    with pytest.raises(TypeError, match="compose with @"):
        IDENTITY + IDENTITY


@given(st.floats(-1000.0, 1000.0) | st.integers(-9, 9).map(lambda halves: halves * math.pi))
def test_wrap_angle_stays_in_range_and_keeps_the_direction(angle):
    wrapped = wrap_angle(angle)
    assert compiled(angle) == wrapped
    assert -math.pi < wrapped <= math.pi + 1e-12
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


def test_wrap_angle_of_arrays_and_the_open_end():
    assert wrap_angle(np.array([-math.pi, math.pi, 3.0 * math.pi])) == pytest.approx(math.pi)
    assert wrap_angle(-math.pi) == math.pi


def test_odometry_and_heading_that_are_no_numbers_were_not_measured():
    lidar, ranges = laser(5), np.ones(5, np.float32)
    for bad in (np.nan, np.inf, -np.inf):
        for k in range(3):
            pose = Pose2(*(bad if i == k else 1.0 for i in range(3)))
            scan = Scan(0.0, ranges, lidar, pose, bad)
            assert scan.odometry is None
            assert scan.yaw is None
    scan = Scan(0.0, ranges, lidar, Pose2(1.0, 2.0, 3.0), 0.5)
    assert (scan.odometry, scan.yaw) == (Pose2(1.0, 2.0, 3.0), 0.5)


def test_solve3_solves_and_refuses_what_is_singular():
    rng, out = np.random.default_rng(0), np.zeros(3)
    A = rng.normal(size=(3, 3))
    H, b = A @ A.T + 0.1 * np.eye(3), rng.normal(size=3)
    assert solve3(H, b, out)
    assert out == pytest.approx(np.linalg.solve(H, b))
    for singular in (np.zeros((3, 3)), np.diag([1.0, 1.0, 0.0]), np.ones((3, 3))):
        assert not solve3(singular, b, out)
    assert not solve3(np.full((3, 3), np.nan), b, out)


@pytest.mark.parametrize("seed", range(5))
def test_the_inverse_equals_numpys(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, 1.0, (3, 3))
    A = root @ root.T + np.diag([0.1, 10.0, 1.0])
    assert inverse3(A) == pytest.approx(np.linalg.inv(A), rel=1e-9)
