"""Viewers of a live tail, none of them ours: python live.py STILLPOINT RECORDING [RECEIVED]

A recording is copied piece by piece while `stillpoint tail --live` follows it. A client written with `websockets` must
receive every annotation, byte for byte as it is in the annotated recording, and the time; one that joins late must
receive the last state, coverage and calibration at once. Fifty slow and rude ones (half-open, silent, garbage,
flooding) must neither delay the tail nor make it grow. RECEIVED is written with what arrived, for viewers to open.
Then `stillpoint watch --live` shows two recordings that grow at a time, and one after them.
"""

import asyncio, collections, json, os, re, socket, struct, subprocess, sys, tempfile, time
from pathlib import Path

import websockets
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2._dynamic import generate_dynamic

PROTOCOL = websockets.Subprotocol("foxglove.sdk.v1")
STANDING = ("stillness", "coverage", "calibration")
CROWD = 50


class Viewer:
    """Subscribes to everything that is advertised, and keeps it."""

    def __init__(self, port):
        self.url = f"ws://127.0.0.1:{port}"
        self.channels, self.times, self.first = {}, [], {}
        self.messages = collections.defaultdict(set)

    async def run(self):
        async with websockets.connect(self.url, subprotocols=[PROTOCOL], max_size=None) as connection:
            try:
                async for message in connection:
                    await self.take(connection, message)
            except websockets.ConnectionClosed:
                pass

    async def take(self, connection, message):
        if isinstance(message, str):
            message = json.loads(message)
            assert message["op"] != "status", message
            if message["op"] == "serverInfo":
                assert "time" in message["capabilities"], message
            if message["op"] == "advertise":
                self.channels.update((channel["id"], channel) for channel in message["channels"])
                new = [{"id": channel["id"], "channelId": channel["id"]} for channel in message["channels"]]
                await connection.send(json.dumps({"op": "subscribe", "subscriptions": new}))
        elif message[0] == 1:
            id, log_time = struct.unpack_from("<IQ", message, 1)
            topic = self.channels[id]["topic"]
            self.messages[topic].add((log_time, bytes(message[13:])))
            self.first.setdefault(topic, time.monotonic())
        elif message[0] == 2:
            self.times.append(struct.unpack_from("<Q", message, 1)[0])


async def rude(port, kind):
    """Until it is thrown out, or cancelled."""
    try:
        if kind == 0:  # half-open: a connection, and no word
            with socket.create_connection(("127.0.0.1", port)):
                await asyncio.sleep(600)
        if kind == 1:  # no WebSocket at all
            _, writer = await asyncio.open_connection("127.0.0.1", port)
            while True:
                writer.write(os.urandom(4096))
                await writer.drain()
                await asyncio.sleep(0.05)
        async with websockets.connect(f"ws://127.0.0.1:{port}", subprotocols=[PROTOCOL], max_size=None) as client:
            if kind == 2:  # subscribes to everything, reads nothing
                client.transport.pause_reading()
                subscriptions = [{"id": id, "channelId": id} for id in range(1, 20)]
                while True:
                    await client.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
                    await asyncio.sleep(0.5)
            while True:  # garbage, and a flood of it
                await client.send(os.urandom(2000) if kind == 3 else json.dumps({"op": "subscribe", "subscriptions": "?"}))
                await asyncio.sleep(0.01)
    except (OSError, websockets.WebSocketException):
        pass


async def be_rude(port, count):
    await asyncio.gather(*(rude(port, i % 5) for i in range(count)))


async def start(stillpoint, command, folder):
    """The program, how to read what it said, and the port that viewers connect to."""
    with (folder / "stderr").open("w") as stderr:
        options = ["--live", "127.0.0.1:0", "--set", "output.corrected=causal"]
        running = subprocess.Popen([stillpoint, *command, *options], stderr=stderr)
    said = lambda: (folder / "stderr").read_text()
    while not (address := re.search(r"ws://127\.0\.0\.1:(\d+)", said())):
        assert running.poll() is None, said()
        await asyncio.sleep(0.01)
    return running, said, int(address[1])


