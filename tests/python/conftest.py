"""What the tests of the installed wheel share. Of the repository they know `testdata/` and the README."""

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

ROOT = Path(__file__).resolve().parents[2]
TOPIC = "/imu/data_raw"


@pytest.fixture(scope="session")
def demo():
    """Path of a recording of a sensor that was turned through six faces."""
    return ROOT / "testdata" / "demo.mcap"


def readings(path, topic=TOPIC):
    """Readings of a recording by a reader that is not ours: t (ns), accel and gyro."""
    with open(path, "rb") as stream:
        read = make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages([topic])
        messages = [message for *_, message in read]
    stamps = [message.header.stamp for message in messages]
    vectors = lambda field: np.array([[getattr(getattr(m, field), axis) for axis in "xyz"] for m in messages])
    return SimpleNamespace(
        t=np.array([stamp.sec * 1_000_000_000 + stamp.nanosec for stamp in stamps]),
        accel=vectors("linear_acceleration"),
        gyro=vectors("angular_velocity"),
    )


@pytest.fixture(scope="session")
def arrays(demo):
    return readings(demo)


@pytest.fixture(scope="session")
def command():
    """Runs the command that the wheel installed; returns its result, and its standard output as JSON if it is."""
    program = Path(sys.executable).with_name("stillpoint")

    def run(*args, **options):
        done = subprocess.run([program, *args], capture_output=True, text=True, **options)
        done.json = json.loads(done.stdout) if done.stdout.startswith("{") else None
        return done

    return run


@pytest.fixture(scope="session")
def learned(demo, command, tmp_path_factory):
    """What the command says of the IMU of the demo."""
    output = tmp_path_factory.mktemp("command") / "demo.annotated.mcap"
    done = command("annotate", demo, "-o", output, "--json")
    assert done.returncode == 0, done.stderr
    (imu,) = done.json["imus"]
    return SimpleNamespace(imu=imu, output=output)
