"""Pictures of maps: shades between the thresholds, and which row is on top."""

import cv2
import numpy as np
import pytest

from slams.formats.occupancy import picture, read_map, trinary
from slams.types import OccupancyGrid

YAML = "image: m.png\nresolution: 0.1\norigin: [-1.0, 2.0, 0.0]\nmode: {}\nnegate: {}\n"
LIMITS = "occupied_thresh: 0.6\nfree_thresh: 0.2\n"


def read(folder, pixels, mode="trinary", negate=0):
    cv2.imwrite(str(folder / "m.png"), np.array(pixels, np.uint8))
    (folder / "m.yaml").write_text(YAML.format(mode, negate) + LIMITS)
    return read_map(folder / "m.yaml")


def test_in_mode_scale_what_lies_between_the_thresholds_is_a_ramp(tmp_path):
    grid = read(tmp_path, [[255, 204, 153, 102, 0]], "scale")  # darkness 0, 0.2, 0.4, 0.6, 1
    assert grid.p[0] == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0], abs=1e-6)
    assert grid.origin == (-1.0, 2.0) and grid.resolution == 0.1


def test_in_mode_trinary_it_is_unknown_and_negated_maps_are_bright_where_occupied(tmp_path):
    grid = read(tmp_path, [[255, 153, 0]])
    assert grid.p[0] == pytest.approx([0.0, np.nan, 1.0], nan_ok=True)
    grid = read(tmp_path, [[255, 102, 0]], negate=1)
    assert grid.p[0] == pytest.approx([1.0, np.nan, 0.0], nan_ok=True)


def test_in_mode_raw_pixels_are_percent_and_others_unknown(tmp_path):
    grid = read(tmp_path, [[0, 50, 100, 101, 255]], "raw")
    assert grid.p[0] == pytest.approx([0.0, 0.5, 1.0, np.nan, np.nan], nan_ok=True)


def test_transparent_cells_of_a_scaled_map_are_unknown(tmp_path):
    pixels = np.full((1, 2, 4), 0, np.uint8)
    pixels[0, :, 3] = (255, 0)
    grid = read(tmp_path, pixels, "scale")
    assert grid.p[0] == pytest.approx([1.0, np.nan], nan_ok=True)


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
