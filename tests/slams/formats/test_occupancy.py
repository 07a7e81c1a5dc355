"""Maps and pictures of them: what is written, what other programs write, what is refused."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from slams.formats import occupancy
from slams.formats.occupancy import picture, trinary
from slams.types import OccupancyGrid


def a_map(tmp_path, pixels, **changes):
    cv2.imwrite(str(tmp_path / "m.png"), np.array(pixels, np.uint8))
    entries = {
        "image": "m.png",
        "resolution": 0.1,
        "origin": [1.0, 2.0, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    } | changes
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(entries))
    return tmp_path / "m.yaml"


def cells(path, notes=None):
    return occupancy.read_map(path, notes).p.tolist()


def same(found, expected):
    assert np.array(found) == pytest.approx(np.array(expected), nan_ok=True, abs=1e-6)


def test_trinary_maps(tmp_path):
    same(cells(a_map(tmp_path, [[0, 254], [205, 100]])), [[np.nan, np.nan], [1, 0]])
    same(cells(a_map(tmp_path, [[0, 254, 50]], negate=1)), [[0, 1, np.nan]])
    same(cells(a_map(tmp_path, [[30, 128, 220]])), [[1, np.nan, 0]])  # as cartographer has them


HEADS = {
    "slam_toolbox": "image: map.pgm\nmode: trinary\nresolution: 0.05\norigin: [-1.5, -2, 0]\n"
    "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n",
    "cartographer": "image: map.pgm\nresolution: 0.050000\norigin: [-1.500000, -2.000000, 0.0]\n"
    "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
    "map_saver": "image: {folder}/map.pgm\nresolution: 0.050000\n"
    "origin: [-1.500000, -2.000000, 0.000000]\nnegate: 0\noccupied_thresh: 0.65\n"
    "free_thresh: 0.196\n\n",
}


@pytest.mark.parametrize("program", HEADS)
def test_maps_that_other_programs_save(program, tmp_path):
    comment = b"# CREATOR: map_saver.cpp 0.050 m/pix\n"
    (tmp_path / "map.pgm").write_bytes(b"P5\n" + comment + b"3 2\n255\n" + bytes([0, 254, 205] * 2))
    (tmp_path / "map.yaml").write_text(HEADS[program].format(folder=tmp_path))
    grid = occupancy.read_map(tmp_path / "map.yaml")
    same(grid.p, [[1, 0, np.nan]] * 2)
    assert (grid.resolution, grid.origin) == (0.05, (-1.5, -2.0))


def test_colors_are_averaged(tmp_path):
    same(cells(a_map(tmp_path, [[[0, 0, 255], [255, 255, 255]]])), [[1, 0]])


@pytest.mark.parametrize("negate", [0, 1])
def test_the_trap_of_the_old_threshold_is_told_and_avoided(negate, tmp_path):
    def pixels(*grays):
        return [[255 - gray if negate else gray for gray in grays]]

    trap, notes = {"free_thresh": 0.25, "negate": negate}, []
    same(cells(a_map(tmp_path, pixels(0, 254, 205), **trap), notes), [[1, 0, np.nan]])
    assert "make the gray of unknown cells (205) free; they are taken as unknown all" in notes[0]
    notes.clear()
    cells(a_map(tmp_path, [[0, 254]], free_thresh=0.25), notes)
    cells(a_map(tmp_path, [[0, 254, 205]]), notes)
    assert notes == []


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"origin": [0.0, 0.0, 0.5]}, "origin 0, 0, 0.5, .* expected .* yaw 0"),
        ({"origin": 3}, "not a number"),
        ({"origin": [0.0]}, "not a number"),
        ({"origin": ["a", 0.0]}, "not a number"),
        ({"negate": math.inf}, "not a number"),
        ({"resolution": 10**400}, "not a number"),
        ({"free_thresh": math.nan}, "thresholds 0.65, nan; expected"),
        ({"mode": "scale"}, "mode: got scale, expected trinary; save it"),
        ({"resolution": 0.0}, "resolution 0, .* expected a resolution above 0"),
        ({"resolution": "fine"}, "not a number"),
        ({"image": "none.png"}, "no such picture"),
        ({"image": "m.yaml"}, "not a picture"),
    ],
)
def test_other_maps_are_refused(changes, sentence, tmp_path):
    path = a_map(tmp_path, [[0, 254]], **changes)
    with pytest.raises((ValueError, OSError), match=sentence) as caught:
        occupancy.read_map(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("- 1\n- 2\n", "expected the yaml of a map"),
        ("image: none.pgm\n", "no resolution, origin; expected the yaml of a map"),
        ("made: 2024-99-99\n", "m.yaml: not a YAML file .month must be in"),
        (b"\xff\xfe", "m.yaml: not text"),
    ],
)
def test_a_yaml_that_is_no_map(text, sentence, tmp_path):
    Path(tmp_path / "m.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=sentence):
        occupancy.read_map(tmp_path / "m.yaml")


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"P5\n100000 100000\n255\n0000",  # OpenCV refuses the size by an error of its own
        b"P5\n3 4\n255\n00000",
        b"\x89PNG\r\n\x1a\n00000",
    ],
)
def test_a_picture_that_is_none_is_one_sentence(content, tmp_path, capfd):
    (tmp_path / "m.pgm").write_bytes(content)
    with pytest.raises(ValueError, match=r"m\.pgm: not a picture; expected pgm"):
        occupancy.read_picture(tmp_path / "m.pgm")
    with pytest.raises(OSError, match="No such file") as caught:
        occupancy.read_picture(tmp_path / "none.pgm")
    assert caught.value.filename == str(tmp_path / "none.pgm")
    assert capfd.readouterr().err == ""


def test_a_map_without_cells_is_not_written(tmp_path):
    with pytest.raises(OSError, match="could not be written"):
        occupancy.write_map(tmp_path, OccupancyGrid(np.zeros((0, 0), np.float32), 0.1, (0.0, 0.0)))


def test_the_highest_y_is_on_top_and_the_path_lies_in_the_map(tmp_path):
    p = np.full((20, 10), np.nan, np.float32)
    p[0], p[-1] = 1.0, 0.0
    grid = OccupancyGrid(p, 0.1, (0.0, 0.0))
    assert trinary(grid)[:, 0].tolist() == [254, *18 * [205], 0]
    path = np.array([(0.5, y, 0.0) for y in np.linspace(0.3, 0.8, 20)])
    image = picture(grid, path, least=200).astype(int)
    drawn = np.abs(image[:, :, 2] - image[:, :, 0]).max(axis=1) > 60
    rows = np.flatnonzero(drawn) / image.shape[0]  # 0 on top, where y is 2
    assert rows.min() > 0.5 and rows.max() < 1.0
