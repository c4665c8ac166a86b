"""Annotates the recordings under a prefix of an object store by Ray tasks, then makes one calibration per sensor.

    pip install stillpoint ray boto3
    python ray_tasks.py s3://bucket/prefix/

One recording is one task. What is done is skipped at the cost of one request, so a task may run again at any time: after a
node died, or the next day. Nothing but rests leaves the store: of each recording, only the chunks with its IMU are read.
"""

import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from urllib.parse import urlparse

import boto3
import ray


class Passing(Exception):
    """Trouble of the store or the network (exit code 5): another attempt may succeed."""


def recordings(prefix, client=None):
    """URLs of the recordings under a prefix, without results."""
    url = urlparse(prefix)
    pages = (client or boto3.client("s3")).get_paginator("list_objects_v2").paginate(Bucket=url.netloc, Prefix=url.path[1:])
    keys = [entry["Key"] for page in pages for entry in page.get("Contents", [])]
    results = (".stillpoint.mcap", ".annotated.mcap")
    return [f"{url.scheme}://{url.netloc}/{key}" for key in keys if key.endswith(".mcap") and not key.endswith(results)]


def sensor_of(recording):
    """Which sensor a recording is of: here the folder that it lies in."""
    return recording.rsplit("/", 2)[-2]


def sidecar_of(recording):
    return recording.removesuffix(".mcap") + ".stillpoint.mcap"


def run_annotate(recording, stillpoint="stillpoint"):
    """Annotates one recording into its sidecar; returns its line of the manifest."""
    with tempfile.NamedTemporaryFile("r", suffix=".jsonl") as manifest:
        command = [stillpoint, "annotate", recording, "--manifest", manifest.name, "--quiet"]
        done = subprocess.run(command, capture_output=True, text=True)
        lines = manifest.read().splitlines()
    if done.returncode == 5 or not lines:
        raise Passing(done.stderr.strip() or f"exit code {done.returncode}")
    return json.loads(lines[0])


def run_merge(sensor, sidecars, stillpoint="stillpoint"):
    """One calibration out of the sidecars of a sensor, as JSON."""
    command = [stillpoint, "merge", "--inputs-from", "-", "--format", "json", "--accept-damage", "--quiet"]
    done = subprocess.run(command, input="\n".join(sidecars), capture_output=True, text=True)
    if done.returncode == 5:
        raise Passing(done.stderr.strip())
    if done.returncode != 0:
        return {"sensor": sensor, "error": done.stderr.strip()}
    return {"sensor": sensor, **json.loads(done.stdout)}


# Ray itself repeats tasks whose node died.
annotate = ray.remote(max_retries=-1, retry_exceptions=[Passing])(run_annotate)
merge = ray.remote(max_retries=-1, retry_exceptions=[Passing])(run_merge)


def annotate_all(found, *options):
    return ray.get([annotate.remote(recording, *options) for recording in found])


def merge_all(manifest, *options):
    """One calibration per sensor, of the recordings that were not hopeless."""
    sensors = defaultdict(list)
    for line in manifest:
        if line["outcome"] != "hopeless":
            sensors[sensor_of(line["input"])].append(sidecar_of(line["input"]))
    return ray.get([merge.remote(sensor, sidecars, *options) for sensor, sidecars in sorted(sensors.items())])


if __name__ == "__main__":
    ray.init()
    outcomes = annotate_all(recordings(sys.argv[1]))
    with open("manifest.jsonl", "w") as file:
        file.writelines(json.dumps(line) + "\n" for line in outcomes)
    for calibration in merge_all(outcomes):
        print(json.dumps(calibration))
