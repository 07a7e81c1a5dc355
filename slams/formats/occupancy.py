"""Map files: pgm and yaml of map_server and nav2, and pictures for people."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from slams.formats import yaml_file
from slams.types import Floats, OccupancyGrid

OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196  # with 0.196 the gray 205 (unknown) is not free
FREE_PIXEL, OCCUPIED_PIXEL, UNKNOWN_PIXEL = 254, 0, 205
PATH_COLOR, START_COLOR = (60, 76, 231), (96, 174, 39)  # red, green in OpenCV's order

Pixels = NDArray[np.uint8]


def write_map(folder: str | Path, grid: OccupancyGrid) -> None:
    """Write map.pgm and map.yaml in trinary mode, for map_server and nav2.

    Row 0 of the picture is the highest y; the yaml's origin is the lower left corner.

    Raises:
        OSError: a file cannot be written, or the map has no cells.
    """
    folder = Path(folder)
    write_image(folder / "map.pgm", trinary(grid))
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


def read_map(path: str | Path, notes: list[str] | None = None) -> OccupancyGrid:
    """Read a map_server or nav2 yaml with its picture: p 1 occupied, 0 free, nan unknown.

    The mode is trinary, as map savers write it by default, negated or not. The gray that they give
    to unknown cells is unknown for any threshold. Notes for the user are added to `notes`.

    Raises:
        OSError: the yaml or its picture cannot be read.
        ValueError: the yaml is not a map's, or its map is rotated or not trinary.
    """
    path = Path(path)
    head = _read_head(path)
    if not (path.parent / head.image).is_file():
        raise FileNotFoundError(f"{path}: its picture {head.image} is not in the same folder")
    image = _read_image(path.parent / head.image)
    shade = image / 255.0
    p = _trinary(shade if head.negate else 1.0 - shade, head.occupied, head.free)
    unknown = image == (255 - UNKNOWN_PIXEL if head.negate else UNKNOWN_PIXEL)
    if head.free > (255 - UNKNOWN_PIXEL) / 255.0 and unknown.any():
        p[unknown] = np.nan  # nav2's old threshold 0.25 would make them free
        if notes is not None:
            notes.append(
                f"{path}: free_thresh {head.free:g} would make the gray of unknown cells "
                f"({UNKNOWN_PIXEL}) free; they are taken as unknown"
            )
    return OccupancyGrid(p[::-1].astype(np.float32), head.resolution, head.origin)


def read_picture(path: str | Path) -> NDArray[np.float32]:
    """A picture as a map (ny, nx), row 0 lowest y: p 1 occupied (dark), 0 free, nan between.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file is no picture.
    """
    p = _trinary(1.0 - _read_image(Path(path)) / 255.0, OCCUPIED_THRESH, FREE_THRESH)
    return p[::-1].astype(np.float32)


class MapHead(NamedTuple):
    """The entries of a map's yaml."""

    image: str
    resolution: float
    origin: tuple[float, float]
    negate: bool
    occupied: float
    free: float


def _read_head(path: Path) -> MapHead:
    entries = yaml_file.parse(yaml_file.read_text(path), path)
    values: dict[str, Any] = entries if isinstance(entries, dict) else {}
    missing = [key for key in ("image", "resolution", "origin") if key not in values]
    if missing:
        raise ValueError(f"{path}: no {', '.join(missing)}; expected the yaml of a map")
    if values.get("mode", "trinary") != "trinary":
        raise ValueError(f"{path}: mode: got {values['mode']}, expected trinary; save it as such")
    try:
        x, y, yaw = (float(value) for value in [*values["origin"], 0.0][:3])
        head = MapHead(
            str(values["image"]),
            float(values["resolution"]),
            (x, y),
            bool(int(values.get("negate", 0))),
            float(values.get("occupied_thresh", OCCUPIED_THRESH)),
            float(values.get("free_thresh", FREE_THRESH)),
        )
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{path}: an entry is not a number ({error})") from error
    numbers = (x, y, head.resolution, head.occupied, head.free)
    if yaw != 0.0 or not (head.resolution > 0.0 and np.isfinite(numbers).all()):
        raise ValueError(
            f"{path}: got resolution {head.resolution:g}, origin {x:g}, {y:g}, {yaw:g}, thresholds "
            f"{head.occupied:g}, {head.free:g}; expected a resolution above 0, yaw 0, "
            "thresholds of 0 to 1"
        )
    return head


