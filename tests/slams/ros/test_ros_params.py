"""Launch and parameter files of the originals, taken over by their ROS names."""

import math

import pytest

from slams.registry import find
from slams.ros import ros_params
from slams.ros.launch import read_node
from tests.rooms import ALGORITHMS

HECTOR_LAUNCH = """<?xml version="1.0"?>
<launch>
  <arg name="base_frame" default="base_footprint"/>
  <arg name="map_size" default="2048"/>
  <arg name="levels" value="2"/>
  <node pkg="rviz" type="rviz" name="rviz"/>
  <node pkg="hector_mapping" type="hector_mapping" name="hector_mapping" output="screen">
    <param name="map_frame" value="map" />
    <param name="base_frame" value="$(arg base_frame)" />
    <param name="use_tf_scan_transformation" value="true"/>
    <param name="use_tf_pose_start_estimate" value="false"/>
    <param name="map_resolution" value="0.050"/>
    <param name="map_size" value="$(arg map_size)"/>
    <param name="map_start_x" value="0.5"/>
    <param name="map_multi_res_levels" value="$(arg levels)" />
    <param name="update_factor_free" value="0.4"/>
    <param name="update_factor_occupied" value="0.9" />
    <param name="map_update_distance_thresh" value="0.4"/>
    <param name="map_update_angle_thresh" value="0.06" />
    <param name="scan_topic" value="scan"/>
  </node>
</launch>
"""


def wrote(tmp_path, text, name="slam.launch"):
    path = tmp_path / name
    path.write_text(text)
    return path


def take(label, *paths):
    entry = find(label)
    return ros_params.take(entry.params(), paths, entry.preset)


def fates(taken):
    return {fate.name: fate.fate for fate in taken.fates}


def test_the_originals_launch_file_is_the_original_preset(tmp_path):
    taken = take("hector@original", wrote(tmp_path, HECTOR_LAUNCH))
    assert taken.params == find("hector@original").params()
    assert "assumed" not in fates(taken).values()


def test_a_launch_file_moves_the_default_by_meaning(tmp_path):
    taken = take("hector", wrote(tmp_path, HECTOR_LAUNCH))
    p = taken.params
    assert (p.resolution, p.levels, p.insert_distance, p.insert_angle) == (0.05, 2, 0.4, 0.06)
    assert "map_size" not in p.specs()
    assert fates(taken)["map_size"] == "ignored"
    assert fates(taken)["base_frame"] == "ignored"
    text = ros_params.report(taken, "hector")
    assert "map_multi_res_levels = 2: levels = 2 [1]" in text
    assert "map_size = 2048: ignored: the map grows as needed" in text
    assert len(text.splitlines()) == 1 + 13


def test_what_a_file_leaves_out_has_the_nodes_default_in_the_original(tmp_path):
    path = wrote(tmp_path, "laser_max_dist: 10.0\n", "p.yaml")
    p = take("hector@original", path).params
    assert (p.max_range, p.resolution, p.levels, p.map_size) == (10.0, 0.025, 3, 1024)
    assert take("hector", path).params.resolution == 0.05
    taken = take("tsd@original", wrote(tmp_path, "registration_mode: 3\n", "t.yaml"))
    assert taken.params.registration == "tsd"
    assert taken.params.icp_iterations == 25
    assert fates(taken)["icp_iterations"] == "assumed"
    taken = take("tsd@original", wrote(tmp_path, "cellsize: 0.05\n", "c.yaml"))
    assert taken.params.truncation == pytest.approx(0.15)  # three cells


def test_units_are_converted(tmp_path):
    text = """slam_node:
  ros__parameters:
    truncation_radius: 3
    cellsize: 0.04
    ransac_phi_max: 45.0
    reg_sin_rot_max: 0.5
    registration_mode: 0
"""
    path = wrote(tmp_path, text, "p.yaml")
    p = take("tsd@original", path).params
    assert (p.cell, p.registration) == (0.04, "icp")
    assert p.truncation == pytest.approx(0.12)
    assert p.phi_max == pytest.approx(math.pi / 4)
    assert p.max_rotation == pytest.approx(math.pi / 6)
    taken = take("tsd", path)
    assert taken.params.truncation == pytest.approx(0.12)
    ignored = ("ransac_phi_max", "reg_sin_rot_max", "registration_mode")
    assert {fates(taken)[name] for name in ignored} == {"ignored"}


