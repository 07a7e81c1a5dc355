"""YAML and launch files of a few lines that would grow without end: refused at once."""

import pytest

from slams.formats import occupancy
from slams.params import Params
from slams.ros.launch import read_node
from tests.bags import cheaply_refused

NODES, KNOWN = ("gmapping", "slam_gmapping"), ("delta", "particles")
NODE = '<node pkg="gmapping" type="slam_gmapping" name="s">{}</node>'
LONG = f'<arg name="a" default="{"x" * 100_000}"/>'


def levels(first, each, n):
    """A line and n that hold the one before them nine times."""
    lines = [each.format(k=k, below=", ".join([f"*a{k - 1}"] * 9)) for k in range(1, n)]
    return "\n".join([first, *lines]) + "\n"


def launch(*lines):
    node = NODE.format('<param name="delta" value="1"/>')
    return "\n".join(["<launch>", *lines, node, "</launch>"])


def doubling(n):
    twice = '<arg name="a{}" default="$(arg a{})$(arg a{})"/>'
    first = '<arg name="a0" default="xxxxxxxxxxxxxxxx"/>'
    return launch(first, *(twice.format(k, k - 1, k - 1) for k in range(1, n)))


YAML = {
    "lists": levels(f"a0: &a0 [{', '.join(['x' * 100] * 9)}]", "a{k}: &a{k} [{below}]", 8),
    "merges": levels("a0: &a0 {delta: 0.1}", "a{k}: &a{k} {{<<: [{below}]}}", 8),
    "itself": "delta: &a [*a, *a]\n",
    "long words": f"w: &w {'x' * 10_000}\n" + "".join(f"k{k}: *w\n" for k in range(200)),
    "blocks": "".join(f"{' ' * k}k:\n" for k in range(400)),
    "brackets": "delta: " + "[" * 600,
    "flow": "delta: " + "{a: " * 600,
    "too long": "a: 1\n" * 100_000,
}
LAUNCH = {
    "entities": '<!DOCTYPE l [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><launch>&b;</launch>',
    "groups": "<launch>" + "<group>" * 5000 + "</group>" * 5000 + "</launch>",
    "26 levels": doubling(26),
    "200 levels": doubling(200),
    "at once": launch(LONG, f'<arg name="b" default="{"$(arg a)" * 10_000}"/>'),
    "one by one": launch(LONG, *(f'<arg name="b{k}" default="$(arg a)"/>' for k in range(3000))),
    "namespaces": launch(
        LONG, *['<group ns="$(arg a)"><param name="x" value="1"/></group>'] * 1500
    ),
}
REASONS = {"entities": "no <!DOCTYPE", "groups": "nested too deeply"}


@pytest.mark.parametrize("bomb", YAML)
@pytest.mark.parametrize("reader", ["params", "ros", "rosparam", "map"])
def test_a_yaml_file_does_not_grow(reader, bomb, tmp_path):
    text, path = YAML[bomb], tmp_path / "file.yaml"
    if reader == "rosparam":
        text = f"<launch>{NODE.format(f'<rosparam>{text}</rosparam>')}</launch>"
    path.write_text(text)
    work = {"params": lambda: Params().with_yaml(path), "map": lambda: occupancy.read_map(path)}
    cheaply_refused(work.get(reader, lambda: read_node(path, NODES, KNOWN)), path)


def test_an_alias_is_refused_as_ros_2_does(tmp_path):
    path = tmp_path / "file.yaml"
    path.write_text("usual: &u {delta: 0.1}\nslam_gmapping: {<<: *u, particles: 8}\n")
    with pytest.raises(ValueError, match=r"it has an alias .*; write the value there"):
        read_node(path, NODES, KNOWN)


@pytest.mark.parametrize("bomb", LAUNCH)
def test_a_launch_file_does_not_grow(bomb, tmp_path):
    path = tmp_path / "x.launch"
    path.write_text(LAUNCH[bomb])
    reason = REASONS.get(bomb, "longer than")
    assert reason in cheaply_refused(lambda: read_node(path, NODES, KNOWN), path)


def test_arguments_as_people_use_them(tmp_path):
    path = tmp_path / "x.launch"
    path.write_text(doubling(8))
    assert read_node(path, NODES, KNOWN).values == {"delta": 1}
