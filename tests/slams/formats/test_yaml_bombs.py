"""YAML and launch files of a few lines that would grow without end: refused at once."""

import tracemalloc

import pytest

from slams.formats import occupancy
from slams.params import Params
from slams.ros.launch import read_node

MUCH = 32 << 20  # bytes that a refusal may take
NODE = '<node pkg="gmapping" type="slam_gmapping" name="s">{}</node>'
NODES, KNOWN = ("gmapping", "slam_gmapping"), ("delta", "particles")


def lists(levels, last="x" * 100):
    """Each line holds the one before it nine times."""
    lines = [f"a0: &a0 [{', '.join([last] * 9)}]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, levels)]
    return "\n".join(lines) + "\n"


def merges(levels):
    """The same by merge keys, which grow while the file is read."""
    lines = ["a0: &a0 {delta: 0.1}"]
    lines += [f"a{k}: &a{k} {{<<: [{', '.join([f'*a{k - 1}'] * 9)}]}}" for k in range(1, levels)]
    return "\n".join(lines) + "\n"


def blocks(levels):
    """A mapping in a mapping, by the indent."""
    return "".join(f"{' ' * k}k:\n" for k in range(levels))


BOMBS = {
    "lists": lists(8),
    "merges": merges(8),
    "itself": "delta: &a [*a, *a]\n",
    "its own key": "delta: &a {x: *a}\n",
    "long words": f"w: &w {'x' * 10_000}\n" + "".join(f"k{k}: *w\n" for k in range(200)),
    "blocks": blocks(400),
    "brackets": "delta: " + "[" * 5000,
    "flow": "delta: " + "{a: " * 3000,
    "too long": "a: 1\n" * 100_000,
}


def refused(work, path):
    """The sentence of a refusal that took little memory."""
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=path.name) as caught:
            work()
        assert tracemalloc.get_traced_memory()[1] < MUCH
    finally:
        tracemalloc.stop()
    assert len(str(caught.value).splitlines()) == 1
    assert len(str(caught.value)) < 1000
    return str(caught.value)


@pytest.mark.parametrize("bomb", BOMBS)
@pytest.mark.parametrize("reader", ["params", "ros", "rosparam", "map", "image"])
def test_a_yaml_file_does_not_grow(reader, bomb, tmp_path):
    text, path = BOMBS[bomb], tmp_path / "file.yaml"
    if reader == "rosparam":
        text = f"<launch>{NODE.format(f'<rosparam>{text}</rosparam>')}</launch>"
    if reader == "image":
        last = "a7" if bomb in ("lists", "merges") else "w" if bomb == "long words" else "delta"
        text = f"{text}resolution: 0.1\norigin: [0, 0, 0]\nimage: *{last}\n"
    path.write_text(text)
    work = {
        "params": lambda: Params().with_yaml(path),
        "map": lambda: occupancy.read_map(path),
        "image": lambda: occupancy.read_map(path),
    }
    refused(work.get(reader, lambda: read_node(path, NODES, KNOWN)), path)


def test_an_alias_is_refused_as_ros_2_does(tmp_path):
    path = tmp_path / "file.yaml"
    path.write_text("usual: &u {delta: 0.1}\nslam_gmapping: {<<: *u, particles: 8}\n")
    with pytest.raises(ValueError, match=r"it has an alias .*; write the value there"):
        read_node(path, NODES, KNOWN)


def launch(*lines):
    node = (
        '<node pkg="gmapping" type="slam_gmapping" name="s"><param name="delta" value="1"/></node>'
    )
    return "\n".join(["<launch>", *lines, node, "</launch>"])


def doubling(levels):
    return launch(
        '<arg name="a0" default="xxxxxxxxxxxxxxxx"/>',
        *(f'<arg name="a{k}" default="$(arg a{k - 1})$(arg a{k - 1})"/>' for k in range(1, levels)),
    )


def all_at_once():
    return launch(
        f'<arg name="a" default="{"x" * 50_000}"/>',
        f'<arg name="b" default="{"$(arg a)" * 20_000}"/>',
    )


def one_by_one():
    long = f'<arg name="a" default="{"x" * 100_000}"/>'
    return launch(long, *(f'<arg name="b{k}" default="$(arg a)"/>' for k in range(3000)))


def in_groups():
    long = f'<arg name="a" default="{"x" * 100_000}"/>'
    group = '<group ns="$(arg a)"><param name="x" value="$(arg a)"/></group>'
    return launch(long, *[group] * 1500)


@pytest.mark.parametrize(
    "text",
    [doubling(26), doubling(200), all_at_once(), one_by_one(), in_groups()],
    ids=["26 levels", "200 levels", "at once", "one by one", "in groups"],
)
def test_a_launch_file_does_not_grow(text, tmp_path):
    path = tmp_path / "x.launch"
    path.write_text(text)
    assert "longer than" in refused(lambda: read_node(path, NODES, KNOWN), path)


def test_arguments_as_people_use_them(tmp_path):
    path = tmp_path / "x.launch"
    path.write_text(doubling(8))
    assert read_node(path, NODES, KNOWN).values == {"delta": 1}
