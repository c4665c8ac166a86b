#!/usr/bin/env python3
"""What programs that are not ours read from the real recordings, as one checksum a topic.

    decode_recordings.py RECORDINGS            prints the checksums
    decode_recordings.py RECORDINGS EXPECTED   fails unless they are what the file says

Every decoder that reads a recording must read the same from each of its messages: mcap-ros2-support, mcap-ros1-support,
mcap-protobuf-support, rosbags, roboto-mcap-codec. tests/decoding/recordings.rs holds Stillpoint's own against the file.
"""

import json
import struct
import sys
import zlib
from pathlib import Path

from mcap.reader import make_reader
from mcap_codec import RosCdrCodec
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros1.decoder import DecoderFactory as Ros1
from mcap_ros2.decoder import DecoderFactory as Ros2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

# Stamp, then the vectors in the order in which Stillpoint takes samples, with the pair of names of the stamp's parts.
FIELDS = {
    "sensor_msgs/Imu": ("header.stamp", ["angular_velocity", "linear_acceleration"]),
    "geometry_msgs/Vector3Stamped": ("header.stamp", ["vector"]),
    "acme.sensors.InertialSample": ("stamp", ["gyro_radps", "accel_mps2"]),
    "ImuSample": ("timestamp", ["angular_velocity", "linear_acceleration"]),
}
STAMPS = [("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec"), ("seconds", "nanos")]


def get(message, path):
    for name in path.split("."):
        message = message[name] if isinstance(message, dict) else getattr(message, name)
    return message


def has(message, name):
    return name in message if isinstance(message, dict) else hasattr(message, name)


def numbers(message, kind):
    """Nanoseconds, then the axes of each vector."""
    stamp, vectors = FIELDS[kind]
    stamp = get(message, stamp)
    seconds, nanos = next(names for names in STAMPS if has(stamp, names[0]) and has(stamp, names[1]))
    stamp = int(get(stamp, seconds)) * 1_000_000_000 + int(get(stamp, nanos))
    return stamp, [tuple(float(get(message, f"{vector}.{axis}")) for axis in "xyz") for vector in vectors]


def decoders(schema, channel):
    """Each by its own name; the first makes the checksum."""
    name = schema.name if "/msg/" in schema.name else schema.name.replace("/", "/msg/")
    store = get_typestore(Stores.EMPTY)
    if channel.message_encoding in ("cdr", "ros1"):
        store.register(get_types_from_msg(schema.data.decode(), name))
    match channel.message_encoding:
        case "cdr":
            yield Ros2().decoder_for("cdr", schema)
            yield lambda data: store.deserialize_cdr(data, name)
            yield RosCdrCodec("ros2msg", "cdr", schema.data, schema.name).decode
        case "ros1":
            yield Ros1().decoder_for("ros1", schema)
            yield lambda data: store.deserialize_ros1(data, name)
        case "protobuf":
            yield Protobuf().decoder_for("protobuf", schema)
        case "json":
            yield json.loads


def lines(folder):
    for path in sorted(folder.rglob("*.mcap")):
        sums, known = {}, {}
        with open(path, "rb") as file:
            for schema, channel, message in make_reader(file).iter_messages(log_time_order=False):
                kind = schema.name.replace("/msg/", "/")
                if kind not in FIELDS:
                    continue
                if channel.id not in known:
                    known[channel.id] = list(decoders(schema, channel))
                read, *others = [numbers(decode(message.data), kind) for decode in known[channel.id]]
                if any(other != read for other in others):
                    sys.exit(f"{path.name}, {channel.topic}: decoders disagree: {read}, {others}")
                stamp, vectors = read
                count, crc = sums.get(channel.topic, (0, 0))
                for vector in vectors:
                    crc = zlib.crc32(struct.pack("<qQddd", stamp, message.log_time, *vector), crc)
                    count += 1
                sums[channel.topic] = (count, crc)
        for topic, (count, crc) in sorted(sums.items()):
            yield f"{path.name} {topic} {count} {crc:08x}\n"


def main():
    found = "".join(lines(Path(sys.argv[1])))
    if len(sys.argv) < 3:
        print(found, end="")
    elif found != Path(sys.argv[2]).read_text():
        sys.exit(f"{sys.argv[2]} is not what the decoders read:\n{found}")


main()