def read(annotated, written):
    with annotated.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            written[channel.topic].add((message.log_time, bytes(message.data)))


def all_arrived(viewer, written):
    annotations = [topic for topic in written if "/stillpoint/" in topic]
    assert any(topic.endswith("corrected") for topic in annotations), annotations
    for topic in annotations:
        missing = [i for i, message in enumerate(sorted(written[topic])) if message not in viewer.messages[topic]]
        assert viewer.messages[topic] == written[topic], (topic, missing[:9], len(missing), len(written[topic]))
    return annotations


async def follow(stillpoint, recording, crowd):
    with tempfile.TemporaryDirectory() as folder:
        growing = Path(folder) / "growing.mcap"
        growing.touch()
        tail, said, port = await start(stillpoint, ["tail", growing], Path(folder))
        viewer, late = Viewer(port), Viewer(port)
        viewing = [asyncio.create_task(viewer.run())]
        # A process of its own, lest it hold up the viewer.
        others = subprocess.Popen([sys.executable, __file__, "--rude", str(port), str(crowd)])
        await asyncio.sleep(1.5)
        data, began, joined = recording.read_bytes(), time.monotonic(), None
        step = len(data) // 100 + 1
        with growing.open("ab", buffering=0) as out:
            for i in range(0, len(data) - step, step):
                out.write(data[i : i + step])
                await asyncio.sleep(0.08)
            # Nothing is recorded for a while: what the late one is given is not new.
            await asyncio.sleep(0.5)
            joined, stands = time.monotonic(), {topic: max(messages) for topic, messages in viewer.messages.items()}
            viewing.append(asyncio.create_task(late.run()))
            await asyncio.sleep(1)
            memory = int(re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{tail.pid}/status").read_text())[1])
            given = {topic: set(messages) for topic, messages in late.messages.items()}
            out.write(data[i + step :])
        while tail.poll() is None:
            await asyncio.sleep(0.01)
        seconds = time.monotonic() - began
        await asyncio.wait_for(asyncio.gather(*viewing), 30)
        others.kill()
        others.wait()
        assert tail.returncode == 0, said()
        written = collections.defaultdict(set)
        read(Path(folder) / "growing.annotated.mcap", written)
        return viewer, late, (given, stands), joined, written, memory, seconds


async def watch(stillpoint):
    """Three copies of a recording grow in a folder, two of them at a time; their clocks are a day apart."""
    with tempfile.TemporaryDirectory() as folder:
        recordings, results = Path(folder) / "recordings", Path(folder) / "results"
        recordings.mkdir()
        command = ["watch", recordings, "--out-dir", results, "--interval", "50ms"]
        watching, said, port = await start(stillpoint, command, Path(folder))
        viewer = Viewer(port)
        viewing = asyncio.create_task(viewer.run())
        written = collections.defaultdict(set)

        async def grow(day):
            path, result = recordings / f"{day}.mcap", results / f"{day}.annotated.mcap"
            simulate = [stillpoint, "simulate", "demo", "-o", Path(folder) / f"{day}.mcap", "-q"]
            settings = ["--set", f"recording.seed={day}", "--set", f"recording.start_s={1_700_000_000 + 86_400 * day}"]
            await asyncio.to_thread(subprocess.run, [*simulate, *settings], check=True)
            data = (Path(folder) / f"{day}.mcap").read_bytes()
            with path.open("ab", buffering=0) as out:
                for i in range(0, len(data), len(data) // 20):
                    out.write(data[i : i + len(data) // 20])
                    await asyncio.sleep(0.1)
            while not result.exists():
                assert watching.poll() is None, said()
                await asyncio.sleep(0.05)

        await asyncio.gather(grow(1), grow(2))
        await grow(3)
        watching.terminate()
        assert await asyncio.to_thread(watching.wait, 20) == 0, said()
        await asyncio.wait_for(viewing, 30)
        for result in results.glob("*.annotated.mcap"):
            read(result, written)
        count = sum(len(viewer.messages[topic]) for topic in all_arrived(viewer, written))
        print(f"{count} annotations of three watched recordings arrived")


def check_late(late, given, joined, written):
    given, stands = given
    for name in STANDING:
        topics = [topic for topic in written if topic.endswith(f"/stillpoint/{name}")]
        assert topics
        for topic in topics:
            assert late.first[topic] - joined < 1.0, (topic, late.first[topic] - joined)
            assert stands[topic] in given[topic], (topic, len(given[topic]))


def check_diagnostics(viewer):
    channel = next(channel for channel in viewer.channels.values() if channel["topic"] == "/diagnostics")
    assert channel["schemaName"] == "diagnostic_msgs/msg/DiagnosticArray", channel
    decode = generate_dynamic(channel["schemaName"], channel["schema"])["diagnostic_msgs/msg/DiagnosticArray"]
    last = decode(max(viewer.messages["/diagnostics"])[1])
    said = {status.name: status.message for status in last.status}
    assert said["stillpoint: recording"] == "undamaged", said
    assert any(name.endswith("calibration") and "provisional" in said[name] for name in said), said
    assert any(name.endswith("faces") and said[name] == "6 of 6 seen" for name in said), said
    values = {value.key: value.value for status in last.status for value in status.values}
    assert len(values["bias, m/s²"].split()) == 3, values
    return len(viewer.messages["/diagnostics"])


def keep(viewer, path):
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for channel in viewer.channels.values():
            schema = writer.register_schema(channel["schemaName"], channel["schemaEncoding"], channel["schema"].encode())
            id = writer.register_channel(channel["topic"], channel["encoding"], schema)
            for sequence, (log_time, data) in enumerate(sorted(viewer.messages[channel["topic"]])):
                writer.add_message(id, log_time, data, log_time, sequence)
        writer.finish()


async def main(stillpoint, recording, received=None):
    *_, alone, quick = await follow(stillpoint, recording, 0)
    viewer, late, given, joined, written, memory, seconds = await follow(stillpoint, recording, CROWD)
    annotations = all_arrived(viewer, written)
    sources = [topic for topic in viewer.messages if "/stillpoint/" not in topic and topic != "/diagnostics"]
    assert sources and all(viewer.messages[topic] <= written[topic] for topic in sources)
    assert all(len(viewer.messages[topic]) > 0.9 * len(written[topic]) for topic in sources)
    assert viewer.times == sorted(viewer.times) and len(viewer.times) > 50, len(viewer.times)
    first = min(log_time for messages in written.values() for log_time, _ in messages)
    last = max(log_time for topic in annotations for log_time, _ in written[topic])
    # The viewer was there before the recording: a time from before would be where its plots begin.
    assert first <= viewer.times[0] < first + 2e9, (viewer.times[0], first)
    assert viewer.times[-1] == last, (viewer.times[-1], last)
    check_late(late, given, joined, written)
    diagnostics = check_diagnostics(viewer)
    if received:
        keep(viewer, received)
    # The crowd's own work on the same cores is not the tail's.
    assert seconds < 3 * quick + 3, (seconds, quick)
    assert memory < alone + 48 * 1024, (memory, alone)
    count = sum(len(viewer.messages[topic]) for topic in annotations)
    print(f"{count} annotations arrived, {len(viewer.times)} times, {diagnostics} diagnostics; "
          f"alone {quick:.1f} s and {alone >> 10} MiB, in a crowd of {CROWD} {seconds:.1f} s and {memory >> 10} MiB")


if sys.argv[1] == "--rude":
    asyncio.run(be_rude(*map(int, sys.argv[2:])))
else:
    asyncio.run(main(sys.argv[1], *map(Path, sys.argv[2:])))
    asyncio.run(watch(sys.argv[1]))
