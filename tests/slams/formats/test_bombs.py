"""Small files that claim to be, or become, very large: refused before memory is taken for them."""

import gzip
import io
import tracemalloc
import zipfile

import numpy as np
import pytest

import slams
from slams.formats import occupancy, packed, trajectory
from slams.params import Params
from slams.ros.launch import read_node
from tests.bags import MUCH, cheaply_refused, refused
from tests.rooms import drive
from tests.slams.ros.test_ros_params import KNOWN, NODE, NODES

ROOM, HUGE = 8 << 20, 96 << 20  # bytes


@pytest.fixture(autouse=True)
def _small_room(monkeypatch):
    monkeypatch.setattr(packed, "MIN_UNPACKED_LIMIT", ROOM)


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "log.npz"
    drive(n=20).save(path)
    return path


def replace_member(path, name, content, mode=zipfile.ZIP_DEFLATED):
    """The same npz, but for one array's bytes."""
    with zipfile.ZipFile(path) as archive:
        kept = {key: archive.read(key) for key in archive.namelist() if key != name}
    with zipfile.ZipFile(path, "w", mode, compresslevel=1) as archive:
        for key, value in kept.items():
            archive.writestr(key, value)
        with archive.open(name, "w") as member:
            for part in content:
                member.write(part)


def header(shape, descr="<f4"):
    file = io.BytesIO()
    given = {"shape": shape, "fortran_order": False, "descr": descr}
    np.lib.format.write_array_header_1_0(file, given)
    return file.getvalue()


@pytest.mark.parametrize(
    ("name", "shape", "descr"),
    [("ranges", shape, "<f4") for shape in [(20, 1_250_000_000), (10**12, 0), (10**30,), (-1, 5)]]
    + [("meta", (), "<U25000000000")],
)
def test_an_array_that_claims_another_size_than_it_has(name, shape, descr, log):
    replace_member(log, f"{name}.npy", [header(shape, descr), bytes(4000)])
    refused(log)


def test_a_text_that_is_nested_deep(log):
    deep = np.array(100_000 * "[" + 100_000 * "]")
    replace_member(log, "meta.npy", [header((), f"<U{200_000}"), deep.tobytes()])
    sentence = cheaply_refused(lambda: slams.load(log), log)
    assert "meta: got other text, expected a JSON object" in sentence


def test_an_array_that_unpacks_to_a_thousand_times_its_size(log):
    zeros = [bytes(1 << 20)] * (HUGE >> 20)
    replace_member(log, "ranges.npy", [header((16, HUGE // 64)), *zeros])
    assert "unpacks to 0.1 GB" in cheaply_refused(lambda: slams.load(log), log)


def test_what_no_log_has_is_not_unpacked(log):
    whole = slams.load(log)
    replace_member(log, "more.npy", [header((HUGE // 4,)), *[bytes(1 << 20)] * (HUGE >> 20)])
    tracemalloc.start()
    assert len(slams.load(log)) == len(whole)
    assert tracemalloc.get_traced_memory()[1] < MUCH
    tracemalloc.stop()


def test_a_calm_log_that_packs_well_is_read(tmp_path):
    log = drive(n=20)
    calm = np.full((2000, 361), np.inf, np.float32)
    slams.ScanLog(np.arange(2000) / 40.0, calm, log.laser).save(tmp_path / "calm.npz")
    assert len(slams.load(tmp_path / "calm.npz")) == 2000


@pytest.mark.parametrize("flag", ["locked", "method"])
def test_a_packing_that_cannot_be_undone_is_said(flag, log):
    data = bytearray(log.read_bytes())
    entry = data.rindex(b"PK\x01\x02", 0, data.index(b"ranges.npy", data.index(b"PK\x01\x02")))
    local = data.index(b"ranges.npy") - 30
    for place in (local + 6, entry + 8):
        data[place if flag == "locked" else place + 2] = 1 if flag == "locked" else 14  # lzma
    log.write_bytes(data)
    cheaply_refused(lambda: slams.load(log), log)


def test_packed_text_that_becomes_a_hundred_times_as_long(tmp_path):
    line = b"ODOM 0 0 0.1 0 0 0 100.0 h 0\n"
    path = tmp_path / "drive.log.gz"
    with gzip.open(path, "wb") as file:
        for _ in range(HUGE >> 20):
            file.write(line * ((1 << 20) // len(line)))
    assert "unpacks to 0.0 GB" in cheaply_refused(lambda: slams.load(path), path)
    assert "unpacks to 0.0 GB" in cheaply_refused(lambda: trajectory.read(path), path)


def test_recordings_unpack_to_fifty_times_their_size_and_no_more():
    packed.check_growth("a.gz", 1 << 20, 50 << 20)
    with pytest.raises(ValueError, match=r"a\.gz: unpacks to"):
        packed.check_growth("a.gz", 1 << 20, (50 << 20) + 1)


LONG = f'<arg name="a" default="{"x" * 100_000}"/>'
GROUP = '<group ns="$(arg a)"><param name="x" value="1"/></group>'


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
    "namespaces": launch(LONG, *[GROUP] * 1500),
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
