"""What programs that are not ours make of Stillpoint's outputs: interop.py STILLPOINT

For every real recording: pymcap-cli doctor, Python mcap with CRC validation (every original message is there with the
same bytes, channel and times), the annotations decoded by the schema in the file, @mcap/core, rosbags, and strip; the
same in place and with corrected messages, which are decoded beside their sources; the containers of other writers; and
what becomes of an annotated recording that another program has edited.
"""

import contextlib
import functools
import io
import json
import os
import subprocess
import sys
from collections import Counter
from multiprocessing import Pool
from pathlib import Path

from mcap.decoder import DecoderFactory
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.records import Channel, Message
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoder
from mcap_ros1.decoder import DecoderFactory as Ros1Decoder
from mcap_ros2.decoder import DecoderFactory as RosDecoder
from pymcap_cli.cmd.doctor_cmd import doctor
from rosbags.highlevel import AnyReader

HERE = Path(__file__).resolve().parent
BIN = Path(sys.executable).parent
SETTINGS = {
    "nilspod_six_face.ros2": 'imu=[{topic="/imu/data_raw", secondary=[{name="highg", topic="/highg/acceleration"}]}]',
}
PAIR = 'imu=[{topic="%s", accel="%s", gyro="%s"}]'
# Types that are not known are mapped.
for stem in ("nilspod_six_face.protobuf", "mpu9150_1_20_poses.protobuf"):
    SETTINGS[stem] = PAIR % ("/sensors/imu", "accel_mps2", "gyro_radps")
SETTINGS["nilspod_six_face.json"] = PAIR % ("/imu", "linear_acceleration", "angular_velocity")
# Outputs that must hold a calibration of the accelerometer, so that an empty result cannot pass.
CALIBRATED = {
    "nilspod_six_face.ros2",
    "nilspod_six_face.ros1",
    "nilspod_six_face.protobuf",
    "nilspod_six_face.json",
    "mpu9150_0_19_poses.ros2",
    "mpu9150_1_20_poses.protobuf",
    "xsens_38_poses.ros2",
}


def main(stillpoint):
    data = Path(os.environ["STILLPOINT_DATA"])
    recordings = sorted((data / "recordings").glob("*.mcap"))
    containers = sorted((data / "containers").rglob("*.mcap"))
    assert recordings and containers, "no recordings"
    out = HERE.parent / "target/ci/out"
    out.mkdir(parents=True, exist_ok=True)
    with Pool() as pool:
        for line in pool.imap(check_recording, [(stillpoint, recording, out) for recording in recordings]):
            print(line, flush=True)
        pool.starmap(check_container, [(stillpoint, container, out) for container in containers], chunksize=4)
    check_edited(stillpoint, data / "recordings/nilspod_six_face.ros2.mcap", out)


def check_recording(task):
    stillpoint, recording, out = task
    name = recording.stem
    annotated, sidecar = out / f"{name}.annotated.mcap", out / f"{name}.stillpoint.mcap"
    for path, options in ((annotated, []), (sidecar, ["--sidecar"])):
        imus = annotate(stillpoint, recording, path, options)
        check_doctor(recording, path)
        if imus:
            check_decodes(path)
        check_javascript(path)
    added = check_messages(recording, annotated)
    assert added == Counter(t for t, *_ in messages(sidecar)), "annotations differ between file and sidecar"
    check_rosbags(recording, annotated)
    check_strip(stillpoint, recording, annotated, out / f"{name}.stripped.mcap")
    check_in_place(stillpoint, recording, annotated, out / f"{name}.in_place.mcap")
    corrected = check_corrected(stillpoint, recording, out / f"{name}.corrected.mcap") if imus else 0
    total = sum(added.values())
    return f"{recording.name}: {total} annotations on {len(added)} topics, {corrected} corrected messages"


class JsonDecoder(DecoderFactory):
    def decoder_for(self, message_encoding, schema):
        return json.loads if message_encoding == "json" else None


