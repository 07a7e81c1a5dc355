"""A film of a run: the scan on the map so far, the path, the pose; mp4 or a folder of png.

Frames depend on the log and the algorithm alone: the same run gives the same film.
"""

from __future__ import annotations

import math
import os
import re
import shutil
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from slams.formats.occupancy import Pixels, silent_opencv, write_image
from slams.watch.painter import HEIGHT, WIDTH, Painter
from slams.watch.scene import Scene

if TYPE_CHECKING:
    from slams.types import Pose2, Scan, Slam

FRAME_RATE = 20  # frames per second
DEFAULT_FRAMES = 300  # frames, unless --video-every says otherwise
FRAMES_PER_MAP = 5  # frames from one drawing of the map to the next
QUIET_LOG_LEVEL = "-8"  # ffmpeg's least talkative level
FRAME = re.compile(r"\d{5,}\.png")  # what a folder of frames holds, and nothing else


def check_target(path: str | Path) -> Path:
    """The target of a film.

    Raises:
        ValueError: the ending is neither .mp4 nor that of a folder.
        OSError: its folder does not exist, it stands in the way, or it holds other files.
    """
    path = Path(path)
    if path.suffix not in ("", ".mp4"):
        raise ValueError(f"--video: got {path}, expected .mp4 or a folder for png files")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"--video: {path}: there is no folder {path.parent}")
    if path.is_dir() and path.suffix:
        raise IsADirectoryError(f"--video: {path}: is a folder")
    if path.is_file() and not path.suffix:
        raise NotADirectoryError(f"--video: {path}: is a file; expected .mp4 or a folder")
    if path.is_dir() and not all(FRAME.fullmatch(item.name) for item in path.iterdir()):
        raise FileExistsError(
            f"--video: {path}: holds other files; expected a new folder or one of frames"
        )
    return path


class Video:
    """Takes every pose of a run as it comes; the film is complete when the block ends.

    Args:
        path: .mp4, or a folder for png files.
        slam: the algorithm, asked for its map and, where it has one, its quality.
        title: stands in the head of every frame.
        every: scans from one frame to the next.
    """

    def __init__(self, path: str | Path, slam: Slam, title: str, every: int) -> None:
        self._slam = slam
        self._title = title
        self._every = every
        self._path = check_target(path)
        self._writer = (_Mp4 if self._path.suffix else _Folder)(self._path)
        self._scene = Scene()
        self._painter = Painter(self._scene)
        self._drawn = 0
        self._t: list[float] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        try:
            if kind is None and self._t:
                self._drawn = 0  # the last frame has the last map
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
        if self._drawn % FRAMES_PER_MAP == 0:
            self._painter.grid = self._slam.map()
        self._drawn += 1
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


class _Mp4:
    """MPEG-4, which OpenCV's own wheels can write everywhere."""

    def __init__(self, path: Path) -> None:
        import cv2

        self._path = path.resolve()
        self._partial = self._path.with_name(f".{path.stem}.{os.getpid()}.part.mp4")
        try:
            name = str(self._partial).encode("utf-8").decode("utf-8")
        except UnicodeEncodeError:  # OpenCV crashes on these
            raise OSError(f"--video: {path}: the name is not UTF-8; a folder can do") from None
        os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", QUIET_LOG_LEVEL)
        self._frames = 0
        code = cv2.VideoWriter.fourcc(*"mp4v")
        self._film = cv2.VideoWriter(name, code, FRAME_RATE, (WIDTH, HEIGHT))
        if not self._film.isOpened():
            raise OSError(f"--video: {path}: OpenCV cannot write mp4 here; a folder can do")

    def write(self, image: Pixels) -> None:
        """Take one frame."""
        self._frames += 1
        with silent_opencv():
            self._film.write(image)

    def close(self, complete: bool) -> None:
        """End the film; rename or remove it. A second call does nothing."""
        with silent_opencv():
            self._film.release()
        if complete and self._partial.exists():
            if count_frames(self._partial) != self._frames:  # OpenCV does not tell of a full disk
                raise OSError("it could not be written whole; is the disk full?")
            self._partial.replace(self._path)
        self._partial.unlink(missing_ok=True)


def count_frames(film: Path) -> int:
    """Frames that an mp4 file says it has; 0 where it cannot be opened."""
    import cv2

    with silent_opencv():
        reader = cv2.VideoCapture(str(film))
        try:
            return max(int(reader.get(cv2.CAP_PROP_FRAME_COUNT)), 0)
        finally:
            reader.release()


class _Folder:
    """00000.png, 00001.png, ..., for a film of your own making."""

    def __init__(self, path: Path) -> None:
        self._path = path.resolve()  # "." has no name to put a temporary one beside
        self._partial = self._path.with_name(f".{self._path.name}.{os.getpid()}.part")
        shutil.rmtree(self._partial, ignore_errors=True)  # of a killed run: process numbers repeat
        self._partial.mkdir()
        self._count = 0

    def write(self, image: Pixels) -> None:
        """Take one frame."""
        write_image(self._partial / f"{self._count:05d}.png", image)
        self._count += 1

    def close(self, complete: bool) -> None:
        """Put the frames in the place of older ones, or remove them; the folder itself stays."""
        if complete and self._partial.exists():
            self._path.mkdir(exist_ok=True)
            for old in self._path.iterdir():
                if FRAME.fullmatch(old.name):
                    old.unlink()
            for frame in self._partial.iterdir():
                frame.replace(self._path / frame.name)
        shutil.rmtree(self._partial, ignore_errors=True)


def default_every(n_scans: int) -> int:
    """Scans from frame to frame, so that a film has about `DEFAULT_FRAMES` frames."""
    return max(1, math.ceil(n_scans / DEFAULT_FRAMES))
