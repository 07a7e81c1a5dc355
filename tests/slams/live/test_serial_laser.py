"""A laser at a serial port: bytes as a RPLIDAR sends them, through a pseudo terminal."""

import math
import os
import threading
import time
import tty

import numpy as np
import pytest

from slams.formats.bag import SCAN
from slams.formats.ros_store import store
from slams.live import serial_laser
from slams.live.serial_laser import MODELS, LaserWire, SerialLaser, Turn, by_beam, laser_of
from slams.live.wire import Quality
from slams.types import Laser
from tests.rooms import scan_at
from tests.slams.live.bus import Bus

pytest.importorskip("lds2d", reason="needs the extra serial")

BEAMS = 120
DESCRIPTOR = bytes([0xA5, 0x5A, 0x05, 0x00, 0x00, 0x40, 0x81])
SCAN_COMMAND, STOP_COMMAND = b"\xa5\x20", b"\xa5\x25"
PATIENCE = 30.0  # [s]


def node(first, angle, distance):
    """Five bytes of a measurement: angle [deg] clockwise, distance [m], 0 without a return."""
    turned, mm = round(angle * 64), round(4000 * distance)
    head = (40 << 2) | (1 if first else 2)
    return bytes([head, (turned << 1 | 1) & 0xFF, turned >> 7, mm & 0xFF, mm >> 8])


def turn_of(ranges):
    """A turn; ranges in the laser's own, clockwise order."""
    step = 360.0 / len(ranges)
    nodes = (node(k == 0, k * step, r if math.isfinite(r) else 0.0) for k, r in enumerate(ranges))
    return b"".join(nodes)


class Port:
    """A pseudo terminal with a laser behind it that turns when it is told to."""

    def __init__(self, turn):
        self.turn, self.told, self.ending = turn, b"", threading.Event()
        self.plug()

    def plug(self):
        self.master, slave = os.openpty()
        tty.setraw(self.master)
        tty.setraw(slave)
        self.name, self.slave = os.ttyname(slave), slave
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self._turn, daemon=True)
        self.thread.start()

    def _turn(self):
        try:
            self.told += os.read(self.master, 2)
            os.write(self.master, DESCRIPTOR)
            while not self.ending.wait(0.02):
                os.write(self.master, self.turn)
        except OSError:
            pass

    def unplug(self):
        self.ending.set()
        self.thread.join(PATIENCE)
        os.close(self.master)
        os.close(self.slave)


@pytest.fixture
def port():
    room = Laser(0.0, -2.0 * math.pi / BEAMS, BEAMS, 0.1, 12.0)
    made = Port(turn_of(np.where(np.arange(BEAMS) == 7, np.inf, scan_at((0, 0, 0), room).ranges)))
    yield made
    if not made.ending.is_set():
        made.unplug()


def until(condition):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "nothing came"
        time.sleep(0.01)


def test_scans_come_from_the_port_with_their_beams_the_right_way_round(port):
    bus, got, said = Bus(), [], []
    wire = LaserWire(SerialLaser("RPLIDAR-A1", port.name), bus.wire(), said.append)
    wire.subscribe("/scan", SCAN, Quality.SENSOR, got.append)
    wire.listen()
    until(lambda: len(got) >= 3)
    assert wire.writers("/scan") == 1
    wire.close()
    assert port.told.startswith(SCAN_COMMAND)
    scan = store().deserialize_cdr(got[-1].data, SCAN)
    assert len(scan.ranges) == BEAMS
    assert scan.angle_increment == pytest.approx(-2.0 * math.pi / BEAMS)
    assert scan.time_increment == pytest.approx(scan.scan_time / BEAMS)
    lidar = Laser(scan.angle_min, scan.angle_increment, BEAMS, 0.1, 12.0)
    expected = scan_at((0.0, 0.0, 0.0), lidar).ranges
    expected = np.where(np.arange(BEAMS) == 7, np.nan, expected)
    assert scan.ranges == pytest.approx(expected, abs=2e-3, nan_ok=True)
    assert len(bus.raw["/scan"]) >= 3  # for viewers
    assert said == []


def test_a_laser_that_is_unplugged_is_looked_for_until_it_is_back(port, monkeypatch):
    monkeypatch.setattr(serial_laser, "RETRY", 0.05)
    got, said = [], []
    opened = serial_laser._opened
    monkeypatch.setattr(
        serial_laser, "_opened", lambda laser: opened(laser._replace(port=port.name))
    )
    wire = LaserWire(SerialLaser("RPLIDAR-A1", "/dev/laser"), Bus().wire(), said.append)
    wire.subscribe("/scan", SCAN, Quality.SENSOR, got.append)
    wire.listen()
    until(lambda: got)
    port.unplug()
    until(lambda: said)
    assert said[0].startswith("the laser at /dev/laser is gone")
    port.plug()
    before = len(got)
    until(lambda: len(got) > before + 2)
    assert said[-1] == "the laser at /dev/laser is back"
    wire.close()


def test_directions_are_even_and_the_nearest_of_several_counts():
    turn = Turn(0.0, 0.1, [0.2, 89.9, 90.2, 180.0, 359.9], [1.0, 3.0, 2.0, 0.0, 4.0])
    ranges = by_beam(turn, 4)
    assert np.array_equal(ranges, np.array([1.0, 2.0, np.nan, np.nan], np.float32), equal_nan=True)


def test_names_of_lasers():
    assert laser_of("rplidar:/dev/ttyUSB0") == SerialLaser("RPLIDAR-A1", "/dev/ttyUSB0")
    assert laser_of("LDROBOT-LD14P:/dev/serial0", False).clockwise is False
    for name in MODELS:
        assert laser_of(f"{name}:/dev/x").model == MODELS[name]
    with pytest.raises(ValueError, match="--laser: got 'rplidar', expected MODEL:PORT"):
        laser_of("rplidar")
    with pytest.raises(LookupError, match="unknown model 'sonar'; expected rplidar, ldrobot"):
        laser_of("sonar:/dev/x")


def test_a_port_that_is_not_there_is_an_error_of_the_system():
    with pytest.raises(OSError, match="nowhere"):
        LaserWire(SerialLaser("RPLIDAR-A1", "/dev/nowhere"), Bus().wire(), print)