def _trinary(occupancy: Floats, occupied: float, free: float) -> Floats:
    """Cells from darkness 0..1 and thresholds: 1 occupied, 0 free, nan between."""
    return np.where(occupancy > occupied, 1.0, np.where(occupancy < free, 0.0, np.nan))


def trinary(grid: OccupancyGrid) -> Pixels:
    """The map in map_server's grays, row 0 on top: free 254, occupied 0, unknown 205."""
    pixels = np.full(grid.p.shape, UNKNOWN_PIXEL, np.uint8)
    pixels[grid.p > 0.5] = OCCUPIED_PIXEL
    pixels[grid.p < 0.5] = FREE_PIXEL
    return pixels[::-1].copy()


def picture(grid: OccupancyGrid, poses: Floats | None = None, least: int = 900) -> Pixels:
    """The map's probabilities in gray with the path in red, its start green: (h, w, 3) BGR.

    poses (n, 3) in the map frame; enlarged by an integer factor to about `least` pixels.
    """
    import cv2

    gray = np.where(np.isnan(grid.p), UNKNOWN_PIXEL, 255.0 * (1.0 - grid.p)).astype(np.uint8)[::-1]
    factor = max(1, round(least / max(gray.shape)))
    large = gray.repeat(factor, axis=0).repeat(factor, axis=1)
    image = np.ascontiguousarray(np.stack([large] * 3, axis=2))
    if poses is not None and len(poses):
        scale = factor / grid.resolution
        x = (poses[:, 0] - grid.origin[0]) * scale
        y = image.shape[0] - (poses[:, 1] - grid.origin[1]) * scale
        points = np.round(np.stack([x, y], axis=1) * 16).astype(np.int32)  # 1/16 of a pixel
        cv2.polylines(image, [points], False, PATH_COLOR, max(1, factor), cv2.LINE_AA, 4)
        start = (int(points[0, 0]), int(points[0, 1]))
        cv2.circle(image, start, 16 * max(4, 2 * factor), START_COLOR, -1, cv2.LINE_AA, 4)
    return image


def write_image(path: Path, pixels: Pixels) -> None:
    """Write an image (h, w) or (h, w, 3) BGR in the format of the name's ending.

    Raises:
        OSError: it cannot be written, or has no pixels.
    """
    import cv2

    # not imwrite, which crashes on names that are not UTF-8
    encoded, data = cv2.imencode(path.suffix, pixels) if pixels.size else (False, pixels)
    if not encoded:
        raise OSError(f"{path}: the picture could not be written")
    path.write_bytes(data.tobytes())


def _read_image(path: Path) -> Floats:
    """Pixels (h, w) from 0 to 255, colors averaged as map_server does."""
    import cv2

    data, pixels = np.frombuffer(path.read_bytes(), np.uint8), None
    logging = cv2.utils.logging
    before = logging.setLogLevel(logging.LOG_LEVEL_SILENT)
    with suppress(cv2.error):  # an empty file, or a picture that is too large
        pixels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    logging.setLogLevel(before)
    if pixels is None:
        raise ValueError(f"{path}: not a picture; expected pgm, png or another image file")
    full = 257.0 if pixels.dtype == np.uint16 else 1.0
    image = pixels.astype(np.float64) / full
    return image[:, :, :3].mean(axis=2) if image.ndim == 3 else image
