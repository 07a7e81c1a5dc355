"""A film of a run: the scan on the map so far, the way, the pose; mp4, gif or a folder of png.

Frames depend on the log and the algorithm alone: the same run gives the same film.
"""

from __future__ import annotations

import math
import os
import re
import shutil
import struct
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol, Self

import numpy as np

from slams.formats.occupancy import Pixels, silent_opencv, write_image
from slams.watch.painter import HEIGHT, WIDTH, Painter
from slams.watch.scene import Scene

if TYPE_CHECKING:
    from slams.types import Pose2, Scan, Slam

RATE = 20  # frames per second
LENGTH = 300  # frames, unless --video-every says otherwise
REDRAW = 5  # frames from one drawing of the map to the next
QUIET = "-8"  # ffmpeg's least talkative level
FRAME = re.compile(r"\d{5,}\.png")  # what a folder of frames holds, and nothing else


def check_target(path: str | Path) -> Path:
    """The target of a film.

    Raises:
        ValueError: the ending is neither .mp4 nor .gif, nor that of a folder.
        OSError: its folder does not exist, it stands in the way, or it holds other files.
    """
    path = Path(path)
    if path.suffix not in ("", ".mp4", ".gif"):
        raise ValueError(f"--video: got {path}, expected .mp4, .gif or a folder for png files")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"--video: {path}: there is no folder {path.parent}")
    if path.is_dir() and path.suffix:
        raise IsADirectoryError(f"--video: {path}: is a folder")
    if path.is_file() and not path.suffix:
        raise NotADirectoryError(f"--video: {path}: is a file; expected .mp4, .gif or a folder")
    if path.is_dir() and not all(FRAME.fullmatch(item.name) for item in path.iterdir()):
        raise FileExistsError(
            f"--video: {path}: holds other files; expected a new folder or one of frames"
        )
    return path


class Video:
    """Takes every pose of a run as it comes; the film is complete when the block ends.

    Args:
        path: .mp4, .gif, or a folder for png files.
        slam: the algorithm, asked for its map and, where it has one, its quality.
        title: stands in the head of every frame.
        every: scans from one frame to the next.
    """

    def __init__(self, path: str | Path, slam: Slam, title: str, every: int) -> None:
        self._slam = slam
        self._title = title
        self._every = every
        self._path = check_target(path)
        self._writer = _writer(self._path)
        self._scene = Scene()
        self._painter = Painter(self._scene)
        self._frames = 0
        self._t: list[float] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        try:
            if kind is None and self._t:
                self._frames = 0  # the last frame has the last map
                self._draw()
            self._writer.close(complete=kind is None)
        except BaseException as problem:
            self._writer.close(complete=False)
            if isinstance(problem, OSError):
                raise self._unwritten(problem) from problem
            raise

    def watch(self, scan: Scan, pose: Pose2) -> None:
        """See one scan and the pose that was found for it."""
        self._scene.add(scan, pose)
        self._t.append(scan.t)
        if (len(self._t) - 1) % self._every == 0:
            self._draw()

    def _draw(self) -> None:
        if self._frames % REDRAW == 0:
            self._painter.grid = self._slam.map()
        self._frames += 1
        pose, seconds = self._scene.pose, self._t[-1] - self._t[0]
        text = f"{self._title}   {seconds:6.1f} s   x {pose.x:.2f} y {pose.y:.2f} m"
        text += f"  {math.degrees(pose.theta):.0f} deg"
        quality = getattr(self._slam, "quality", None)
        if quality is not None:
            text += f"   match {quality:.2f}"
        try:
            self._writer.write(self._painter.frame(text))
        except OSError as error:
            raise self._unwritten(error) from error

    def _unwritten(self, error: OSError) -> RuntimeError:
        reason = (error.strerror or str(error)).lower()
        return RuntimeError(f"--video: {self._path}: {reason}; nothing of the film is kept")


class Writer(Protocol):
    """Takes frames; the target appears only when all are there."""

    def write(self, image: Pixels) -> None:
        """Take one frame."""
        ...

    def close(self, complete: bool) -> None:
        """Rename what was written, or remove it; a second call does nothing."""
        ...


def _writer(path: Path) -> Writer:
    if path.suffix == ".mp4":
        return _Mp4(path)
    return _Gif(path) if path.suffix == ".gif" else _Folder(path)


class _Target:
    """A temporary name beside the target."""

    def __init__(self, path: Path) -> None:
        self.path = path.resolve()  # "." has no name to put a temporary one beside
        name = f".{self.path.stem}.{os.getpid()}.part{self.path.suffix}"
        self.partial = self.path.with_name(name)

    def close(self, complete: bool) -> None:
        """Rename or remove."""
        if complete and self.partial.exists():
            self.partial.replace(self.path)
        else:
            self.partial.unlink(missing_ok=True)


