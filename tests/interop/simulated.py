"""Python readers decode every encoding of one simulated session to the same numbers.

usage: simulated.py DIRECTORY

The directory holds one session as ros2.mcap, ros1.mcap, protobuf.mcap and json.mcap. JSON prints every number so that
it reads back exactly: it is what the others are compared with.
"""

import json
import sys
from collections import defaultdict
from pathlib import Path

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros1.decoder import DecoderFactory as Ros1
from mcap_ros2.decoder import DecoderFactory as Ros2
from rosbags.highlevel import AnyReader


def xyz(vector):
    return (vector.x, vector.y, vector.z)


def ros(message):
    stamp = message.header.stamp
    nanos = stamp.sec * 10**9 + stamp.nanosec if hasattr(stamp, "nanosec") else stamp.secs * 10**9 + stamp.nsecs
    assert message.header.frame_id == "imu_link"
    if hasattr(message, "vector"):
        return nanos, xyz(message.vector)
    assert message.orientation_covariance[0] == -1
    return nanos, xyz(message.linear_acceleration) + xyz(message.angular_velocity)


def protobuf(message):
    assert message.frame_id == "imu_link"
    gyro = xyz(message.gyro) if "gyro" in message.DESCRIPTOR.fields_by_name else ()
    return message.stamp.ToNanoseconds(), xyz(message.accel) + gyro


def from_json(message):
    assert message["frame_id"] == "imu_link"
    stamp = message["stamp"]
    vectors = [message["accel"]] + ([message["gyro"]] if "gyro" in message else [])
    return stamp["sec"] * 10**9 + stamp["nsec"], tuple(vector[axis] for vector in vectors for axis in "xyz")


class Json:
    def decoder_for(self, encoding, schema):
        return json.loads if encoding == "json" else None


def decoded(path, factory, numbers):
    topics = defaultdict(list)
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[factory])
        for _, channel, message, content in reader.iter_decoded_messages():
            nanos, values = numbers(content)
            assert nanos == message.log_time == message.publish_time
            assert message.sequence == len(topics[channel.topic])
            topics[channel.topic].append((nanos, values))
    return topics


def through_rosbags(path):
    topics = defaultdict(list)
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            topics[connection.topic].append(ros(reader.deserialize(data, connection.msgtype)))
    return topics


def main(directory):
    expected = decoded(directory / "json.mcap", Json(), from_json)
    messages = sum(map(len, expected.values()))
    assert messages > 0
    for name, factory, numbers in [("ros2", Ros2(), ros), ("ros1", Ros1(), ros), ("protobuf", Protobuf(), protobuf)]:
        assert decoded(directory / f"{name}.mcap", factory, numbers) == expected, name
        print(f"{name}: {messages} messages on {len(expected)} topics, the same numbers as json")
    assert through_rosbags(directory / "ros2.mcap") == expected, "rosbags"
    print("ros2 through rosbags: the same")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
