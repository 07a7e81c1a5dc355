"""A network in memory: what is sent arrives at once, in the thread that sends it."""

from types import SimpleNamespace

from slams.formats.bag import Record
from slams.formats.ros_store import store
from slams.live.options import Quality


class Bus:
    """Topics that several transports share; `sent` gives all messages of a topic, decoded."""

    def __init__(self):
        self.types, self.callbacks, self.kept, self.raw = {}, {}, {}, {}

    def transport(self):
        return BusTransport(self)

    def sent(self, topic):
        return [store().deserialize_cdr(d, self.types[topic]) for d in self.raw.get(topic, [])]

    def publish(self, topic, msgtype, message, quality=Quality.RELIABLE):
        self.transport().advertise(topic, msgtype, quality).publish(
            bytes(store().serialize_cdr(message, msgtype))
        )


class BusTransport:
    def __init__(self, bus):
        self.bus, self.wanted = bus, []
        self.closed = False

    def subscribe(self, topic, msgtype, quality, callback):
        self.wanted.append((topic, msgtype, callback))

    def advertise(self, topic, msgtype, quality):
        bus = self.bus
        bus.types[topic] = msgtype

        def publish(data):
            bus.raw.setdefault(topic, []).append(data)
            if quality is Quality.LATCHED:
                bus.kept[topic] = data
            for kind, callback in bus.callbacks.get(topic, []):
                if kind == msgtype:
                    callback(Record(topic, msgtype, len(bus.raw[topic]), data))

        return SimpleNamespace(publish=publish, subscribers=1)

    def listen(self):
        for topic, msgtype, callback in self.wanted:
            self.bus.callbacks.setdefault(topic, []).append((msgtype, callback))
            if topic in self.bus.kept:
                callback(Record(topic, msgtype, 0, self.bus.kept[topic]))

    def published(self, msgtype):
        return sorted(topic for topic, kind in self.bus.types.items() if kind == msgtype)

    def close(self):
        self.closed = True
