"""A laser at a serial port of this machine as if its driver published scans (extra `serial`)."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from slams.formats.bag import SCAN, Record
from slams.formats.ros_maker import Maker
from slams.formats.ros_store import store
from slams.live.wire import Outlet, Quality, Taker, Wire
from slams.types import Laser, Ranges

MODELS = {
    "rplidar": "RPLIDAR-A1",
    "ldrobot": "LDROBOT-LD19",
    "ydlidar": "YDLIDAR-X4",
    "lds01": "HLS-LFCD2",
}
FRAME = "laser"
NEAREST, FARTHEST = 0.1, 12.0  # [m] of the usual ones
FEWEST_BEAMS = 90
RETRY = 1.0  # [s] between looks at whether the laser is back
PARTIAL = 2  # turns until one is whole: the first began anywhere


class SerialLaser(NamedTuple):
    """A laser by its name in the library, its port, and whether its angles grow clockwise."""

    model: str
    port: str
    clockwise: bool = True


class Turn(NamedTuple):
    """One turn of a laser: when it began and how long it took [s], angles [deg], distances [m]."""

    t: float
    period: float
    angles: Sequence[float]
    distances: Sequence[float]


def laser_of(text: str, clockwise: bool = True) -> SerialLaser:
    """The laser that "MODEL:PORT" names.

    Raises:
        LookupError: the library is not installed, or does not know the model.
        ValueError: the text has no port.
    """
    name, _, port = text.partition(":")
    if not (name and port):
        raise ValueError(f"--laser: got {text!r}, expected MODEL:PORT as rplidar:/dev/ttyUSB0")
    model = MODELS.get(name.lower(), name.upper())
    known = _library().available_models()
    if model not in known:
        raise LookupError(
            f"--laser: unknown model {name!r}; expected {', '.join(MODELS)} or one of "
            f"{', '.join(known)}"
        )
    return SerialLaser(model, port, clockwise)


class LaserWire:
    """A network that has a laser of this machine on it; its scans are published, too.

    Args:
        laser: which.
        wire: the network.
        say: told when the laser goes and when it comes back.

    Raises:
        OSError: there is no laser at the port.
    """

    def __init__(self, laser: SerialLaser, wire: Wire, say: Callable[[str], None]) -> None:
        self._laser, self._wire, self._say = laser, wire, say
        self._make, self._beams = Maker(), 0
        self._topic = ""
        self._outlet: Outlet | None = None
        self._take: Taker = lambda record: None
        self._ending = threading.Event()
        self._driver: Any = _opened(laser)
        self._thread = threading.Thread(target=self._read, name="laser", daemon=True)

    def subscribe(self, topic: str, msgtype: str, quality: Quality, take: Taker) -> None:
        """As the network does it, but scans come from the laser."""
        if msgtype != SCAN:
            self._wire.subscribe(topic, msgtype, quality, take)
            return
        self._topic, self._take = topic, take
        self._outlet = self._wire.advertise(topic, msgtype, quality)

    def advertise(self, topic: str, msgtype: str, quality: Quality) -> Outlet:
        """Begin to publish a topic."""
        return self._wire.advertise(topic, msgtype, quality)

    def listen(self) -> None:
        """Begin to receive."""
        self._wire.listen()
        self._thread.start()

    def topics(self) -> dict[str, str]:
        """Topics that somebody publishes, with their message types."""
        return self._wire.topics()

    def writers(self, topic: str) -> int:
        """How many publish a topic that is subscribed; the laser is one."""
        return 1 if topic == self._topic else self._wire.writers(topic)

    def close(self) -> None:
        """Stop the laser and leave the network."""
        self._ending.set()
        _stopped(self._driver)
        self._thread.join(RETRY)
        self._wire.close()

    def _read(self) -> None:
        """Take turn by turn; a laser that was unplugged is looked for until it is back."""
        while not self._ending.is_set():
            try:
                for turn in turns(self._driver):
                    self._send(turn)
            except Exception as error:  # pyserial and the system raise their own
                if self._ending.is_set():
                    return
                self._say(f"the laser at {self._laser.port} is gone ({error}); waiting for it")
                self._await()

    def _await(self) -> None:
        _stopped(self._driver)
        while not self._ending.wait(RETRY):
            try:
                self._driver = _opened(self._laser)
            except OSError:
                continue
            self._say(f"the laser at {self._laser.port} is back")
            return

    def _send(self, turn: Turn) -> None:
        self._beams = self._beams or max(FEWEST_BEAMS, len(turn.angles))
        step = 2.0 * math.pi / self._beams * (-1.0 if self._laser.clockwise else 1.0)
        between = turn.period / self._beams
        laser = Laser(0.0, step, self._beams, NEAREST, FARTHEST, time_increment=between)
        stamp = round(1e9 * turn.t)
        message = self._make.scan(stamp, FRAME, laser, by_beam(turn, self._beams), turn.period)
        data = bytes(store().serialize_cdr(message, SCAN))
        self._take(Record(self._topic, SCAN, time.time_ns(), data))
        if self._outlet is not None:
            self._outlet.send(data)


def turns(driver: Any) -> Iterator[Turn]:
    """Whole turns as the library's driver gives them, timed by this machine's clock."""
    ended: list[float] = []
    for scan in driver.scans():
        ended.append(time.time())
        del ended[:-10]
        if len(ended) <= PARTIAL:
            continue
        period = float(np.median(np.diff(ended)))
        angles = [point.angle_deg for point in scan.points]
        distances = [1e-3 * point.dist_mm for point in scan.points]
        yield Turn(ended[-1] - period, period, angles, distances)


def by_beam(turn: Turn, n_beams: int) -> Ranges:
    """Distances (n_beams,) [m] in even directions; the nearest of several, nan without a return."""
    ranges = np.full(n_beams, np.inf, np.float32)
    beam = np.round(np.array(turn.angles) * n_beams / 360.0).astype(np.intp) % n_beams
    distances = np.array(turn.distances, np.float32)
    seen = distances > 0.0
    np.minimum.at(ranges, beam[seen], distances[seen])
    ranges[np.isinf(ranges)] = np.nan
    return ranges


def _library() -> Any:
    try:
        return import_module("lds2d")
    except ModuleNotFoundError as error:
        raise LookupError(
            "--laser needs lds2d, which is not installed: pip install 'slams[serial]'"
        ) from error


def _opened(laser: SerialLaser) -> Any:
    """The library's driver of a laser that turns.

    Raises:
        OSError: there is nothing at the port; pyserial's errors are such.
    """
    driver = _library().Lidar.open(laser.model, laser.port)
    try:
        driver.start()
    except _library().NotSupportedError:
        pass  # it turns as soon as it has power
    return driver


def _stopped(driver: Any) -> None:
    """Let the laser rest, if it is still there."""
    for work in (driver.stop, driver.close):
        try:
            work()
        except (_library().LidarError, OSError):
            continue
