"""Launch and parameter files as they are found in the wild."""

import pytest

from slams.ros.launch import read_node

NODES, KNOWN = ("gmapping", "slam_gmapping"), ("delta", "particles", "xmin")
NODE = '<node pkg="gmapping" type="slam_gmapping" name="slam">{}</node>'
LAUNCH = f"""<?xml version="1.0"?>
<launch>
  <arg name="fine" default="0.02"/>
  <group ns="slam" if="1"><param name="xmin" value="-5.0"/></group>
  {NODE.format('<param name="delta" value="$(arg fine)"/><rosparam>{particles: 8}</rosparam>')}
</launch>
"""


def values(tmp_path, text):
    (tmp_path / "file").write_text(text)
    return read_node(tmp_path / "file", NODES, KNOWN).values


def test_a_whole_launch_file(tmp_path):
    assert values(tmp_path, LAUNCH) == {"xmin": -5.0, "delta": 0.02, "particles": 8}


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
    with pytest.raises(ValueError, match="nested too deeply"):
        values(tmp_path, "delta: " + "[" * 600 + "]" * 600)