def check_in_place(stillpoint, recording, annotated, path):
    path.write_bytes(recording.read_bytes())
    annotate(stillpoint, path, None, ["--in-place"], stem=recording.stem)
    assert path.read_bytes() == annotated.read_bytes(), f"{recording.name}: in place is not the same"


def check_corrected(stillpoint, recording, path):
    annotate(stillpoint, recording, path, ["--set", "output.corrected=final"])
    check_doctor(recording, path)
    check_javascript(path)
    added = check_messages(recording, path)
    check_rosbags(recording, path)
    check_strip(stillpoint, recording, path, path.with_suffix(".stripped"))
    topics = [topic for topic in added if topic.endswith("/stillpoint/corrected")]
    # Decoded by the schema of the source, a corrected message differs from it in its vectors alone.
    decoded = {}
    with open(path, "rb") as file:
        factories = [RosDecoder(), Ros1Decoder(), ProtobufDecoder(), JsonDecoder()]
        for _, channel, message, value in make_reader(file, decoder_factories=factories).iter_decoded_messages(
            topics=[*topics, *(topic.removesuffix("/stillpoint/corrected") for topic in topics)]
        ):
            decoded.setdefault(channel.topic, {})[message.log_time] = list(numbers(value))
    for topic in topics:
        source = decoded[topic.removesuffix("/stillpoint/corrected")]
        assert decoded[topic].keys() == source.keys(), f"{topic}: not one for each message of its source"
        differing = max(sum(a != b for a, b in zip(theirs, source[at], strict=True)) for at, theirs in decoded[topic].items())
        assert 0 < differing <= 6, f"{topic}: {differing} numbers differ"
    return sum(added[topic] for topic in topics)


def numbers(value):
    """All numbers and texts in a decoded message, in order."""
    if hasattr(value, "DESCRIPTOR"):
        for field in value.DESCRIPTOR.fields:
            yield from numbers(getattr(value, field.name))
    elif hasattr(value, "__slots__"):
        for name in value.__slots__:
            yield from numbers(getattr(value, name))
    elif isinstance(value, dict):
        for element in value.values():
            yield from numbers(element)
    elif isinstance(value, (list, tuple)) or hasattr(value, "MergeFrom"):
        for element in value:
            yield from numbers(element)
    else:
        yield value


def check_container(stillpoint, container, out):
    path = out / f"container.{container.parent.name}.{container.name}"
    command = [stillpoint, "annotate", container, "-o", path, "--force", "--allow-no-imu", "--accept-damage", "-q"]
    run = subprocess.run(command, stderr=subprocess.PIPE)
    if container.stat().st_size == 0:
        assert run.returncode == 1, f"{container.name}: an empty file was annotated"
        return
    assert run.returncode == 0, f"{container.name}: {run.stderr}"
    check_doctor(container, path)
    check_strip(stillpoint, container, path, path.with_suffix(".stripped"))
    # @mcap/core finds messages through message indexes alone; what it could not read before, it need not read now.
    if javascript(container).isdecimal():
        check_javascript(path)
    print(f"{container.name}: accepted", flush=True)


