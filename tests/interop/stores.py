#!/usr/bin/env python3
"""Recordings in an object store: moto on loopback, behind a proxy that counts and makes trouble.

    stores.py STILLPOINT

STILLPOINT was built with the feature `object-store`.
"""

import json
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from sparse import sparse, used
from store_server import BUCKET, Store

ROOT = Path(__file__).resolve().parents[2]
stillpoint = str(Path(sys.argv[1]).resolve())
folder = Path(tempfile.mkdtemp())
store = Store()
URL = f"s3://{BUCKET}"


def run(*args, code=0, past_proxy=False, **more):
    done = subprocess.run(
        [stillpoint, *map(str, args)], capture_output=True, text=True, env=store.environment(past_proxy, **more)
    )
    assert done.returncode == code, f"{args}: {done.returncode}, not {code}\n{done.stdout}{done.stderr}"
    return done


def lines(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def local(path):
    """The sidecar of a local run."""
    sidecar = path.with_suffix(".local.mcap")
    run("annotate", path, "--sidecar", "-o", sidecar, "--force", "-q")
    return sidecar.read_bytes()


def counted(what):
    proxy = store.proxy
    by_method = {}
    for method, *_ in proxy.requests:
        by_method[method] = by_method.get(method, 0) + 1
    print(f"  {what}: {by_method}, {proxy.sent:,} bytes read, {proxy.received:,} written", flush=True)
    return by_method


run("simulate", "demo", "-o", folder / "demo.mcap", "-q")
rates = ["--set", "accelerometer.rate_hz=400", "--set", "gyroscope.rate_hz=400"]
run("simulate", "demo", "-o", folder / "fast.mcap", *rates, "-q")
sparse(folder / "fast.mcap", folder / "sparse.mcap", camera=90_000, seconds=2.0)
recording = folder / "sparse.mcap"
store.client.upload_file(str(recording), BUCKET, "a/sparse.mcap")

print("== What is transferred, and that the result is the local run's")
store.proxy.reset()
run("annotate", f"{URL}/a/sparse.mcap")
requests = counted(f"{recording.stat().st_size:,} bytes")
chunks, bytes_used, summary = used(recording)
ranges = [byte_range for method, _, byte_range in store.proxy.requests if method == "GET"]
print(f"  {chunks} chunks are used: {bytes_used:,} bytes, and the summary: {summary:,}")
assert store.proxy.sent <= 1.1 * (bytes_used + summary), store.proxy.sent
assert requests["GET"] <= chunks + 3 and requests["HEAD"] == 1 and requests["PUT"] == 1, ranges
assert ranges[0] == "bytes=-262144", ranges
assert store.get("a/sparse.stillpoint.mcap") == local(recording)

print("== Finished work costs one request")
store.proxy.reset()
run("annotate", f"{URL}/a/sparse.mcap")
assert counted("again") == {"HEAD": 1}
assert store.proxy.sent == 0
run("annotate", f"{URL}/a/sparse.mcap", "--set", "still.min_fit_s=3", code=1)
run("annotate", f"{URL}/a/sparse.mcap", "--force", "-q")

print("== Without a usable summary")
whole = recording.read_bytes()
cut = whole[: len(whole) * 2 // 3]
bad = bytearray(whole)
bad[-100] ^= 1
for name, content in {"cut": cut, "bad": bytes(bad)}.items():
    (folder / f"{name}.mcap").write_bytes(content)
    store.put(f"b/{name}.mcap", content)
    store.proxy.reset()
    done = run("annotate", f"{URL}/b/{name}.mcap", code=3)
    counted(name)
    sidecar = folder / f"{name}.side.mcap"
    run("annotate", folder / f"{name}.mcap", "--sidecar", "-o", sidecar, "-q", code=3)
    assert store.get(f"b/{name}.stillpoint.mcap") == sidecar.read_bytes(), name
    assert store.proxy.sent < 1.3 * len(content) and len(store.proxy.requests) < 40

print("== The other ways: annotated, into a store, out of a store")
run("annotate", recording, "-o", folder / "annotated.mcap", "-q")
annotated = (folder / "annotated.mcap").read_bytes()
store.proxy.reset()
run("annotate", f"{URL}/a/sparse.mcap", "-o", f"{URL}/c/x.mcap", "-q")
requests = counted("annotated, from the store into the store")
assert store.get("c/x.mcap") == annotated
assert requests["POST"] == 2 and requests["PUT"] > 3, "in parts"
assert store.proxy.sent < 1.05 * len(annotated) + bytes_used
run("annotate", f"{URL}/a/sparse.mcap", "-o", f"{URL}/c/x.mcap")
run("annotate", f"{URL}/a/sparse.mcap", "-o", folder / "from_store.mcap", "-q")
assert (folder / "from_store.mcap").read_bytes() == annotated
run("annotate", recording, "--out-dir", f"{URL}/d/", "-q")
assert store.get("d/sparse.stillpoint.mcap") == local(recording)
# Annotated recordings are inputs, too.
run("annotate", f"{URL}/c/x.mcap", "-o", folder / "x.mcap", "-q")
assert (folder / "x.mcap").read_bytes() == annotated
run("annotate", f"{URL}/a/sparse.mcap", "--verify", "-o", folder / "verified.mcap", "-q")
assert (folder / "verified.mcap").read_bytes() == annotated

print("== Other commands")
for command in (["topics"], ["export", "--format", "json"]):
    verb, *rest = command
    for name in ("a/sparse.mcap", "c/x.mcap") if verb == "export" else ("a/sparse.mcap",):
        there = run(verb, f"{URL}/{name}", *rest).stdout
        here = run(verb, recording if name.startswith("a") else folder / "annotated.mcap", *rest).stdout
        assert there == here, command
store.proxy.reset()
run("export", f"{URL}/c/x.mcap", "--format", "json", "-o", f"{URL}/out/x.json")
counted("export of an annotated recording")
assert store.proxy.sent < 2 * (1 << 20) + len(annotated) // 20, "only its annotations are read"
run("export", f"{URL}/c/x.mcap", "--format", "json", "-o", f"{URL}/out/x.json")
run("export", f"{URL}/c/x.mcap", "--format", "yaml", "-o", f"{URL}/out/x.json", code=1)
run("report", f"{URL}/a/sparse.stillpoint.mcap", "-o", f"{URL}/out/x.html", "-q")
assert store.get("out/x.html").startswith(b"<!DOCTYPE html>") or b"<html" in store.get("out/x.html")[:200]

print("== Lists, prefixes, shards, merge")
demo = (folder / "demo.mcap").read_bytes()
for number in range(5):
    store.put(f"list/{number}/demo.mcap", demo)
store.put("list/broken.mcap", b"no recording at all, and longer than the magic")
store.put("list/empty.mcap", b"")
manifest = folder / "manifest.jsonl"
said = run("annotate", f"{URL}/list/", "--manifest", manifest, code=6).stderr
assert said.count("error: ") == 2, said
outcomes = {line["input"].split("list/")[1]: line["outcome"] for line in lines(manifest)}
assert sorted(outcomes.values()) == ["hopeless"] * 2 + ["written"] * 5, outcomes
sidecar = local(folder / "demo.mcap")
assert all(store.get(f"list/{n}/demo.stillpoint.mcap") == sidecar for n in range(5))
for shard in ("0/2", "1/2", "0/2"):
    run("annotate", f"{URL}/list/", "--shard", shard, "--manifest", manifest, code=6 if shard != "1/2" else 6)
    assert {line["outcome"] for line in lines(manifest)} <= {"skipped", "hopeless"}
listing = folder / "listing"
listing.write_text("".join(f"{URL}/list/{n}/demo.mcap\n" for n in range(5)))
store.proxy.reset()
run("annotate", "--inputs-from", listing)
assert counted("five of a list, finished") == {"HEAD": 5}
merged = run("merge", f"{URL}/list/", "--format", "json").stdout
here = folder / "demo.local.mcap"
assert json.loads(merged)["imus"][0]["accelerometer"]["bias"] == json.loads(run("merge", here, "--format", "json").stdout)["imus"][0]["accelerometer"]["bias"]
# What was replaced under the same name is noticed where it was listed.
store.put("list/0/demo.mcap", demo + b"\0")
assert "exists" in run("annotate", f"{URL}/list/", code=6).stderr
store.put("list/0/demo.mcap", demo)

print("== Refusals, in one line that says what next")
for args, code, word in (
    (["annotate", f"{URL}/none.mcap"], 1, "no such object"),
    (["annotate", "s3://no-such-bucket/x.mcap"], 1, "no such"),
    (["annotate", f"{URL}/nothing/"], 1, "no recording"),
    (["annotate", f"{URL}/a/sparse.mcap", "--in-place"], 2, "in place"),
    (["annotate", f"{URL}/a/sparse.mcap", "-o", f"{URL}/a/sparse.mcap", "--force"], 1, "itself read"),
    (["annotate", f"{URL}/a/sparse.mcap", "--manifest", f"{URL}/m"], 2, "line by line"),
    (["tail", f"{URL}/a/sparse.mcap"], 2, "does not grow"),
):
    done = run(*args, code=code)
    errors = [line for line in done.stderr.splitlines() if line.startswith("error")]
    assert len(errors) == 1 and word in errors[0], done.stderr
    print(f"  {errors[0]}")

print("== Trouble that passes")


def first(what, number):
    """Trouble with the first requests of each kind and place."""
    seen = {}

    def ask(request):
        key = (request.command, request.path, request.headers.get("Range"))
        seen[key] = seen.get(key, 0) + 1
        return what if seen[key] <= number else None

    return ask


def each(what, step):
    """Trouble with one in so many requests."""
    count = iter(range(1, 1 << 30))
    return lambda request: what if request.command == "GET" and next(count) % step == 0 else None


sparse(folder / "fast.mcap", folder / "small.mcap", camera=10_000, seconds=5.0)
small = folder / "small.mcap"
for what, trouble in (
    ("error", first("error", 2)),
    ("lost", first("lost", 1)),
    ("cut", each("cut", 3)),
    ("slow", each("slow", 1)),
    ("unanswered", first("unanswered", 1)),
):
    store.put(f"t/{what}.mcap", small.read_bytes())
    store.proxy.reset()
    began = time.monotonic()
    with store.trouble(trouble):
        run("annotate", f"{URL}/t/{what}.mcap", "-q")
    print(f"  {what}: {len(store.proxy.requests)} requests, {time.monotonic() - began:.1f} s", flush=True)
    assert store.get(f"t/{what}.stillpoint.mcap") == local(small)
for what, trouble in (("error", first("error", 1)), ("cut", each("cut", 5)), ("unanswered", first("unanswered", 1))):
    with store.trouble(trouble):
        run("annotate", f"{URL}/a/sparse.mcap", "-o", f"{URL}/t/{what}.whole.mcap", "-q")
    assert store.get(f"t/{what}.whole.mcap") == annotated
    # Of an upload whose answer was lost nobody knows the number; the rules of the bucket drop it.
    assert len(store.unfinished()) <= (what == "unanswered")
for upload in store.unfinished():
    store.client.abort_multipart_upload(Bucket=BUCKET, Key=upload["Key"], UploadId=upload["UploadId"])

print("== Trouble that stays: passing, and no half result")
for what in ("error", "lost"):
    with store.trouble(lambda request: what):
        done = run("annotate", f"{URL}/a/sparse.mcap", "--out-dir", f"{URL}/e", code=5, STILLPOINT_RETRY_S="2")
        assert done.stderr.count("\nerror: ") == 0 and "may succeed later" in done.stderr, done.stderr
        print(f"  {done.stderr.strip()}")
    # The network is cut while parts are sent.
    parts = lambda request: what if request.command == "PUT" and "partNumber=3" in request.path else None
    with store.trouble(parts):
        run("annotate", f"{URL}/a/sparse.mcap", "-o", f"{URL}/e/x.mcap", code=5, STILLPOINT_RETRY_S="2")
    assert not store.keys("e/") and not store.unfinished()
listing.write_text(f"{URL}/a/sparse.mcap\n{URL}/none.mcap\n")
with store.trouble(lambda request: "error" if "sparse.mcap" in request.path else None):
    run("annotate", "--inputs-from", listing, "--out-dir", f"{URL}/e", "--manifest", manifest, code=5, STILLPOINT_RETRY_S="1")
assert [line["outcome"] for line in lines(manifest)] == ["passing", "hopeless"]

print("== Killed, and two at once")
for seconds in (0.1, 0.5, 1.5):
    with store.trouble(lambda request: "slow" if request.command in ("PUT", "GET") else None):
        args = [stillpoint, "annotate", f"{URL}/a/sparse.mcap", "-o", f"{URL}/k/x.mcap", "-q"]
        running = subprocess.Popen(args, env=store.environment())
        time.sleep(seconds)
        running.send_signal(signal.SIGKILL)
        running.wait()
    assert store.keys("k/") in ([], ["k/x.mcap"])
    if store.keys("k/"):
        assert store.get("k/x.mcap") == annotated
        store.client.delete_object(Bucket=BUCKET, Key="k/x.mcap")
run("annotate", f"{URL}/a/sparse.mcap", "-o", f"{URL}/k/x.mcap", "-q")
assert store.get("k/x.mcap") == annotated
for number in range(4):
    store.put(f"pair/{number}.mcap", demo)
both = [
    subprocess.Popen([stillpoint, "annotate", f"{URL}/pair/", "--shard", "0/2", "--out-dir", f"{URL}/two", "-q"], env=store.environment(), stderr=subprocess.DEVNULL)
    for _ in range(2)
]
assert [process.wait() for process in both] == [0, 0]
assert len(store.keys("two/")) == 2
assert all(store.get(key) == sidecar for key in store.keys("two/"))

print("== A prefix as a service")
args = [stillpoint, "--json", "watch", f"{URL}/w/", "--interval", "300ms", "-q"]
watching = subprocess.Popen(args, env=store.environment(), stdout=subprocess.PIPE, text=True)
store.put("w/1.mcap", demo)
event = json.loads(watching.stdout.readline())
assert (event["event"], event["output"]) == ("annotated", f"{URL}/w/1.stillpoint.mcap"), event
store.put("w/2.mcap", b"no recording at all, and longer than the magic")
assert json.loads(watching.stdout.readline())["event"] == "quarantined"
with store.trouble(lambda request: "error"):
    store.put("w/3.mcap", demo)
    time.sleep(1)
assert json.loads(watching.stdout.readline())["event"] in ("annotated", "again")
watching.send_signal(signal.SIGTERM)
watching.communicate()
assert store.get("w/1.stillpoint.mcap") == sidecar

print("== Throughput: a shard in the store against the same in files")
times = {}
for place in ("files", "store"):
    target = folder / "out" if place == "files" else f"{URL}/speed"
    sources = [folder / f"s{n}.mcap" if place == "files" else f"{URL}/s/{n}.mcap" for n in range(4)]
    for n, source in enumerate(sources):
        source.write_bytes(whole) if place == "files" else store.put(f"s/{n}.mcap", whole)
    listing.write_text("".join(f"{source}\n" for source in sources))
    began = time.monotonic()
    run("annotate", "--inputs-from", listing, "--sidecar", "--out-dir", target, "-q", past_proxy=True)
    times[place] = (time.monotonic() - began) / len(sources)
print(f"  {times['files']:.2f} s a recording in files, {times['store']:.2f} s in the store")
store.stop()
print("all as it should be")
