"""A ScanLog from a ROS bag: which topics and frames it takes, and what it makes of them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import NamedTuple

from slams.formats import trajectory
from slams.formats.bag import IMU, ODOMETRY, SCANS, TFS, TRUTHS, Bag, Topic, open_bag
from slams.formats.frames import BASES, bare, moved, planar
from slams.formats.ros_messages import Messages
from slams.formats.source import DamagedError, SourceOptions, name_of
from slams.formats.sweep import Sweep, common, usable
from slams.scanlog import ScanLog, Track
from slams.types import IDENTITY, Floats, Pose2

FEW = 12  # names that a sentence lists
FOREIGN = ("ros1msg", "protobuf", "jsonschema", "flatbuffer")  # how mcap files call them
KIND = {"bag": "ROS 1 bag", "mcap": "ROS 2 mcap", "db3": "ROS 2 db3", "folder": "ROS 2 bag"}


class Roles(NamedTuple):
    """Topics by what they are taken for."""

    scan: str
    odom: str | None
    imu: str | None
    truth: str | None


def read(path: Path, kind: str, options: SourceOptions) -> ScanLog:
    """The scans of one laser with odometry, yaw rate and truth.

    Raises:
        OSError: the bag cannot be opened.
        ValueError: it is damaged, has no scans, or leaves a choice open; the sentence says what
            to do.
    """
    try:
        with open_bag(path, kind) as bag:
            return _Recording(path, kind, bag, options).log()
    except DamagedError as error:
        if not (options.salvage or _has_foreign_messages(error)):
            raise
        from slams.formats.bag_salvage import SalvagedBag

        rest = SalvagedBag(path, kind)
        if not rest.topics:
            raise DamagedError(f"{path}: nothing in it can be salvaged") from error
        recording = _Recording(path, kind, rest, options)
        if not _has_foreign_messages(error):
            recording.notes.append(str(error).partition("; ")[0].removeprefix(f"{path}: "))
        return recording.log()


def _has_foreign_messages(error: DamagedError) -> bool:
    """Whether all that keeps the library from a whole mcap is that some messages are not ROS 2."""
    cause = error.__cause__
    return isinstance(cause, KeyError) and cause.args[0] in FOREIGN


class _Recording:
    """One bag on its way to a log: topics, then messages, then frames, then tracks."""

    def __init__(self, path: Path, kind: str, bag: Bag, options: SourceOptions) -> None:
        self.path, self.kind, self.bag, self.options = path, kind, bag, options
        self.notes: list[str] = []
        self.topics = [topic for topic in bag.topics if topic.messages and topic.name]

    def log(self) -> ScanLog:
        """The whole way."""
        self.roles = self._roles()
        self._collect()
        self.base = self._base_frame()
        mount, flipped = self._mount()
        t, ranges, laser = common(self._sweeps(), mount, flipped, self.notes)
        odom, odometry = self._odometry()
        truth, true_source = self._truth()
        rate = self._yaw_rate()
        source = {
            "format": KIND[self.kind],
            "file": self.path.resolve().name,
            "scans": self.roles.scan,
            "odometry": odometry,
            "yaw_rate": self.roles.imu if rate else None,
            "truth": true_source,
            "base_frame": self.base,
        }
        meta = {"name": name_of(self.path), "source": source}
        return ScanLog(t, ranges, laser, odom, truth, rate, meta, tuple(self.notes))

    # topics

    def _roles(self) -> Roles:
        scan = self._scan_topic()
        truth = self._truth_topic()
        return Roles(scan, self._odom_topic(truth), self._imu_topic(), truth)

    def _scan_topic(self) -> str:
        found, wanted = self._of(SCANS), self.options.scan_topic
        if wanted is not None:
            return self._named(wanted, found, "--scan-topic", "laser scans")
        if not found:
            hint = "expected sensor_msgs/LaserScan or MultiEchoLaserScan"
            raise ValueError(f"{self.path}: no laser scans; {hint}; its topics: {self._all()}")
        if len(found) > 1:
            raise self._choice("laser scan topics", "--scan-topic", found)
        return found[0].name

    def _truth_topic(self) -> str | None:
        """The topic asked for, if it is one; else the only one that calls itself truth."""
        found, wanted = self._of(TRUTHS), self.options.truth
        if wanted is not None:
            return _match(wanted, found)
        named = [topic.name for topic in found if "truth" in topic.name.lower()]
        if len(named) != 1:
            return None
        self.notes.append(f"{named[0]} is taken as the truth (--truth none does without)")
        return named[0]

    def _odom_topic(self, truth: str | None) -> str | None:
        """The topic asked for, if it is one; else the only one."""
        found, wanted = self._of((ODOMETRY,)), self.options.odom
        if wanted is not None:
            return _match(wanted, found)
        found = [topic for topic in found if topic.name != truth]
        if len(found) > 1:
            raise self._choice("odometry topics", "--odom", found, " (or none)")
        return found[0].name if found else None

    def _imu_topic(self) -> str | None:
        """The topic asked for or the only one; the gyro is no need, so several are none."""
        found, wanted = self._of((IMU,)), self.options.imu
        if wanted == "none":
            return None
        if wanted is not None:
            return self._named(wanted, found, "--imu", "IMU messages")
        if len(found) > 1:
            self.notes.append(
                f"{len(found)} IMU topics, none is used; --imu picks one: {_list(found)}"
            )
        return found[0].name if len(found) == 1 else None

    def _of(self, types: Collection[str]) -> list[Topic]:
        return [topic for topic in self.topics if topic.msgtype in types]

    def _named(self, wanted: str, found: Sequence[Topic], flag: str, what: str) -> str:
        name = _match(wanted, found)
        if name is None:
            raise ValueError(
                f"{self.path}: {flag}: no {what} on {wanted}; there are: {_list(found) or 'none'}"
            )
        return name

    def _choice(self, what: str, flag: str, found: Sequence[Topic], more: str = "") -> ValueError:
        return ValueError(
            f"{self.path}: {len(found)} {what}, {flag} picks one{more}: {_list(found)}"
        )

    def _all(self) -> str:
        names = [f"{topic.name} ({topic.msgtype}, {topic.messages})" for topic in self.topics]
        return _some(names) or "none"

    # messages

    def _collect(self) -> None:
        """Read what the roles ask for; the moving transforms only where they are needed."""
        types = (SCANS, (ODOMETRY,), (IMU,), TRUTHS)
        roles = zip(self.roles, types, strict=True)
        self.messages = Messages({topic: allowed for topic, allowed in roles if topic})
        tf = {topic.name for topic in self._of(TFS)}
        static = {name for name in tf if name.endswith("static")}
        self._take(static | set(self.messages.types))
        if not self._knows_its_frames():
            self._take(tf - static)
        if self.messages.bad:
            self.notes.append(f"{self.messages.bad} messages cannot be read and are left out")

    def _take(self, topics: Collection[str]) -> None:
        self.messages.collect(self.path, self.bag, topics, self.options.salvage)

    def _knows_its_frames(self) -> bool:
        """Whether odometry, truth and mount can do without the moving transforms."""
        roles, options = self.roles, self.options
        if roles.odom is None and options.odom != "none":
            return False
        if options.truth not in (None, "none") and roles.truth is None:
            return False
        base = options.base_frame or (self.messages.frame(roles.odom) if roles.odom else "")
        return bool(base) and self._fixed(base, self.messages.frame(roles.scan)) is not None

    def _sweeps(self) -> list[Sweep]:
        sweeps = self.messages.sweeps(self.roles.scan)
        good = [sweep for sweep in sweeps if usable(sweep.geometry)]
        if len(good) < len(sweeps):
            left_out = len(sweeps) - len(good)
            self.notes.append(f"{left_out} scans without beams or angles are left out")
        if not good:
            raise ValueError(f"{self.path}: no scan of {self.roles.scan} has beams")
        if self.messages.unstamped(self.roles.scan):
            self.notes.append("scans have no stamps; the times of recording stand in")
        return good

    # frames

    def _fixed(self, base: str, frame: str) -> Floats | None:
        return self.messages.transforms.fixed(base, frame)

    def _base_frame(self) -> str:
        """The frame that poses are of: asked for, else the odometry's, else base_link or so."""
        laser = self.messages.frame(self.roles.scan)
        wanted = self.options.base_frame
        if wanted is not None:
            if self._fixed(wanted, laser) is None:
                raise ValueError(
                    f"{self.path}: --base-frame: {wanted} is not fixed to the laser's frame "
                    f"{laser}; frames: {_some(self.messages.transforms.frames) or 'none'}"
                )
            return bare(wanted)
        above = self.messages.transforms.ancestors(laser)
        odom = self.messages.frame(self.roles.odom) if self.roles.odom else ""
        usual = [odom] if odom and self._fixed(odom, laser) is not None else []
        usual += [frame for base in BASES for frame in above if frame.rpartition("/")[2] == base]
        if not usual and len(above) > 2:
            raise ValueError(
                f"{self.path}: the laser's frame {laser} hangs on {len(above) - 1} frames, "
                f"--base-frame picks one: {_some(above[1:])}"
            )
        return usual[0] if usual else above[-1]

    def _mount(self) -> tuple[Pose2, bool]:
        """The laser in the base, and whether it is upside down."""
        laser = self.messages.frame(self.roles.scan)
        matrix = self._fixed(self.base, laser)
        if matrix is None or self.base == laser:
            self.notes.append(
                f"no transform from a base to the laser's frame '{laser}'; the laser is taken as "
                "the base"
            )
            return IDENTITY, False
        return planar(matrix, "the laser", self.notes)

    # tracks

    def _odometry(self) -> tuple[Track | None, str | None]:
        wanted, topic = self.options.odom, self.roles.odom
        if topic is not None:
            return self._at_base(topic), topic
        if wanted == "none":
            return None, None
        if wanted is not None:
            return self._moving(wanted, "--odom"), f"tf {wanted}"
        frames = [f for f in self.messages.transforms.above(self.base) if "odom" in f.lower()]
        if len(frames) > 1:
            raise ValueError(
                f"{self.path}: {len(frames)} odometry frames, --odom picks one (or none): "
                f"{_some(frames)}"
            )
        if not frames:
            return None, None
        return self._moving(frames[0], "--odom"), f"tf {frames[0]}"

    def _truth(self) -> tuple[Track | None, str | None]:
        """From a topic, a frame or a file, in this order."""
        wanted, topic = self.options.truth, self.roles.truth
        if topic is not None:
            return self._at_base(topic), topic
        if wanted is None or wanted == "none":
            return None, None
        if bare(wanted) in self.messages.transforms.frames:
            return self._moving(wanted, "--truth"), f"tf {wanted}"
        if Path(wanted).is_file():
            return Track(*trajectory.read(wanted)), Path(wanted).name
        raise ValueError(
            f"{self.path}: --truth: {wanted} is no topic, frame or file; topics: "
            f"{_list(self._of(TRUTHS)) or 'none'}; frames: "
            f"{_some(self.messages.transforms.frames) or 'none'}"
        )

    def _at_base(self, topic: str) -> Track | None:
        """A topic's poses, carried from the frame they are of to the base."""
        track = self.messages.track(topic)
        matrix = self._fixed(self.messages.frame(topic), self.base)
        if track is None or matrix is None or self.messages.frame(topic) == self.base:
            return track
        return moved(track, planar(matrix, "the base", self.notes)[0])

    def _moving(self, frame: str, flag: str) -> Track:
        track = self.messages.transforms.moving(frame, self.base)
        if track is None:
            found = _some(self.messages.transforms.above(self.base)) or "none"
            raise ValueError(
                f"{self.path}: {flag}: {frame} is no topic and no frame above {self.base}; "
                f"such frames: {found}"
            )
        return track

    def _yaw_rate(self) -> Track | None:
        """The gyro's turn rate about the base's upright axis."""
        topic = self.roles.imu
        track = self.messages.track(topic) if topic else None
        if topic is None or track is None:
            return None
        frame = self.messages.frame(topic)
        matrix = self._fixed(self.base, frame)
        if matrix is None:
            self.notes.append(f"no transform to the gyro's frame '{frame}'; it is taken as upright")
            return Track(track.t, track.values[:, 2].copy())
        return Track(track.t, track.values @ matrix[2, :3])


def _match(wanted: str, found: Sequence[Topic]) -> str | None:
    """A topic by its name, with or without the slash in front."""
    names = [topic.name for topic in found]
    return next((name for name in (wanted, f"/{wanted}") if name in names), None)


def _list(found: Sequence[Topic]) -> str:
    return _some([f"{topic.name} ({topic.messages})" for topic in found])


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - FEW} more" if len(names) > FEW else ""
    return ", ".join(names[:FEW]) + more
