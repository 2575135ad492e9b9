#!/usr/bin/env python3
"""Shares of a run's time by stage: the table in crates/sweep/src/lib.rs.

    cargo build --profile profiling
    perf record -F 1500 -o run.data target/profiling/skysweep dsm IMAGES... -o out
    benches/profile/shares.py run.data target/profiling/skysweep

Every sample in the program goes to the innermost of its inlined frames that lies in a file of a stage below (addr2line; the
profiling profile keeps line tables), every other one to the library or to the system that it is in. Needs perf and binutils.
"""

import collections
import re
import subprocess
import sys

STAGES = [
    ("fusion, speckle, filling, confidence, pictures", r"fusion/|surface\.rs|pictures\.rs|hillshade|relief"),
    ("consistency", r"consistency\.rs"),
    ("tie points, adjustment, probe, cameras", r"pointing|tie_windows|probe\.rs|crates/(camera|geodesy)|nalgebra"),
    ("aggregation", r"semiglobal|paths\.rs|pixel\.rs|simd/rows"),
    ("read-out, support, ranges", r"readout|support\.rs|ranges\.rs|level\.rs|window_sums"),
    ("sources laid over, views, pyramids", r"resample|pyramid|view\.rs|laid\.rs"),
    ("costs", r"sweep/src/cost/|census|shift\.rs|transpose|raise|volume\.rs|prior\.rs"),
    ("files", r"crates/formats|output\.rs|report"),
]
LIBRARIES = [
    ("files", r"deflate|tiff|gdal|libz|png|zstd"),
    ("projections", r"sqlite|libproj"),
    ("operating system", r"kernel|libc|libm|ld-linux|vdso"),
]


def output(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def stage_of(text, stages):
    return next((name for name, pattern in stages if re.search(pattern, text)), None)


def samples(data, program):
    """Counts of addresses in the program and of other objects, and where the program was mapped."""
    own, other, maps = collections.Counter(), collections.Counter(), []
    for line in output("perf", "script", "-i", data, "--show-mmap-events", "-F", "comm,pid,event,ip,dso,sym").splitlines():
        mapped = re.search(r"MMAP2? .*\[(0x\w+)\((0x\w+)\) @ (\w+) .*\]: \S+ (\S+)", line)
        sample = re.search(r":\s+([0-9a-f]+) .* \((\S+)\)$", line)
        if mapped and mapped[4].endswith(program):
            maps.append(tuple(int(mapped[i], 0) for i in (1, 2, 3)))
        elif sample and sample[2].endswith(program):
            own[int(sample[1], 16)] += 1
        elif sample:
            other[sample[2].split("/")[-1]] += 1
    return own, other, maps


def linked(address, maps, segments):
    """The address as the linker knows it."""
    for start, size, offset in maps:
        place = address - start + offset
        for at, virtual, length in segments:
            if start <= address < start + size and at <= place < at + length:
                return place - at + virtual
    return 0


def main(data, program):
    own, other, maps = samples(data, program.split("/")[-1])
    headers = re.findall(r"LOAD\s+(0x\w+) (0x\w+) 0x\w+ (0x\w+)", output("readelf", "-lW", program))
    segments = [tuple(int(v, 16) for v in h) for h in headers]
    addresses = [hex(linked(a, maps, segments)) for a in own]
    frames = re.split(r"^0x\w+\n", output("addr2line", "-e", program, "-a", "-i", *addresses), flags=re.M)[1:]
    shares = collections.Counter()
    for count, lines in zip(own.values(), frames):
        stages = (stage_of(line, STAGES) for line in lines.splitlines())
        shares[next(filter(None, stages), "the rest")] += count
    for name, count in other.items():
        shares[stage_of(name, LIBRARIES) or "the rest"] += count
    total = sum(shares.values())
    for name, count in shares.most_common():
        print(f"{100 * count / total:5.1f} %  {name}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
