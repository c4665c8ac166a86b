#!/usr/bin/env python3
"""What decoders that are not ours read from random messages: decoders.py RECORDING NUMBERS

NUMBERS holds what Stillpoint read: for each message of the recording, in its order, the numbers by their paths. Every
decoder that reads a channel's encoding must find the same ones, and no others.
"""

import array
import dataclasses
import json
import re
import sys
import types
from collections import Counter

import numpy
from cyclonedds.idl import IdlStruct
from cyclonedds.idl import types as dds
from cyclonedds.idl.annotations import appendable, final
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_codec import RosCdrCodec
from mcap_ros1.decoder import DecoderFactory as Ros1
from mcap_ros2.decoder import DecoderFactory as Ros2
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

ROOT = "pkg/msg/Root"
RULE = "=" * 80 + "\n"
# What ROS 2 puts into a message without fields.
FILLER = "structure_needs_at_least_one_member"
# That, and the constant of every type, are no fields.
NO_FIELDS = (FILLER, "CONSTANT")


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
    return value.__dataclass_fields__ if dataclasses.is_dataclass(value) else value.__slots__


def decoders(channel, schema, identifier):
    """Decoders for messages of a channel with this encapsulation, by name."""
    text = schema.data.decode()
    if schema.encoding == "ros2idl":
        # rosbags reads one file, includes nothing, and takes an octet to have a sign.
        lines = [line for line in text.splitlines() if not line.startswith(("===", "IDL:", "#"))]
        known = get_types_from_idl("\n".join(lines).replace("octet", "uint8"))
    else:
        known = get_types_from_msg(text, ROOT)
    if channel.message_encoding == "ros1":
        yield "mcap-ros1-support", Ros1().decoder_for("ros1", schema)
        yield "rosbags", rosbags(known, "deserialize_ros1")
    elif identifier > 1:
        # All the others know of the second version is wrong: sizes in front of lists, alignment of eight bytes.
        yield "cyclonedds", cyclonedds(known, text, appendable if identifier > 7 else final)
    else:
        yield "rosbags", rosbags(known, "deserialize_cdr")
        if schema.encoding == "ros2msg":
            # mcap-ros2-support wants the types of fields without `msg`.
            short = Schema(data=text.replace("pkg/msg/", "pkg/").encode(), encoding="ros2msg", id=1, name=schema.name)
            yield "mcap-ros2-support", Ros2().decoder_for("cdr", short)
            text = explicit(text)
        yield "roboto-mcap-codec", RosCdrCodec(schema.encoding, "cdr", text.encode(), schema.name).decode


def explicit(text):
    """The text with the byte that ROS 2 puts into a message without fields, of which not everybody knows."""
    sections = text.split(RULE)
    is_empty = [not re.search(r"^[\w/]+(\[.*\])? f\d", section, re.M) for section in sections]
    return RULE.join(s + f"uint8 {FILLER}\n" if empty else s for s, empty in zip(sections, is_empty))


def rosbags(known, deserialize):
    store = get_typestore(Stores.EMPTY)
    store.register(known)
    return lambda data: getattr(store, deserialize)(data, ROOT)


def cyclonedds(known, text, unsaid):
    """Types of Cyclone DDS with the fields that rosbags understood; `unsaid` are those without annotation."""
    said = {name: {"final": final, "appendable": appendable}[kind] for kind, name in re.findall(r"@(final|appendable) struct (\w+)", text)}
    base = {"bool": bool, "string": str, "byte": dds.uint8, "char": dds.uint8} | {
        name: getattr(dds, name) for name in "int8 uint8 int16 uint16 int32 uint32 int64 uint64 float32 float64".split()
    }
    made = {}

    def kind(described):
        node, of = described
        match node.name:
            case "BASE":
                return base[of[0]]
            case "NAME":
                return struct(of)
            case "ARRAY":
                return dds.array[kind(of[0]), of[1]]
            case "SEQUENCE":
                return dds.sequence[kind(of[0])]

    def struct(name):
        if name not in made:
            fields = {field: kind(described) for field, described in known[name][1]} or {FILLER: dds.uint8}
            short = name.rsplit("/", 1)[1]
            new = types.new_class(short, (IdlStruct,), {"typename": short}, lambda body: body.update(__annotations__=fields))
            made[name] = said.get(short, unsaid)(dataclasses.dataclass(new))
        return made[name]

    return struct(ROOT).deserialize


def main(recording, numbers):
    expected = json.load(open(numbers))
    agreed = Counter()
    with open(recording, "rb") as file:
        for (schema, channel, message), ours in zip(make_reader(file).iter_messages(), expected, strict=True):
            identifier = message.data[1] if channel.message_encoding == "cdr" else None
            for name, decode in decoders(channel, schema, identifier):
                where = f"{name}, {channel.topic}, {schema.encoding}, encapsulation {identifier}"
                try:
                    theirs = dict(leaves(decode(message.data)))
                except Exception as error:
                    sys.exit(f"{where}: {error}\n{schema.data.decode()}\n{message.data.hex()}")
                differing = {p: (ours.get(p), theirs.get(p)) for p in ours.keys() | theirs.keys() if ours.get(p) != theirs.get(p)}
                if differing:
                    sys.exit(f"{where}: ours and theirs: {differing}\n{schema.data.decode()}\n{message.data.hex()}")
                agreed[f"{name} {schema.encoding} {identifier}"] += 1
    for name, count in sorted(agreed.items()):
        print(f"{name}: {count} messages agree")


main(sys.argv[1], sys.argv[2])
