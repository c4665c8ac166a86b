"""Variants of small recordings as the conformance suite of foxglove/mcap has them: every combination of what a file may
have, with and without unknown fields at the end of its records. None is damaged, each is stripped to its bytes, and Python's
mcap and @mcap/core find in the annotated copy what it was made of: conformance.py STILLPOINT FOLDER"""
import itertools
import os
import struct
import subprocess
import sys
import zlib
from concurrent import futures
MAGIC=b"\x89MCAP0\r\n"
def s(t): b=t.encode(); return struct.pack("<I",len(b))+b
def rec(op,body,pad=b""): return bytes([op])+struct.pack("<Q",len(body)+len(pad))+body+pad
# Log times of ten messages, which are not in order.
ORDER=[0,2,1,3,3,5,4,7,8,9]
def build(data,f,padding=b"\x01\xff\xff"):
    pad=padding if "pad" in f else b""
    one,schemaless=data.count("M")==1,"S" not in data
    out=bytearray(MAGIC+rec(1,s("")+s(""),pad))
    inner=bytearray(); midx={}; mdx=[];ax=[];cix=[]; msgs=0;span=[]
    schema=lambda p: rec(3,struct.pack("<H",1)+s("Example")+s("c")+struct.pack("<I",3)+b"\x04\x05\x06",p)
    of=struct.pack("<HH",1,0)+s("example")+s("text")+struct.pack("<I",0) if schemaless else struct.pack("<HH",1,1)+s("example")+s("a")+struct.pack("<I",len(s("foo")+s("bar")))+s("foo")+s("bar")
    channel=lambda p: rec(4,of,p)
    for kind in data:
        target=inner if "ch" in f else out
        if kind=="S": target+=schema(pad if "ch" not in f else b"")
        elif kind=="C": target+=channel(pad if "ch" not in f else b"")
        elif kind=="M":
            at=ORDER[msgs]; msgs+=1; t,q,p=(2,10,1) if one else (at,msgs-1,at); span.append(t)
            midx.setdefault(1,[]).append((t,len(inner)))
            target+=rec(5,struct.pack("<HIQQ",1,q,t,p)+b"\x01\x02\x03")
        elif kind=="A":
            body=struct.pack("<QQ",2,1)+s("myFile")+s("application/octet-stream")+struct.pack("<Q",3)+b"\x01\x02\x03"
            body+=struct.pack("<I",zlib.crc32(body)); off=len(out); r=rec(9,body,pad); out+=r
            if "ax" in f: ax.append((off,len(r)))
        elif kind=="D":
            m=s("foo")+s("bar"); off=len(out); r=rec(12,s("myMetadata")+struct.pack("<I",len(m))+m,pad); out+=r
            if "mdx" in f: mdx.append((off,len(r)))
    if "ch" in f:
        off=len(out); a,b=(min(span),max(span)) if span else (0,0)
        r=rec(6,struct.pack("<QQQI",a,b,len(inner),zlib.crc32(inner))+s("")+struct.pack("<Q",len(inner))+bytes(inner)); out+=r
        offs={}; start=len(out)
        if "mx" in f:
            for c,es in midx.items():
                offs[c]=len(out); out+=rec(7,struct.pack("<HI",c,16*len(es))+b"".join(struct.pack("<QQ",*e) for e in es),pad)
        if "chx" in f: cix.append((a,b,off,len(r),offs,len(out)-start,len(inner)))
    out+=rec(15,struct.pack("<I",zlib.crc32(out)),padding if "padend" in f else b"")
    ss=len(out); groups=[]
    def group(op,recs):
        st=len(out)
        for r in recs: out.extend(r)
        if len(out)>st: groups.append((op,st,len(out)-st))
    group(3,[schema(pad)] if "rsh" in f and "S" in data else [])
    group(4,[channel(pad)] if "rch" in f and "C" in data else [])
    n=data.count
    if "st" in f:
        counts=struct.pack("<HQ",1,msgs) if msgs else b""
        group(11,[rec(11,struct.pack("<QHIIIIQQ",msgs,n("S"),n("C"),n("A"),n("D"),1 if "ch" in f else 0,min(span,default=0),max(span,default=0))+struct.pack("<I",len(counts))+counts,pad)])
    group(13,[rec(13,struct.pack("<QQ",o,l)+s("myMetadata"),pad) for o,l in mdx])
    group(10,[rec(10,struct.pack("<QQQQQ",o,l,2,1,3)+s("myFile")+s("application/octet-stream"),pad) for o,l in ax])
    group(8,[rec(8,struct.pack("<QQQQ",a,b,o,l)+struct.pack("<I",10*len(of))+b"".join(struct.pack("<HQ",c,x) for c,x in of.items())+struct.pack("<Q",ml)+s("")+struct.pack("<QQ",sz,sz),pad) for a,b,o,l,of,ml,sz in cix])
    has=len(out)>ss; so=0
    if "sum" in f:
        so=len(out)
        for g in list(groups): out+=rec(14,struct.pack("<BQQ",*g),pad)
    foot=bytes([2])+struct.pack("<Q",20)+struct.pack("<QQ",ss if has else 0,so)
    out+=foot+struct.pack("<I",zlib.crc32(bytes(out[ss:])+foot))+MAGIC
    return bytes(out)
