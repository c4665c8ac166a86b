#!/usr/bin/env python3
"""What decoders that are not ours read from random messages: decoders.py RECORDING NUMBERS

NUMBERS holds what Stillpoint read: for each message of the recording, in its order, the numbers by their paths. Every
decoder that reads a channel's encoding must find the same ones, and no others.
"""

import array
import json
import re
import sys
from collections import Counter

import numpy
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_codec import RosCdrCodec
from mcap_ros1.decoder import DecoderFactory as Ros1
from mcap_ros2.decoder import DecoderFactory as Ros2
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

# What ROS 2 puts into a message without fields, and the constant of every type, which is no field.
NO_FIELDS = ("structure_needs_at_least_one_member", "CONSTANT")


def leaves(value, path=""):
    """Numbers of a decoded message by their paths, truth values and texts left out."""
    if isinstance(value, (bool, numpy.bool_, str)) or value is None:
        return
    if isinstance(value, (int, float, numpy.number)):
        yield path, float(value)
    elif isinstance(value, numpy.ndarray) and value.dtype == bool:
        return
    elif isinstance(value, (list, tuple, bytes, bytearray, memoryview, array.array, numpy.ndarray)):
        for i, element in enumerate(value):
            yield from leaves(element, f"{path}[{i}]")
    else:
        names = value if isinstance(value, dict) else [n for n in names_of(value) if not n.startswith("_")]
        for name in names:
            if name not in NO_FIELDS:
                inner = value[name] if isinstance(value, dict) else getattr(value, name)
                yield from leaves(inner, f"{path}.{name}" if path else name)


def names_of(value):
    return value.__slots__ if hasattr(value, "__slots__") else value.__dataclass_fields__


def decoders(channel, schema, plain):
    """Decoders for a channel, by name; not all read more than plain CDR of the first version."""
    text = schema.data.decode()
    if channel.message_encoding == "ros1":
        yield "mcap-ros1-support", Ros1().decoder_for("ros1", schema)
        yield "rosbags", rosbags(get_types_from_msg(text, "pkg/msg/Root"), "deserialize_ros1")
        return
    if plain and schema.encoding == "ros2msg":
        # It wants the types of fields without `msg`.
        short = Schema(data=text.replace("pkg/msg/", "pkg/").encode(), encoding="ros2msg", id=1, name=schema.name)
        yield "mcap-ros2-support", Ros2().decoder_for("cdr", short)
        yield "rosbags", rosbags(get_types_from_msg(text, "pkg/msg/Root"), "deserialize_cdr")
    if plain and schema.encoding == "ros2idl":
        # It reads one file, includes nothing, and takes an octet to have a sign.
        lines = [line for line in text.splitlines() if not line.startswith(("===", "IDL:", "#"))]
        yield "rosbags", rosbags(get_types_from_idl("\n".join(lines).replace("octet", "uint8")), "deserialize_cdr")
    text = explicit(text) if schema.encoding == "ros2msg" else text
    yield "roboto-mcap-codec", RosCdrCodec(schema.encoding, "cdr", text.encode(), schema.name).decode


def explicit(text):
    """The text with the byte that ROS 2 puts into a message without fields, of which not everybody knows."""
    sections = text.split("=" * 80 + "\n")
    is_empty = [not re.search(r"^[\w/]+(\[.*\])? f\d", section, re.M) for section in sections]
    filler = "uint8 structure_needs_at_least_one_member\n"
    return ("=" * 80 + "\n").join(s + filler if empty else s for s, empty in zip(sections, is_empty))


def rosbags(types, deserialize):
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return lambda data: getattr(store, deserialize)(data, "pkg/msg/Root")


def main(recording, numbers):
    expected = json.load(open(numbers))
    agreed = Counter()
    with open(recording, "rb") as file:
        for (schema, channel, message), ours in zip(make_reader(file).iter_messages(), expected, strict=True):
            identifier = message.data[1] if channel.message_encoding == "cdr" else None
            for name, decode in decoders(channel, schema, identifier in (0, 1)):
                where = f"{name}, {channel.topic}, {schema.encoding}, encapsulation {identifier}"
                try:
                    theirs = dict(leaves(decode(message.data)))
                except ValueError as error:
                    sys.exit(f"{where}: {error}\n{schema.data.decode()}\n{message.data.hex()}")
                differing = {p: (ours.get(p), theirs.get(p)) for p in ours.keys() | theirs.keys() if ours.get(p) != theirs.get(p)}
                if differing:
                    sys.exit(f"{where}: ours and theirs: {differing}\n{schema.data.decode()}\n{message.data.hex()}")
                agreed[f"{name} {schema.encoding} {identifier}"] += 1
    for name, count in sorted(agreed.items()):
        print(f"{name}: {count} messages agree")


main(sys.argv[1], sys.argv[2])
