#!/usr/bin/env python3
"""Allan sums in annotations against two computations that are not ours.

    allan.py STILLPOINT DIRECTORY

A sensor rests for seven minutes. From the samples in the recording the sums are computed in one piece with numpy, which
must agree to 1e-12, and the Allan deviations by allantools, which must agree to 1 % where tau is short beside the record.
"""

import subprocess
import sys
from pathlib import Path

import allantools
import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

RATE = 100
SCENARIO = """
[recording]
seed = 11
[accelerometer]
rate_hz = 100
noise = 0.02
[gyroscope]
rate_hz = 100
noise = 0.002
[motion]
duration_s = 1.2
start_s = 0.6
end_s = 0.6
[[pose]]
face = "+Z"
rest_s = 420.0
"""


def main(stillpoint, directory):
    directory.mkdir(parents=True, exist_ok=True)
    scenario, raw, annotated = (directory / name for name in ("rest.toml", "rest.mcap", "rest.annotated.mcap"))
    scenario.write_text(SCENARIO)
    run(stillpoint, "simulate", scenario, "-o", raw, "--force", "-q")
    run(stillpoint, "annotate", raw, "-o", annotated, "--force", "-q")

    samples, segments, noise = [], [], None
    with open(annotated, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            if channel.topic.endswith("/stillpoint/noise"):
                noise = message
            elif channel.topic.endswith("/stillpoint/segment"):
                segments.append(message)
            elif "/stillpoint/" not in channel.topic:
                a, w = message.linear_acceleration, message.angular_velocity
                samples.append((nanos(message.header.stamp), a.x, a.y, a.z, w.x, w.y, w.z))
    check(noise is not None, "no Allan sums")
    start = min(nanos(segment.start) for segment in segments)
    end = max(nanos(segment.end) for segment in segments)
    at_rest = np.array([sample[1:] for sample in samples if start <= sample[0] <= end])
    check(len(at_rest) > 400 * RATE, f"{len(at_rest)} samples at rest")

    for sums in noise.triads:
        first = {"accelerometer": 0, "gyroscope": 3}[sums.sensor]
        check(sums.all.samples == len(at_rest), f"{sums.sensor}: {sums.all.samples} samples, not {len(at_rest)}")
        for axis in range(3):
            against(sums, axis, at_rest[:, first + axis])
    print(f"{len(noise.triads)} triads: as numpy to 1e-12 and allantools to 1 %")


def against(sums, axis, values):
    where = f"{sums.sensor} {'xyz'[axis]}"
    averages = values - values[0]
    for octave, count in enumerate(sums.all.counts):
        means = (averages[:-3] + averages[1:-2] + averages[2:-1] + averages[3:]) / 4
        differences = means[4:] - means[:-4]
        ours, theirs = sums.all.squares[3 * octave + axis], np.sum(differences**2)
        check(count == len(differences), f"{where} octave {octave}: {count} differences, not {len(differences)}")
        check(abs(ours - theirs) <= 1e-12 * theirs, f"{where} octave {octave}: {ours} and {theirs}")
        averages = averages[: len(averages) // 2 * 2].reshape(-1, 2).mean(1)

        tau = 4 * 2**octave / RATE
        if tau <= len(values) / RATE / 50:
            _, (deviation,), _, _ = allantools.oadev(values, rate=RATE, data_type="freq", taus=[tau])
            own = np.sqrt(ours / (2 * count))
            # It takes every difference, we every fourth of tau: in a record of so many tau the two estimates of one
            # deviation differ by chance, here by no more than three standard deviations.
            most = max(0.01, 0.35 * np.sqrt(tau * RATE / len(values)))
            check(abs(own - deviation) <= most * deviation, f"{where} τ {tau} s: {own} and {deviation}")


def nanos(stamp):
    return stamp.sec * 10**9 + stamp.nanosec


def run(*command):
    subprocess.run([str(part) for part in command], check=True)


def check(holds, complaint):
    if not holds:
        sys.exit(complaint)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]).resolve(), Path(sys.argv[2]))
