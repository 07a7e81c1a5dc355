"""One frame of a film: the map so far, the way, the scan and the robot; a bar of whole meters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from slams.formats.occupancy import PATH_COLOR, START_COLOR, UNKNOWN, Pixels
from slams.watch.scene import Scene

if TYPE_CHECKING:
    from slams.types import Floats, OccupancyGrid

WIDTH, HEIGHT, HEAD_HEIGHT = 960, 720, 40  # pixels; HEAD_HEIGHT is the strip with the text
SCAN_COLOR, TEXT_COLOR = (200, 110, 20), (40, 40, 40)
WINDOW_STEP, MIN_WINDOW, WINDOW_MARGIN = 2.0, 8.0, 0.5  # m: the part shown grows by steps
ROBOT = np.array([[0.35, 0.0], [-0.2, 0.2], [-0.2, -0.2]])  # m: an arrow head


class Painter:
    """Draws a scene; the window grows with what was seen."""

    def __init__(self, scene: Scene) -> None:
        self.grid: OccupancyGrid | None = None
        self._scene = scene

    def frame(self, text: str) -> Pixels:
        """One picture (HEIGHT, WIDTH, 3), BGR."""
        import cv2

        scene = self._scene
        image = np.full((HEIGHT, WIDTH, 3), UNKNOWN, np.uint8)
        scale, corner = self._window()
        if self.grid is not None:
            _draw_map(image, self.grid, scale, corner)

        def _pixels(points: Floats) -> Any:
            x = (points[:, 0] - corner[0]) * scale - 0.5
            y = HEIGHT - (points[:, 1] - corner[1]) * scale - 0.5
            return np.round(np.stack([x, y], axis=1) * 16).astype(np.int32)  # 4 bits of a pixel

        way = _pixels(np.array(scene.way)[:, :2])
        cv2.polylines(image, [way], False, PATH_COLOR, 2, cv2.LINE_AA, 4)
        cv2.circle(image, tuple(way[0].tolist()), 16 * 5, START_COLOR, -1, cv2.LINE_AA, 4)
        for x, y in _pixels(scene.points).tolist():
            cv2.circle(image, (x, y), 24, SCAN_COLOR, -1, cv2.LINE_AA, 4)
        robot = ROBOT * max(1.0, 30.0 / scale)
        cv2.fillPoly(image, [_pixels(scene.pose.transform(robot))], PATH_COLOR, cv2.LINE_AA, 4)
        _draw_head(image, text, scale)
        return image

    def _window(self) -> tuple[float, Floats]:
        """Pixels per meter, and the world's point (2,) at the lower left corner."""
        low = np.floor((self._scene.low - WINDOW_MARGIN) / WINDOW_STEP) * WINDOW_STEP
        high = np.ceil((self._scene.high + WINDOW_MARGIN) / WINDOW_STEP) * WINDOW_STEP
        size = np.maximum(high - low, MIN_WINDOW)
        scale = float(min(WIDTH / size[0], (HEIGHT - HEAD_HEIGHT) / size[1]))
        shown = np.array([WIDTH, HEIGHT - HEAD_HEIGHT]) / scale
        return scale, 0.5 * (low + high) - 0.5 * shown


def _draw_map(image: Pixels, grid: OccupancyGrid, scale: float, corner: Floats) -> None:
    """Cells as gray, each pixel the cell under it (or the mean of the cells)."""
    import cv2

    p, edge = grid.p, grid.resolution
    gray = np.where(np.isnan(p), UNKNOWN, 255.0 * (1.0 - p)).astype(np.uint8)[::-1]
    zoom = edge * scale
    if zoom < 1.0:
        size = [max(1, round(n * zoom)) for n in gray.shape[::-1]]
        gray = cv2.resize(gray, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
        zoom = edge * scale * p.shape[1] / gray.shape[1]
    left = (grid.origin[0] - corner[0]) * scale
    top = HEIGHT - (grid.origin[1] - corner[1] + edge * p.shape[0]) * scale
    shift = 0.5 * zoom - 0.5
    place = np.array([[zoom, 0.0, left + shift], [0.0, zoom, top + shift]])
    drawn = cv2.warpAffine(
        gray, place, (WIDTH, HEIGHT), flags=cv2.INTER_NEAREST, borderValue=UNKNOWN
    )
    image[:] = drawn[:, :, None]


def _draw_head(image: Pixels, text: str, scale: float) -> None:
    """The strip with the text above, a bar of whole meters below."""
    import cv2

    font = cv2.FONT_HERSHEY_SIMPLEX
    image[:HEAD_HEIGHT] = 245
    text = text.encode("ascii", "replace").decode("ascii")  # all that the font has
    cv2.putText(image, text, (12, 26), font, 0.55, TEXT_COLOR, 1, cv2.LINE_AA)
    meters = max(1, round(0.15 * WIDTH / scale))
    right = 12 + round(meters * scale)
    cv2.rectangle(image, (6, HEIGHT - 40), (right + 6, HEIGHT - 6), (245, 245, 245), -1)
    cv2.line(image, (12, HEIGHT - 14), (right, HEIGHT - 14), TEXT_COLOR, 2)
    label = f"{meters} m"
    cv2.putText(image, label, (12, HEIGHT - 21), font, 0.5, TEXT_COLOR, 1, cv2.LINE_AA)
