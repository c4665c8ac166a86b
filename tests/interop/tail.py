"""Writers in Python record a real session while `stillpoint tail` follows; its result must be the batch run's.

usage: tail.py STILLPOINT RECORDING [SPEED]

The recording is a ROS 2 one. It is recorded anew by Python's mcap and by rosbags, so many times faster than it was
(200 times, unless told otherwise), with the tail started before the file exists, while it is empty, and half-way.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagWriter
from rosbags.typesys import Stores, get_typestore


def paced(messages, speed):
    """The messages, each when it is due."""
    began, first = time.monotonic(), messages[0][2].log_time
    for message in messages:
        due = began + (message[2].log_time - first) * 1e-9 / speed
        if due > time.monotonic() + 0.001:
            time.sleep(due - time.monotonic())
        yield message


def record_mcap(path, messages, compression, speed):
    with open(path, "wb") as file:
        writer = Writer(file, chunk_size=16384, compression=compression)
        writer.start(profile="ros2")
        channels = {}
        for schema, channel, message in paced(messages, speed):
            if channel.id not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, known)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()


def record_rosbag(path, messages, compression, speed):
    store = get_typestore(Stores.ROS2_JAZZY)
    writer = RosbagWriter(path.parent, version=9, storage_plugin=StoragePlugin.MCAP)
    if compression:
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for schema, channel, message in paced(messages, speed):
            if channel.topic not in connections:
                connections[channel.topic] = writer.add_connection(channel.topic, schema.name, typestore=store)
            writer.write(connections[channel.topic], message.log_time, message.data)


def files(path):
    """What a result consists of."""
    parts = sorted(path.iterdir()) if path.is_dir() else [path]
    return [(part.name if path.is_dir() else "", part.read_bytes()) for part in parts]


def follow(stillpoint, record, start, name, count, whole_folder=False):
    """Follows what `record` writes, and compares the result with the batch run's."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bag" / "bag.mcap"
        followed = path.parent if whole_folder else path
        result, batch = Path(folder) / "result", Path(folder) / "batch"
        if start == "empty":
            path.parent.mkdir()
            path.touch()
        tail = [stillpoint, "tail", followed, "-o", result, "--json", "-q"]
        recorder = subprocess.Popen([sys.executable, __file__, "record", *record, path])
        if start == "half-way":
            while not path.exists() or path.stat().st_size < 200_000 and recorder.poll() is None:
                time.sleep(0.002)
        run = subprocess.run(tail, capture_output=True, text=True, timeout=600)
        assert recorder.wait() == 0
        assert run.returncode == 0, (name, run.stderr)
        assert json.loads(run.stdout.splitlines()[-1])["messages"] == count, name
        subprocess.run([stillpoint, "annotate", followed, "-o", batch, "-q"], check=True)
        assert files(result) == files(batch), f"{name}: tail and batch differ"
        print(f"{name}: the same {sum(len(data) for _, data in files(result))} bytes")


def messages_of(recording):
    with open(recording, "rb") as file:
        return list(make_reader(file).iter_messages(log_time_order=False))


def main(stillpoint, recording, speed="200"):
    count = len(messages_of(recording))
    for compression in (CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD):
        for start in ("before", "empty", "half-way"):
            record = [recording, "mcap", compression.name, speed]
            follow(stillpoint, record, start, f"mcap {compression.name} {start}", count)
    for compression in ("", "zstd"):
        for start in ("before", "half-way"):
            for whole_folder in (False, True):
                name = f"rosbags {compression} {start}{' as a folder' if whole_folder else ''}"
                follow(stillpoint, [recording, "rosbags", compression, speed], start, name, count, whole_folder)


if __name__ == "__main__":
    if sys.argv[1] == "record":
        recording, writer, compression, speed, path = sys.argv[2:]
        path, messages = Path(path), messages_of(recording)
        # The tail is there first.
        time.sleep(0.3)
        if writer == "mcap":
            path.parent.mkdir(exist_ok=True)
            record_mcap(path, messages, CompressionType[compression], float(speed))
        else:
            record_rosbag(path, messages, compression, float(speed))
    else:
        main(*sys.argv[1:])