def variants():
    for name,data in [("NoData",""),("OneMetadata","D"),("OneAttachment","A"),("OneSchemalessMessage","CM"),("OneMessage","SCM"),("TenMessages","SC"+"M"*10)]:
        feats=["st","sum","pad"]+(["rsh","rch","ch","mx","chx"] if "M" in data else [])+(["ax"] if "A" in data else [])+(["mdx"] if "D" in data else [])
        for k in range(len(feats)+1):
            for f in itertools.combinations(feats,k):
                f=set(f)
                if ({"mx","chx"}&f) and "ch" not in f: continue
                if "S" not in data and "rsh" in f: continue
                yield name+"-"+"-".join(sorted(f)), build(data,f), data
                if "pad" in f:
                    yield name+"-long-"+"-".join(sorted(f)), build(data,f|{"padend"},b"\x03"+b"\x00"*20), data
def found(path):
    """Messages on other topics than ours, attachments and metadata, by Python's mcap."""
    from mcap.stream_reader import StreamReader
    kinds, topics = {"M": 0, "A": 0, "D": 0}, {}
    with open(path, "rb") as file:
        for r in StreamReader(file, validate_crcs=True).records:
            name = type(r).__name__
            if name == "Channel":
                topics[r.id] = r.topic
            elif name == "Message":
                kinds["M"] += "/stillpoint/" not in topics[r.channel_id]
            elif name == "Attachment":
                kinds["A"] += r.name == "myFile"
            elif name == "Metadata":
                kinds["D"] += r.name == "myMetadata"
    return kinds


def check(program, folder, variant):
    name, whole, data = variant
    path = os.path.join(folder, name + ".mcap")
    with open(path, "wb") as file:
        file.write(whole)
    annotate = [program, "annotate", path, "-o", path + ".annotated", "--allow-no-imu", "--force", "--json"]
    run = subprocess.run(annotate, capture_output=True, text=True)
    if run.returncode:
        return f"{name}: {run.stderr.strip()}"
    strip = [program, "strip", path + ".annotated", "-o", path + ".stripped", "--force"]
    run = subprocess.run(strip, capture_output=True, text=True)
    if run.returncode or open(path + ".stripped", "rb").read() != whole:
        return f"{name}: strip is not exact {run.stderr.strip()}"
    kinds = found(path + ".annotated")
    wanted = {kind: data.count(kind) for kind in "MAD"}
    return None if kinds == wanted else f"{name}: {kinds}, not {wanted}"


def second_judge(folder, variants):
    """What @mcap/core finds otherwise."""
    stream = os.path.join(os.path.dirname(os.path.abspath(__file__)), "stream.mjs")
    names = "".join(os.path.join(folder, name + ".mcap.annotated") + "\n" for name, _, _ in variants)
    run = subprocess.run(["node", stream], input=names, stdout=subprocess.PIPE, text=True, check=True)
    lines = run.stdout.splitlines()
    assert len(lines) == len(variants), f"{len(lines)} answers of @mcap/core to {len(variants)} files"
    wanted = [" ".join(str(data.count(kind)) for kind in "MAD") for _, _, data in variants]
    judged = zip(variants, lines, wanted)
    return [f"{name}: @mcap/core: {line}, not {want}" for (name, _, _), line, want in judged if line != want]


if __name__ == "__main__":
    program, folder = sys.argv[1:3]
    os.makedirs(folder, exist_ok=True)
    every = list(variants())
    with futures.ThreadPoolExecutor(2) as pool:
        bad = [line for line in pool.map(lambda variant: check(program, folder, variant), every) if line]
    bad += [] if bad else second_judge(folder, every)
    print(f"{len(every)} variants, {len(bad)} not as they should be", *bad[:20], sep="\n")
    sys.exit(bool(bad))
