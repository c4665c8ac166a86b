"""What readers that are not ours make of the results of damaged recordings: damaged.py STILLPOINT [CUTS FLIPS]

CUTS recordings (24 by default) that were cut off anywhere, and FLIPS with one wrong byte, of a simulated recording and of
a real one: first every byte of the header, then bytes anywhere. Each is annotated; @mcap/core and Python's indexed reader, all CRCs checked, then find every message that Stillpoint
did, and its annotations; and strip gives the damaged recording back.
"""

import json
import os
import random
import shutil
import struct
import subprocess
import sys
from pathlib import Path

from mcap.reader import make_reader

HERE = Path(__file__).resolve().parent
OUT = HERE.parent / f"target/ci/damaged.{os.getpid()}"
HEADER = 8


def main(stillpoint, cuts, flips):
    OUT.mkdir(parents=True, exist_ok=True)
    demo = OUT / "demo.mcap"
    subprocess.run([stillpoint, "simulate", "demo", "-o", demo, "--force", "-q"], check=True)
    real = Path(os.environ["STILLPOINT_DATA"]) / "recordings/mpu6050_hand_held.ros2.mcap"
    javascript = subprocess.Popen(["node", HERE / "read.mjs"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    for recording in (demo, real):
        sound = recording.read_bytes()
        # What stands in the header record is where it was, so that who insists on a whole one refuses the result, too.
        first = HEADER + 9 + struct.unpack_from("<Q", sound, HEADER + 1)[0]
        random.seed(recording.stem)
        headless = 0
        for n in range(cuts + flips):
            if n < cuts:
                place = random.randrange(first, len(sound))
                damaged, what = sound[:place], f"cut off at {place}"
            else:
                anywhere, flip = random.randrange(HEADER, len(sound)), random.randrange(1, 256)
                place = HEADER + n - cuts if HEADER + n - cuts < first else anywhere
                damaged, what = bytearray(sound), f"byte {place} ^ {flip:#x}"
                damaged[place] ^= flip
            headless += check(stillpoint, javascript, bytes(damaged), place < first, f"{recording.name}, {what}")
        print(f"{recording.name}: {cuts} cut off, {flips} with a wrong byte, {headless} of these in the header", flush=True)
    javascript.stdin.close()
    assert javascript.wait() == 0
    shutil.rmtree(OUT)


def check(stillpoint, javascript, damaged, in_header, what):
    path, output, stripped = OUT / "damaged.mcap", OUT / "damaged.annotated.mcap", OUT / "stripped.mcap"
    path.write_bytes(damaged)
    command = [stillpoint, "annotate", path, "-o", output, "--force", "--allow-no-imu", "--json", "-q"]
    run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert run.returncode in (0, 3), f"{what}: {run.returncode}, {run.stderr}"
    found = json.loads(run.stdout)["messages"]
    javascript.stdin.write(f"{output}\n")
    javascript.stdin.flush()
    counted = javascript.stdout.readline().strip()
    with open(output, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        ours = {channel.id for channel in reader.get_summary().channels.values() if "stillpoint/" in channel.topic}
        total = annotations = 0
        for _, channel, _ in reader.iter_messages():
            total += 1
            annotations += channel.id in ours
    assert total - annotations == found, f"{what}: Python finds {total} less {annotations}, not {found}"
    assert counted == str(total) or in_header, f"{what}: @mcap/core: {counted}, not {total}"
    subprocess.run([stillpoint, "strip", output, "-o", stripped, "--force", "-q"], check=True)
    assert stripped.read_bytes() == damaged, f"{what}: strip does not give it back"
    return in_header


main(Path(sys.argv[1]).resolve(), *map(int, sys.argv[2:] or [24, 24]))
