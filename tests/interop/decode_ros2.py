#!/usr/bin/env python3
"""What mcap-ros2-support reads from the real ROS 2 recordings, as one checksum a topic.

    decode_ros2.py RECORDINGS            prints the checksums
    decode_ros2.py RECORDINGS EXPECTED   fails unless they are what the file says

tests/decoding/recordings.rs holds Stillpoint's own decoder against the same file.
"""

import struct
import sys
import zlib
from pathlib import Path

from mcap_ros2.reader import read_ros2_messages


def vectors(kind, message):
    """The vectors of a message in the order in which Stillpoint takes samples."""
    if kind == "sensor_msgs/msg/Imu":
        return [message.angular_velocity, message.linear_acceleration]
    return [message.vector]


def lines(folder):
    for path in sorted(folder.glob("*.ros2.mcap")):
        sums = {}
        for record in read_ros2_messages(path):
            message = record.ros_msg
            stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
            count, crc = sums.get(record.channel.topic, (0, 0))
            for v in vectors(record.schema.name, message):
                crc = zlib.crc32(struct.pack("<qQddd", stamp, record.log_time_ns, v.x, v.y, v.z), crc)
                count += 1
            sums[record.channel.topic] = (count, crc)
        for topic, (count, crc) in sorted(sums.items()):
            yield f"{path.name} {topic} {count} {crc:08x}\n"


def main():
    found = "".join(lines(Path(sys.argv[1])))
    if len(sys.argv) < 3:
        print(found, end="")
    elif found != Path(sys.argv[2]).read_text():
        sys.exit(f"{sys.argv[2]} is not what mcap-ros2-support reads:\n{found}")


main()