def check_edited(stillpoint, recording, out):
    """What other programs make of an annotated recording is not taken for ours, and is annotated as it stands."""
    annotated, edited = out / f"{recording.stem}.annotated.mcap", out / "edited.mcap"
    pymcap = BIN / "pymcap-cli"
    for command in (
        ["filter", annotated, edited, "--force"],
        ["filter", annotated, edited, "--force", "--exclude-topic", "/highg.*"],
        ["merge", annotated, recording, "-o", edited, "--force"],
        ["decompress", annotated, "-o", edited, "--force"],
    ):
        edited.unlink(missing_ok=True)
        subprocess.run([pymcap, *command], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        strip = subprocess.run([stillpoint, "strip", edited, "-o", out / "x.mcap", "--force"], stderr=subprocess.PIPE, text=True)
        assert strip.returncode == 1, f"{command[0]}: an edited recording was stripped"
        assert "edited or damaged since" in strip.stderr or "not annotated" in strip.stderr, strip.stderr
        again = out / "again.mcap"
        run = subprocess.run(
            [stillpoint, "annotate", edited, "-o", again, "--force", "--allow-no-imu"], stderr=subprocess.PIPE, text=True
        )
        assert run.returncode == 0, f"{command[0]}: {run.stderr}"
        check_strip(stillpoint, edited, again, out / "stripped.mcap")
        check_doctor(edited, again)
        check_javascript(again)


def annotate(stillpoint, recording, output, options, stem=None):
    command = [stillpoint, "annotate", recording, "--allow-no-imu", "--accept-damage", "--json", "-q"]
    command += ["-o", output, "--force"] if output else []
    stem = stem or recording.stem
    if stem in SETTINGS:
        command += ["--set", SETTINGS[stem]]
    run = subprocess.run([*command, *options], stdout=subprocess.PIPE, check=True)
    result = json.loads(run.stdout)
    calibrated = any(imu["accelerometer"]["bias"] for imu in result["imus"])
    assert calibrated == (stem in CALIBRATED), f"{recording.name}: calibrated: {calibrated}"
    return result["imus"]


def check_doctor(original, output):
    def in_data_section(error):
        return isinstance(error[1], int)

    known = {error for error in errors(original, os.stat(original).st_mtime_ns) if in_data_section(error)}
    new = errors(output, os.stat(output).st_mtime_ns) - known
    assert not new, f"{output}: the doctor finds {new}"


@functools.cache
def errors(path, _modified):
    """What the doctor calls an error. It is called in this process, as it takes seconds to start."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        doctor(str(path), format="jsonl")
    findings = [json.loads(line) for line in said.getvalue().splitlines()]
    assert findings[-1]["type"] == "summary" and findings[-1]["complete"], f"{path}: the doctor gave up"
    return {(f["code"], f["offset"]) for f in findings if f.get("severity") == "error" and f["section"] == "data"} | {
        (f["code"], f["section"]) for f in findings if f.get("severity") == "error" and f["section"] != "data"
    }


def messages(path):
    """Every message in the order of the file, from the data section and with all CRCs checked."""
    with open(path, "rb") as file:
        channels, schemas = {}, {}
        for record in StreamReader(file, validate_crcs=True).records:
            if isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                channel = channels[record.channel_id]
                key = (channel.topic, channel.message_encoding, record.sequence, record.log_time, record.publish_time)
                yield (*key, record.data)


def check_messages(original, output):
    theirs = Counter(messages(original))
    ours = Counter(messages(output))
    assert not theirs - ours, f"{output}: {sum((theirs - ours).values())} messages are lost or altered"
    with open(output, "rb") as file:
        indexed = sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages())
    assert indexed == sum(ours.values()), f"{output}: {indexed} of {sum(ours.values())} messages are indexed"
    added = Counter(topic for topic, *_ in (ours - theirs).elements())
    assert all("stillpoint/" in topic for topic in added), f"{output}: adds {added}"
    return added


def check_decodes(output):
    subprocess.run([sys.executable, HERE.parent / "tests/interop/annotations.py", output], check=True, stdout=subprocess.DEVNULL)


@functools.cache
def node():
    """A reader that reads one file after the other."""
    return subprocess.Popen(["node", HERE / "read.mjs"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def javascript(path):
    """How many messages @mcap/core reads, or what it refuses."""
    node().stdin.write(f"{path}\n")
    node().stdin.flush()
    return node().stdout.readline().strip()


def check_javascript(output):
    read = javascript(output)
    count = sum(1 for _ in messages(output))
    assert read == str(count), f"{output}: @mcap/core reads {read} of {count} messages"


def check_rosbags(original, output):
    with open(original, "rb") as file:
        if make_reader(file).get_header().profile != "ros2":
            return
    with AnyReader([output]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)


def check_strip(stillpoint, original, annotated, stripped):
    subprocess.run([stillpoint, "strip", annotated, "-o", stripped, "--force", "-q"], check=True)
    assert stripped.read_bytes() == original.read_bytes(), f"{annotated}: strip does not give the original back"


main(Path(sys.argv[1]).resolve())
