#!/usr/bin/env python3
"""Reads the annotations of MCAP files with the public Python readers, by the schemas in the files alone.

    annotations.py FILE [FILE]

ROS 2 annotations are decoded by mcap-ros2-support and by rosbags, protobuf ones by mcap-protobuf-support. Of two files
holding the same annotations in different encodings, every value is compared.
"""

import dataclasses
import math
import sys
from collections import Counter, defaultdict
from pathlib import Path

from google.protobuf.message import Message
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoder
from mcap_ros2.decoder import DecoderFactory as Ros2Decoder
from rosbags.highlevel import AnyReader

ABSENT = "absent"
LOG = "/stillpoint/log"
DECODERS = {"cdr": Ros2Decoder, "protobuf": ProtobufDecoder}
ENCODINGS = {"cdr": "ros2msg", "protobuf": "protobuf"}


def main(paths):
    files = [annotations(Path(path)) for path in paths]
    for path, topics in zip(paths, files):
        count = sum(len(messages) for messages in topics.values())
        check(count > 0, f"{path}: no annotations")
        print(f"{path}: {count} annotations on {len(topics)} topics decoded")
    for path, topics in zip(paths[1:], files[1:]):
        same(files[0], topics, f"{paths[0]} and {path}")
        print(f"{paths[0]} and {path} say the same")


def annotations(path):
    """Messages by topic, each as nested dicts of plain values."""
    topics, sequences, encodings, last = defaultdict(list), Counter(), set(), defaultdict(int)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        profile = reader.get_header().profile
        decoders = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if "/stillpoint/" not in channel.topic or channel.topic.endswith("/corrected"):
                continue
            where = f"{path}: {channel.topic}, message {sequences[channel.topic]}"
            check(ENCODINGS.get(channel.message_encoding) == schema.encoding, f"{where}: {schema.encoding}")
            check(message.sequence == sequences[channel.topic], f"{where}: sequence {message.sequence}")
            check(message.publish_time == message.log_time, f"{where}: publish time")
            check(message.log_time >= last[channel.topic], f"{where}: log time runs backward")
            if channel.id not in decoders:
                factory = DECODERS[channel.message_encoding]()
                decoders[channel.id] = factory.decoder_for(channel.message_encoding, schema)
            plain = plain_protobuf if channel.message_encoding == "protobuf" else plain_ros2
            value = plain(decoders[channel.id](message.data))
            check(channel.topic == LOG or "stamp" in value["header"], f"{where}: no header.stamp")
            topics[channel.topic].append(value)
            sequences[channel.topic] += 1
            encodings.add(channel.message_encoding)
            last[channel.topic] = message.log_time
    check(len(encodings) <= 1, f"{path}: encodings are mixed: {encodings}")
    if encodings == {"cdr"} and profile == "ros2":
        same(topics, by_rosbags(path), f"{path} by mcap-ros2-support and by rosbags")
    return topics


def by_rosbags(path):
    topics = defaultdict(list)
    with AnyReader([path]) as reader:
        wanted = [c for c in reader.connections if "/stillpoint/" in c.topic and not c.topic.endswith("/corrected")]
        for connection, _, data in reader.messages(connections=wanted):
            topics[connection.topic].append(plain_ros2(reader.deserialize(data, connection.msgtype)))
    return topics


def plain_ros2(value):
    if dataclasses.is_dataclass(value):  # a message, by rosbags
        names = [field.name for field in dataclasses.fields(value) if field.name[0].islower()]  # no constants
    elif hasattr(value, "_type"):  # a message, by mcap-ros2-support
        names = value.__slots__
    elif isinstance(value, (str, bool, int, float)):
        return value
    else:
        return [plain_ros2(element) for element in getattr(value, "tolist", lambda: value)()]
    # rosbags puts an underscore behind names that Python reserves.
    plain = {name.rstrip("_"): plain_ros2(getattr(value, name)) for name in names}
    return plain["sec"] + plain["nanosec"] * 1j if set(plain) == {"sec", "nanosec"} else plain


def plain_protobuf(message):
    if message.DESCRIPTOR.full_name == "google.protobuf.Timestamp":
        return message.seconds + message.nanos * 1j
    plain = {}
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        if field.is_repeated:
            plain[field.name] = [plain_protobuf(e) if isinstance(e, Message) else e for e in value]
        elif field.has_presence and not message.HasField(field.name):
            plain[field.name] = ABSENT
        else:
            plain[field.name] = plain_protobuf(value) if isinstance(value, Message) else value
    return plain


def same(first, second, where):
    check(set(first) == set(second), f"{where}: topics {sorted(first)} and {sorted(second)}")
    for topic in first:
        one, other = first[topic], second[topic]
        if topic == LOG:
            one, other = ([common_log(message) for message in messages] for messages in (one, other))
        compare(one, other, f"{where}: {topic}")


def common_log(log):
    """What the logs of ROS 2 and Foxglove have in common, in the words of ROS 2."""
    if "msg" in log:
        return log
    level = 10 * log["level"]
    named = {"stamp": log["timestamp"], "level": level, "msg": log["message"], "function": ""}
    return named | {name: log[name] for name in ("name", "file", "line")}


def compare(one, other, where):
    if one == ABSENT or other == ABSENT:
        check(is_nothing(one) and is_nothing(other), f"{where}: {one} and {other}")
    elif isinstance(one, dict):
        check(set(one) == set(other), f"{where}: fields {sorted(one)} and {sorted(other)}")
        for name in one:
            compare(one[name], other[name], f"{where}.{name}")
    elif isinstance(one, list):
        check(len(one) == len(other), f"{where}: {len(one)} and {len(other)} elements")
        for index, pair in enumerate(zip(one, other)):
            compare(*pair, f"{where}[{index}]")
    else:
        nan = isinstance(one, float) and isinstance(other, float) and math.isnan(one) and math.isnan(other)
        check(nan or one == other, f"{where}: {one!r} and {other!r}")


def is_nothing(value):
    """Whether it is how an encoding says that there is nothing: absent, or NaN in every float and zero in the rest."""
    if isinstance(value, dict):
        return all(is_nothing(part) for part in value.values())
    return value == ABSENT or (math.isnan(value) if isinstance(value, float) else not value)


def check(holds, complaint):
    if not holds:
        sys.exit(complaint)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1:])
