"""Maps: the pgm + yaml pair of map_server and nav2, and pictures to look at."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from slams.types import Floats, OccupancyGrid

OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196  # 205 = unknown must not load as free
FREE, OCCUPIED, UNKNOWN = 254, 0, 205
PATH_COLOR, START_COLOR = (60, 76, 231), (96, 174, 39)  # red, green in OpenCV's order

Pixels = NDArray[np.uint8]


def write_map(folder: str | Path, grid: OccupancyGrid) -> None:
    """Write map.pgm and map.yaml; trinary, loads in map_server and nav2.

    Row 0 of the picture is the highest y; the yaml's origin is the lower left corner.
    """
    folder = Path(folder)
    _write_image(folder / "map.pgm", trinary(grid))
    entries = {
        "image": "map.pgm",
        "mode": "trinary",
        "resolution": float(grid.resolution),
        "origin": [float(grid.origin[0]), float(grid.origin[1]), 0.0],
        "negate": 0,
        "occupied_thresh": OCCUPIED_THRESH,
        "free_thresh": FREE_THRESH,
    }
    text = yaml.safe_dump(entries, sort_keys=False, default_flow_style=None)
    (folder / "map.yaml").write_text(text, encoding="utf-8")


def read_map(path: str | Path) -> OccupancyGrid:
    """Read a map_server yaml with its picture: p 1 occupied, 0 free, nan unknown.

    Raises:
        OSError: the yaml or its picture cannot be read.
        ValueError: the yaml is not a map's.
    """
    path = Path(path)
    try:
        entries = yaml.safe_load(path.read_text(encoding="utf-8"))
        resolution, origin = float(entries["resolution"]), entries["origin"]
        image = _read_image(path.parent / entries["image"])
        shade = image.astype(np.float64) / 255.0
        occupancy = shade if entries.get("negate", 0) else 1.0 - shade
        high, low = float(entries["occupied_thresh"]), float(entries["free_thresh"])
    except (yaml.YAMLError, KeyError, TypeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: not the yaml of a map ({error})") from error
    p = np.full(image.shape, np.nan, np.float32)
    p[occupancy > high] = 1.0
    p[occupancy < low] = 0.0
    return OccupancyGrid(p[::-1].copy(), resolution, (float(origin[0]), float(origin[1])))


def trinary(grid: OccupancyGrid) -> Pixels:
    """The map as map_server's grays, row 0 on top: free 254, occupied 0, unknown 205."""
    pixels = np.full(grid.p.shape, UNKNOWN, np.uint8)
    pixels[grid.p > 0.5] = OCCUPIED
    pixels[grid.p < 0.5] = FREE
    return pixels[::-1].copy()


def picture(grid: OccupancyGrid, poses: Floats | None = None, least: int = 900) -> Pixels:
    """The map as probabilities in gray with the path in red, its start green: (h, w, 3) BGR.

    poses (n, 3) in the map frame; enlarged by a whole factor to about `least` pixels.
    """
    import cv2

    gray = np.where(np.isnan(grid.p), UNKNOWN, 255.0 * (1.0 - grid.p)).astype(np.uint8)[::-1]
    factor = max(1, round(least / max(gray.shape)))
    large = gray.repeat(factor, axis=0).repeat(factor, axis=1)
    image = np.ascontiguousarray(np.stack([large] * 3, axis=2))
    if poses is not None and len(poses):
        scale = factor / grid.resolution
        x = (poses[:, 0] - grid.origin[0]) * scale
        y = image.shape[0] - (poses[:, 1] - grid.origin[1]) * scale
        points = np.round(np.stack([x, y], axis=1) * 16).astype(np.int32)  # 4 bits of a pixel
        cv2.polylines(image, [points], False, PATH_COLOR, max(1, factor), cv2.LINE_AA, 4)
        start = (int(points[0, 0]), int(points[0, 1]))
        cv2.circle(image, start, 16 * max(4, 2 * factor), START_COLOR, -1, cv2.LINE_AA, 4)
    return image


def write_picture(path: str | Path, grid: OccupancyGrid, poses: Floats | None = None) -> None:
    """Write `picture` as png."""
    _write_image(Path(path), picture(grid, poses))


def _write_image(path: Path, pixels: Pixels) -> None:
    import cv2

    if not cv2.imwrite(str(path), pixels):
        raise OSError(f"{path}: the picture could not be written")


def _read_image(path: Path) -> Pixels:
    import cv2

    if not path.is_file():
        raise FileNotFoundError(f"{path}: there is no such picture; the yaml names it")
    pixels = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if pixels is None:
        raise ValueError(f"{path}: not a picture")
    return pixels.astype(np.uint8)