TREES = {
    "flat": "particles: 80\nlinearUpdate: 0.5\n",
    "below the node": "slam_gmapping:\n  particles: 80\n  linearUpdate: 0.5\n",
    "another name": "my_slam:\n  particles: 80\n  linearUpdate: 0.5\namcl:\n  min_particles: 5\n",
    "a path": "/robot/slam_gmapping/particles: 80\n/robot/slam_gmapping/linearUpdate: 0.5\n",
    "a dump": "robot:\n  slam_gmapping: {particles: 80, linearUpdate: 0.5}\n  amcl: {delta: 9}\n",
    "ROS 2": "/slam_gmapping:\n  ros__parameters:\n    particles: 80\n    linearUpdate: 0.5\n",
    "ROS 2, any node": "/**:\n  ros__parameters:\n    particles: 80\n    linearUpdate: 0.5\n",
    "ROS 2, two nodes": "slam_gmapping:\n  ros__parameters: {particles: 80, linearUpdate: 0.5}\n"
    "costmap:\n  ros__parameters: {delta: 3.0}\n",
    "any node, then this one": "/**:\n  ros__parameters: {particles: 5, linearUpdate: 0.5}\n"
    "slam_gmapping:\n  ros__parameters: {particles: 80}\n",
    "launch": '<launch><node pkg="gmapping" type="slam_gmapping" name="g">'
    '<param name="particles" value="80"/><rosparam>linearUpdate: 0.5</rosparam></node></launch>',
    "launch, parameters outside": '<launch><param name="g/particles" value="80"/>'
    '<rosparam ns="g">{linearUpdate: 0.5}</rosparam><param name="other/delta" value="9"/>'
    '<group ns="x"><node pkg="gmapping" type="slam_gmapping" name="g"/></group></launch>',
    "launch, conditions": '<launch><arg name="many" default="true"/>'
    '<node pkg="gmapping" exec="slam_gmapping" name="g">'
    '<param name="particles" value="80" if="$(var many)"/>'
    '<param name="particles" value="5" unless="$(arg many)"/>'
    '<rosparam param="linearUpdate">0.5</rosparam></node></launch>',
}


@pytest.mark.parametrize("tree", TREES)
def test_the_node_is_found_in_every_kind_of_file(tmp_path, tree):
    p = take("gmapping", wrote(tmp_path, TREES[tree])).params
    assert (p.n_particles, p.linear_update, p.resolution) == (80, 0.5, 0.05)


@pytest.mark.parametrize("unknown", ["$(arg n)", "$(env N)", "$(eval 3 * 4)"])
def test_substitutions_that_only_roslaunch_can_make_are_refused(unknown, tmp_path):
    inside = NODE.format(f'<param name="particles" value="{unknown}"/>')
    text = f'<launch><arg name="d" default="0.1"/>{inside}</launch>'
    sentence = r"particles = .* only roslaunch can evaluate it; write the"
    with pytest.raises(ValueError, match=sentence):
        take("gmapping", wrote(tmp_path, text))


