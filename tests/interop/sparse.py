"""A recording in which each chunk holds one topic, and most of the bytes are a camera's."""

import random

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer


def sparse(source, target, camera=40_000, seconds=1.0, seed=1):
    """Writes the messages of a recording anew: chunks of so many seconds of each topic, uncompressed, and `camera` bytes of
    images for each tenth of a second."""
    with open(source, "rb") as file:
        messages = list(make_reader(file).iter_messages())
    noise = random.Random(seed)
    first = messages[0][2].log_time
    with open(target, "wb") as file:
        writer = Writer(file, chunk_size=1 << 40, compression=CompressionType.NONE)
        writer.start(profile="ros2")
        channels = {}
        image = writer.register_schema("sensor_msgs/msg/CompressedImage", "ros2msg", b"uint8[] data")
        image = writer.register_channel("/camera/image/compressed", "cdr", image)

        def close():
            # Python's writer closes a chunk by its size alone.
            writer._Writer__finalize_chunk()

        groups = {}
        for schema, channel, message in messages:
            group = int((message.log_time - first) * 1e-9 / seconds)
            groups.setdefault(group, {}).setdefault(channel.topic, []).append((schema, channel, message))
        for group, topics in sorted(groups.items()):
            for topic, entries in topics.items():
                for schema, channel, message in entries:
                    if topic not in channels:
                        known = writer.register_schema(schema.name, schema.encoding, schema.data)
                        channels[topic] = writer.register_channel(topic, channel.message_encoding, known)
                    writer.add_message(channels[topic], message.log_time, message.data, message.publish_time)
                close()
            for tenth in range(int(10 * seconds)):
                at = first + int((group * seconds + tenth / 10) * 1e9)
                writer.add_message(image, at, noise.randbytes(camera), at)
            close()
        writer.finish()


def used(path, is_used=lambda topic: topic.startswith("/imu")):
    """Number of chunks with such topics, their bytes with their message indexes, and those of the summary."""
    with open(path, "rb") as file:
        summary = make_reader(file).get_summary()
        file.seek(-8 - 20, 2)
        footer = file.read(20)
        length = file.seek(0, 2)
    start = int.from_bytes(footer[:8], "little")
    topics = {id: channel.topic for id, channel in summary.channels.items()}
    chunks = [c for c in summary.chunk_indexes if any(is_used(topics[id]) for id in c.message_index_offsets)]
    return len(chunks), sum(c.chunk_length + c.message_index_length for c in chunks), length - start
