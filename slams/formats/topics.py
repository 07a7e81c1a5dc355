"""The choice of a bag's topics: the one that the user names, else the only one of its type."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from slams.formats.bag import Topic
from slams.formats.options import SourceOptions
from slams.params import MAX_LASERS
from slams.ros.messages import IMU_TYPE, ODOMETRY_TYPE, POSE_TYPES, SCAN_TYPES, TRUTH_TYPES
from slams.validation import expect

MAX_LISTED_NAMES = 12  # in a sentence


class Roles:
    """Topics by role: `scans`, and `odom`, `imu` and `truth` or None.

    Args:
        found: the topics that have messages.
        options: the user's choices.
        notes: receive notes for the user.

    Raises:
        ValueError: there are no scans, or the choice is ambiguous.
    """

    def __init__(self, found: Sequence[Topic], options: SourceOptions, notes: list[str]) -> None:
        self.found, self.options, self.notes = found, options, notes
        self.scans = self._scan_topics()
        self.truth = self._truth_topic()
        self.odom = self._odom_topic()
        self.imu = self._imu_topic()

    def of(self, types: Collection[str]) -> list[Topic]:
        """Topics of these message types."""
        return [topic for topic in self.found if topic.msgtype in types]

    def _scan_topics(self) -> tuple[str, ...]:
        found, options = self.of(SCAN_TYPES), self.options
        if options.scan_topic is not None:
            wanted = (options.scan_topic, *options.more_scan_topics)
            names = [self._named(one, found, "--scan-topic", "laser scans") for one in wanted]
            is_valid = len(set(names)) == len(names) <= MAX_LASERS
            expect(is_valid, "--scan-topic", names, f"up to {MAX_LASERS} different topics")
            return tuple(names)
        name = self._only(found, "laser scan topics", "--scan-topic picks one")
        if name is None:
            names = [f"{topic.name} ({topic.msgtype}, {topic.messages})" for topic in self.found]
            raise ValueError(
                "no laser scans; expected sensor_msgs/LaserScan or MultiEchoLaserScan; its topics: "
                f"{shortened(names)}"
            )
        return (name,)

    def _truth_topic(self) -> str | None:
        """The chosen truth if it is a topic; else the only topic with truth in its name."""
        wanted = self.options.truth
        if wanted is not None:
            return match(wanted, self.of(POSE_TYPES))
        named = [topic.name for topic in self.of(TRUTH_TYPES) if "truth" in topic.name.lower()]
        if len(named) != 1:
            return None
        self.notes.append(f"{named[0]} is taken as the truth (--truth none does without)")
        return named[0]

    def _odom_topic(self) -> str | None:
        """The chosen odometry if it is a topic; else the only topic."""
        found, wanted = self.of((ODOMETRY_TYPE,)), self.options.odom
        if wanted is not None:
            return match(wanted, found)
        found = [topic for topic in found if topic.name != self.truth]
        return self._only(found, "odometry topics", "--odom picks one (or none)")

    def _imu_topic(self) -> str | None:
        """The chosen topic, else the only one; of several none, as the gyro is optional."""
        found, wanted = self.of((IMU_TYPE,)), self.options.imu
        if wanted == "none":
            return None
        if wanted is not None:
            return self._named(wanted, found, "--imu", "IMU messages")
        if len(found) > 1:
            self.notes.append(
                f"{len(found)} IMU topics, none is used; --imu picks one: {topic_list(found)}"
            )
        return found[0].name if len(found) == 1 else None

    def _named(self, wanted: str, found: Sequence[Topic], flag: str, content: str) -> str:
        name = match(wanted, found)
        if name is None:
            raise ValueError(f"{flag}: no {content} on {wanted}; there are: {topic_list(found)}")
        return name

    def _only(self, found: Sequence[Topic], content: str, hint: str) -> str | None:
        if len(found) > 1:
            raise ValueError(f"{len(found)} {content}, {hint}: {topic_list(found)}")
        return found[0].name if found else None


def match(wanted: str, found: Sequence[Topic]) -> str | None:
    """The full name of a topic that is given with or without the leading slash."""
    names = [topic.name for topic in found]
    return next((name for name in (wanted, f"/{wanted}") if name in names), None)


def topic_list(found: Sequence[Topic]) -> str:
    """Names of topics with their numbers of messages, as text."""
    return shortened([f"{topic.name} ({topic.messages})" for topic in found])


def shortened(names: Sequence[str]) -> str:
    """The first names of a list as text with the number of further ones; "none" if empty."""
    more = f" and {len(names) - MAX_LISTED_NAMES} more" if len(names) > MAX_LISTED_NAMES else ""
    return (", ".join(names[:MAX_LISTED_NAMES]) or "none") + more