@pytest.mark.parametrize(
    ("label", "text", "sentence"),
    [
        (
            "hector",
            "map_with_known_poses: true",
            "refused map_with_known_poses: True .there is no mapping",
        ),
        ("gmapping", "throttle_scans: 3", "refused throttle_scans: 3 .say --every"),
        ("tsd", "robot_nbr: 2", "one robot, one laser"),
        ("gmapping", "particles: many", "gmapping: particles = many: parameter 'n_particles': got"),
        ("gmapping", "delta: 99", "delta = 99: parameter 'resolution': got 99.0, expected 0.01"),
        ("tsd@original", "registration_mode: 1", "expected one of 0, 3"),
        ("tsd@original", "ransac_phi_max: wide", "expected a number"),
        ("hector", "foo: 1", "no parameter of hector_mapping"),
        ("hector", "a: {map_size: 1}\nb: {map_size: 2}", "several nodes .a, b.; keep one"),
        ("tsd", "slam_node: {r1/max_range: 1, r2/max_range: 2}", "two values of one parameter"),
        ("hector", "- 1", "expected parameters 'name: value', or a launch file"),
        ("hector", "a: [1", "not a YAML file"),
        ("hector", "a: 2001-99-99", "not a YAML file"),
        ("hector", "<launch>", "not a launch file"),
        ("hector", "<launch><node pkg='amcl'/></launch>", "no node of .*; it starts amcl"),
        ("hector", "<launch>" + 2 * "<node pkg='hector_mapping'/>" + "</launch>", "2 nodes of"),
    ],
)
def test_bad_files_get_one_clear_sentence(tmp_path, label, text, sentence):
    with pytest.raises(ValueError, match=sentence) as caught:
        take(label, wrote(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_files_that_are_none(tmp_path):
    with pytest.raises(ValueError, match="a Python launch file is a program"):
        take("hector", wrote(tmp_path, "def f(): 1", "slam.launch.py"))
    (tmp_path / "b.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="not text"):
        take("hector", tmp_path / "b.yaml")


def test_overruled_and_unknown_names_are_told(tmp_path):
    path = wrote(tmp_path, "maxUrange: 16.0\nmaxRange: 30.0\nparticels: 3\nodom_frame: o\n")
    taken = take("gmapping", path)
    assert taken.params.max_range == 16.0
    text = ros_params.report(taken, "gmapping")
    assert "maxRange = 30.0: ignored: maxUrange has priority" in text
    unknown = "ignored: not a known parameter of gmapping; did you mean particles?"
    assert f"particels = 3: {unknown}" in text
    assert "odom_frame = o: ignored: ROS plumbing" in text


@pytest.mark.parametrize("name", ALGORITHMS)
def test_every_name_of_the_mapping_is_used_once_and_told_in_the_table(name):
    table = ros_params.mapping_table(name)
    names = {}
    for label in (name, f"{name}@original"):
        cls = find(label).cls.Params
        ros, fields = cls.ROS, [alias for spec in cls.specs().values() for alias in spec.ros]
        names[label] = [*fields, *ros.original_only, *ros.ignored, *ros.refused]
        assert len(names[label]) == len(set(names[label]))
        assert set(ros.units) | set(ros.words) | set(ros.defaults) <= set(fields)
        assert "cell" not in ros.units.values() or ros.cell in cls.specs()
        for alias in names[label]:
            assert f"\n{table}".count(f"\n| `{alias}`") == 1
    assert set(names[name]) == set(names[f"{name}@original"])
    assert find(name).cls.Params.ROS.package == ros.package
    assert all(line.count("|") == 5 for line in table.splitlines())


@pytest.mark.parametrize("name", ALGORITHMS)
def test_every_mapped_name_is_taken_by_the_original(tmp_path, name):
    cls = find(f"{name}@original").cls.Params
    ros = cls.ROS
    for alias in [alias for spec in cls.specs().values() for alias in spec.ros]:
        field = next(field for field, spec in cls.specs().items() if alias in spec.ros)
        value = ros.defaults.get(alias, getattr(cls(), field))
        word = next((a for a, b in ros.words.get(alias, {}).items() if b == value), None)
        number = 0.3 if ros.units.get(alias) == "sin" else 1.5 if alias in ros.units else value
        text = str(word if word is not None else number).lower()
        if word is None and alias in ros.words:
            text = next(iter(ros.words[alias]))
        taken = take(f"{name}@original", wrote(tmp_path, f"{alias}: {text}\n"))
        assert fates(taken)[alias] == "mapped", alias


LOADING = """<launch>
  <arg name="file" default="gmapping_params.yaml"/>
  <include file="$(find a)/b.launch"/>
  <param command="xacro robot.xacro" name="robot_description"/>
  <rosparam file="$(find b)/costmap.yaml"/>
  <node pkg="gmapping" type="slam_gmapping" name="turtlebot3_slam_gmapping" output="screen">
    <param name="base_frame" value="base_footprint"/>
    <rosparam command="delete" param="x"/>
    <rosparam command="load" file="$(find turtlebot3_slam)/config/$(arg file)" />
  </node>
</launch>
"""
LOADED = "map_update_interval: 2.0\nmaxUrange: 3.0\nsigma: 0.1\nparticles: 12\ndelta: 0.1\n"


def test_a_file_that_the_node_loads_is_asked_for_and_what_others_say_is_noted(tmp_path):
    launched = wrote(tmp_path, LOADING)
    loaded = wrote(tmp_path, LOADED, "gmapping_params.yaml")
    sentence = r"loads .*find turtlebot3_slam.*gmapping_params\.yaml; giv"
    with pytest.raises(ValueError, match=sentence):
        take("gmapping", launched)
    for paths in ((launched, loaded), (loaded, launched)):
        taken = take("gmapping", *paths)
        assert (taken.params.n_particles, taken.params.resolution) == (12, 0.1)
        assert any("b.launch> is not followed" in note for note in taken.notes)
        assert any("command 'xacro robot.xacro' is not run" in note for note in taken.notes)
        assert any("costmap.yaml is another file" in note for note in taken.notes)
        assert any("command 'delete' is not run" in note for note in taken.notes)


def test_a_file_that_changes_nothing_is_refused(tmp_path):
    good = wrote(tmp_path, LOADED, "good.yaml")
    frames = wrote(tmp_path, LOADING.replace("<rosparam", "<unknown"))
    for paths in ([frames], [good, frames]):
        with pytest.raises(ValueError, match=r"nothing in it is taken .* gmapping") as caught:
            take("gmapping", *paths)
        assert str(caught.value).startswith(f"{frames}: ")
        assert "(base_frame)" in str(caught.value)


NODES, KNOWN = ("gmapping", "slam_gmapping"), ("delta", "particles", "xmin")
NODE = '<node pkg="gmapping" type="slam_gmapping" name="slam">{}</node>'


def values(tmp_path, text):
    return read_node(wrote(tmp_path, text, "file"), NODES, KNOWN).values


@pytest.mark.parametrize("name", ["~delta", "~/delta", "delta", "/slam/delta"])
def test_a_private_name_is_the_nodes_own(name, tmp_path):
    inside = NODE.format(f'<param name="{name}" value="0.1"/>')
    assert values(tmp_path, f"<launch>{inside}</launch>") == {"delta": 0.1}


def test_a_group_is_a_namespace_of_what_is_in_it(tmp_path):
    group = '<group ns="{}"><param name="delta" value="0.1"/></group>'
    for name, found in (("slam", {"delta": 0.1}), ("robot/slam", {"delta": 0.1}), ("other", {})):
        text = f"<launch>{group.format(name)}{NODE.format('')}</launch>"
        assert values(tmp_path, text) == found


def test_many_brackets_are_no_nesting(tmp_path):
    lists = "".join(f"p{k}: [0, {{a: 1}}]  # [m] in [0, 1)\n" for k in range(300))
    assert values(tmp_path, f"{lists}delta: 0.1\n")["delta"] == 0.1