class _Mp4(_Target):
    """MPEG-4, which OpenCV's own wheels can write everywhere."""

    def __init__(self, path: Path) -> None:
        import cv2

        super().__init__(path)
        try:
            name = str(self.partial).encode("utf-8").decode("utf-8")
        except UnicodeEncodeError:  # OpenCV crashes on these
            raise OSError(
                f"--video: {path}: the name is not UTF-8; .gif or a folder can do"
            ) from None
        os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", QUIET)
        code = cv2.VideoWriter.fourcc(*"mp4v")
        self._film = cv2.VideoWriter(name, code, RATE, (WIDTH, HEIGHT))
        if not self._film.isOpened():
            raise OSError(f"--video: {path}: OpenCV cannot write mp4 here; .gif or a folder can do")

    def write(self, image: Pixels) -> None:
        """Take one frame."""
        with silent_opencv():
            self._film.write(image)

    def close(self, complete: bool) -> None:
        """End the film; rename or remove. OpenCV does not tell whether its writing went well."""
        with silent_opencv():
            self._film.release()
        if complete and self.partial.exists() and not is_whole(self.partial):
            raise OSError("it could not be written whole; is the disk full?")
        super().close(complete)


def is_whole(film: Path) -> bool:
    """Whether the boxes of an mp4 file fill it, with the table of its frames among them."""
    size, place, kinds = film.stat().st_size, 0, set()
    with film.open("rb") as file:
        while place < size:
            file.seek(place)
            length, kind, longer = struct.unpack(">I4sQ", file.read(16).ljust(16, b"\0"))
            length = longer if length == 1 else length
            if length < 8:
                return False
            kinds.add(kind)
            place += length
    return place == size and {b"mdat", b"moov"} <= kinds


class _Gif(_Target):
    """Two thirds of the size, 40 grays and 216 colors; kept in memory until the end."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._frames: list[Any] = []
        self._palette, self._nearest = _palette()
        self.partial.touch()

    def write(self, image: Pixels) -> None:
        """Take one frame."""
        import cv2
        from PIL import Image

        small = cv2.resize(image, (WIDTH * 2 // 3, HEIGHT * 2 // 3), interpolation=cv2.INTER_AREA)
        b, g, r = (small[:, :, k].astype(np.int32) >> 3 for k in range(3))
        frame = Image.fromarray(self._nearest[(r << 10) | (g << 5) | b])
        frame.putpalette(self._palette)
        self._frames.append(frame)

    def close(self, complete: bool) -> None:
        """Write all frames; rename or remove."""
        if complete and self._frames:
            first, rest = self._frames[0], self._frames[1:]
            first.save(
                self.partial,
                save_all=True,
                append_images=rest,
                duration=1000 // RATE,
                loop=0,
                optimize=False,
            )
        self._frames.clear()
        super().close(complete)


def _palette() -> tuple[bytes, Pixels]:
    """256 RGB colors, and the nearest of them for every color of 5 bits a channel."""
    steps = np.linspace(0, 255, 6)
    cube = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    grays = np.linspace(0, 255, 40)[:, None].repeat(3, axis=1)
    colors = np.concatenate([grays, cube])
    five_bits = np.arange(1 << 15)
    shades = np.stack([five_bits >> 10, (five_bits >> 5) & 31, five_bits & 31], axis=1) * 255 / 31
    far = ((shades[:, None, :] - colors[None]) ** 2).sum(axis=2)
    return colors.round().astype(np.uint8).tobytes(), far.argmin(axis=1).astype(np.uint8)


class _Folder(_Target):
    """00000.png, 00001.png, ..., for a film of your own making."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        shutil.rmtree(self.partial, ignore_errors=True)  # of a killed run: process numbers repeat
        self.partial.mkdir()
        self._count = 0

    def write(self, image: Pixels) -> None:
        """Take one frame."""
        write_image(self.partial / f"{self._count:05d}.png", image)
        self._count += 1

    def close(self, complete: bool) -> None:
        """Put the frames in the place of older ones, or remove them; the folder itself stays."""
        if complete and self.partial.exists():
            self.path.mkdir(exist_ok=True)
            for old in self.path.iterdir():
                if FRAME.fullmatch(old.name):
                    old.unlink()
            for frame in self.partial.iterdir():
                frame.replace(self.path / frame.name)
        shutil.rmtree(self.partial, ignore_errors=True)


def usual_every(n_scans: int) -> int:
    """Scans from frame to frame, so that a film has about `LENGTH` frames."""
    return max(1, math.ceil(n_scans / LENGTH))
