"""What the viewer of Rerun takes in: rerun.py RERUN FOLDER NAME=RECORDING[+SIDECAR]...

Its own checks of each file pass, and its importer finds every message of every topic. Two files become one recording. What
it took in is left in FOLDER, for the viewer to open.
"""

import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

from mcap.reader import make_reader

CHUNK = re.compile(r"with (\d+) rows .* - (/\S*) - data columns: \[(.*)\]")


def main(rerun, folder, sessions):
    for session in sessions:
        name, files = session.split("=")
        files = files.split("+")
        taken = [take(rerun, path, folder / f"{name}.{i}.rrd", name) for i, path in enumerate(files)]
        whole = folder / f"{name}.rrd"
        run(rerun, "rrd", "merge", *taken, "-o", whole)
        run(rerun, "rrd", "verify", whole)
        rows, text = Counter(), run(rerun, "rrd", "print", whole)
        for count, entity, columns in CHUNK.findall(text):
            # Channels and the recording are described in a row of their own.
            if not re.match(r"Mcap|RecordingInfo", columns) and not entity.startswith("/__"):
                columns = re.sub(r"CoordinateFrame:\S+|SeriesLines:\S+", "", columns).split()
                rows[entity] += int(count) if columns else 0
        messages = Counter()
        for path in files:
            with open(path, "rb") as file:
                messages.update(channel.topic for _, channel, _ in make_reader(file).iter_messages())
        assert any("/stillpoint/calibration" in topic for topic in messages), f"{name}: no calibration"
        for topic, count in messages.items():
            assert rows[topic] >= count, f"{name}: {rows[topic]} of {count} messages of {topic} are taken in"
        print(f"{name}: {messages.total()} messages on {len(messages)} topics are taken in", flush=True)


def take(rerun, path, out, name):
    checked = run(rerun, "mcap", "check", "--full", path)
    assert re.search(r"^ok +\d", checked, re.M) and not re.search(r"^(?!ok|Status)\w+ +\d", checked, re.M), checked
    run(rerun, "mcap", "convert", path, "-o", out, "--application-id", name, "--recording-id", name)
    return out


def run(*command):
    env = {**os.environ, "RERUN_ANALYTICS": "0"}
    done = subprocess.run([*map(str, command)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=env)
    assert done.returncode == 0, f"{command}: {done.stderr}"
    return done.stdout


main(sys.argv[1], Path(sys.argv[2]), sys.argv[3:])
