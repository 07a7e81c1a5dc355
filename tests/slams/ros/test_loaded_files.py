"""Parameter files that a launch file loads, as TurtleBot3's for gmapping does."""

import json

import pytest

from slams import run
from slams.registry import find
from slams.ros import ros_params
from tests.rooms import drive

LAUNCH = """<launch>
  <arg name="set_base_frame" default="base_footprint"/>
  <arg name="file" default="gmapping_params.yaml"/>
  <node pkg="gmapping" type="slam_gmapping" name="turtlebot3_slam_gmapping" output="screen">
    <param name="base_frame" value="$(arg set_base_frame)"/>
    <rosparam command="load" file="$(find turtlebot3_slam)/config/$(arg file)" />
  </node>
</launch>
"""
ROS2 = {"other": 99, "slam_gmapping": 7}
NODE = '<node pkg="gmapping" type="slam_gmapping" name="slam_gmapping">{}</node>'
PARAMETERS = "map_update_interval: 2.0\nmaxUrange: 3.0\nsigma: 0.1\nparticles: 12\ndelta: 0.1\n"


@pytest.fixture
def package(tmp_path):
    """The package as it lies in its repository."""
    root = tmp_path / "turtlebot3_slam"
    for name in ("launch", "config"):
        (root / name).mkdir(parents=True)
    (root / "launch" / "gmapping.launch").write_text(LAUNCH)
    (root / "config" / "gmapping_params.yaml").write_text(PARAMETERS)
    return root


def take(*paths, label="gmapping"):
    entry = find(label)
    return ros_params.take(entry.params(), paths, entry.preset)


def test_the_file_of_the_same_package_is_read(package):
    taken = take(package / "launch" / "gmapping.launch")
    assert (taken.params.n_particles, taken.params.resolution) == (12, 0.1)
    loaded = package / "config" / "gmapping_params.yaml"
    assert f"read from {loaded}" in " ".join(taken.notes)


@pytest.mark.parametrize("folder", [".", "config"])
def test_a_launch_file_alone_finds_it_beside_itself(folder, tmp_path):
    (tmp_path / "config").mkdir()
    (tmp_path / "gmapping.launch").write_text(LAUNCH)
    (tmp_path / folder / "gmapping_params.yaml").write_text(PARAMETERS)
    assert take(tmp_path / "gmapping.launch").params.n_particles == 12


def test_a_file_that_is_not_there_is_refused_unless_it_is_given_too(package, tmp_path):
    launch, loaded = package / "launch" / "gmapping.launch", "config/gmapping_params.yaml"
    elsewhere = (package / loaded).rename(tmp_path / "gmapping_params.yaml")
    with pytest.raises(
        ValueError, match=r"loads .*find turtlebot3_slam.*gmapping_params"
    ) as caught:
        take(launch)
    assert "give it, too" in str(caught.value)
    assert take(launch, elsewhere).params.n_particles == 12
    assert take(elsewhere, launch).params.n_particles == 12


@pytest.mark.parametrize(
    ("text", "particles"),
    [
        ('<rosparam file="$(dirname)/p.yaml" ns="g"/>', 12),
        ('<rosparam command="load" file="{folder}/p.yaml"/>', 12),
        ('<param from="$(find-pkg-share any)/p2.yaml"/>', 7),
        ('<param name="xmin" value="9"/><rosparam file="$(find a)/p.yaml"/>', 12),
        ('<rosparam command="delete" param="x"/><param name="particles" value="9"/>', 9),
    ],
)
def test_ways_to_load(text, particles, tmp_path):
    (tmp_path / "p.yaml").write_text(PARAMETERS)
    groups = [f"{name}:\n  ros__parameters: {{particles: {n}}}\n" for name, n in ROS2.items()]
    ros2 = "".join(groups)
    (tmp_path / "p2.yaml").write_text(ros2)
    node = f"<launch>{NODE}</launch>"
    (tmp_path / "x.launch").write_text(node.format(text.replace("{folder}", str(tmp_path))))
    assert take(tmp_path / "x.launch").params.n_particles == particles


def test_what_is_loaded_around_the_node_counts_where_it_names_the_node(tmp_path):
    (tmp_path / "p.yaml").write_text("slam_gmapping: {particles: 5}\nmove_base: {delta: 3}\n")
    node = NODE.format('<param name="delta" value="0.1"/>')
    load = '<rosparam file="$(find a)/p.yaml"/><rosparam file="$(find b)/costmap.yaml"/>'
    (tmp_path / "x.launch").write_text(f"<launch>{load}{node}</launch>")
    taken = take(tmp_path / "x.launch")
    assert (taken.params.n_particles, taken.params.resolution) == (5, 0.1)
    assert any("costmap.yaml is another file" in note for note in taken.notes)


def test_a_loaded_file_that_cannot_be_read_is_named(package):
    (package / "config" / "gmapping_params.yaml").write_text("a: [1")
    with pytest.raises(ValueError, match=r"gmapping_params\.yaml: not a YAML file"):
        take(package / "launch" / "gmapping.launch")


def test_a_file_that_changes_nothing_is_refused(tmp_path):
    (tmp_path / "good.yaml").write_text(PARAMETERS)
    frames = LAUNCH.replace("<rosparam", "<unknown")
    (tmp_path / "frames.launch").write_text(frames)
    for paths in (["frames.launch"], ["good.yaml", "frames.launch"]):
        with pytest.raises(ValueError, match=r"nothing in it is taken .* gmapping") as caught:
            take(*(tmp_path / path for path in paths))
        assert str(caught.value).startswith(f"{tmp_path / 'frames.launch'}: ")
        assert "(base_frame)" in str(caught.value)


def test_what_was_done_stands_in_the_summary(package, tmp_path):
    drive(n=5).save(tmp_path / "room.npz")
    files = ["--ros-params", str(package / "launch" / "gmapping.launch")]
    out = ["--out", str(tmp_path / "out"), "-q"]
    assert run.main(["gmapping", str(tmp_path / "room.npz"), *files, *out]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["ros_params"]["files"] == files[1:]
    fates = {fate["name"]: fate["fate"] for fate in summary["ros_params"]["parameters"]}
    assert (fates["particles"], fates["base_frame"]) == ("mapped", "ignored")
    assert run.main(["gmapping", str(tmp_path / "room.npz"), *out, "--force"]) == 0
    assert "ros_params" not in json.loads((tmp_path / "out" / "summary.json").read_text())
