"""A network in memory: what is sent arrives at once, in the thread that sends it."""

from types import SimpleNamespace

from slams.formats.bag import Record
from slams.formats.ros_store import store
from slams.live.wire import Quality


class Bus:
    """Topics that several wires share; `sent` keeps all messages of a topic, decoded."""

    def __init__(self):
        self.types, self.takers, self.kept, self.raw = {}, {}, {}, {}

    def wire(self):
        return BusWire(self)

    def sent(self, topic):
        return [store().deserialize_cdr(d, self.types[topic]) for d in self.raw.get(topic, [])]

    def publish(self, topic, msgtype, message, quality=Quality.RELIABLE):
        self.wire().advertise(topic, msgtype, quality).send(
            bytes(store().serialize_cdr(message, msgtype))
        )


class BusWire:
    def __init__(self, bus):
        self.bus, self.wanted, self.several = bus, [], 1
        self.closed = False

    def subscribe(self, topic, msgtype, quality, take):
        self.wanted.append((topic, msgtype, take))

    def advertise(self, topic, msgtype, quality):
        bus = self.bus
        bus.types[topic] = msgtype

        def send(data):
            bus.raw.setdefault(topic, []).append(data)
            if quality is Quality.LATCHED:
                bus.kept[topic] = data
            for kind, take in bus.takers.get(topic, []):
                if kind == msgtype:
                    take(Record(topic, msgtype, len(bus.raw[topic]), data))

        return SimpleNamespace(send=send, readers=1)

    def listen(self):
        for topic, msgtype, take in self.wanted:
            self.bus.takers.setdefault(topic, []).append((msgtype, take))
            if topic in self.bus.kept:
                take(Record(topic, msgtype, 0, self.bus.kept[topic]))

    def topics(self):
        return dict(self.bus.types)

    def writers(self, topic):
        return self.several

    def close(self):
        self.closed = True
