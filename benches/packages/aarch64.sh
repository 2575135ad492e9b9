#!/usr/bin/env bash
# Checks on another machine what can be checked of aarch64: the whole workspace compiles, and the crates that need neither GDAL
# nor PROJ pass their unit tests in an emulator, which takes the plain path of the sweep.
#   benches/packages/aarch64.sh
# Needs the target aarch64-unknown-linux-gnu of rustup and, on Debian, apt-get install gcc-aarch64-linux-gnu
# libc6-dev-arm64-cross qemu-user-static. Writes benches/results/aarch64.txt. Neither the build nor the tests need it.
set -euo pipefail
cd "$(dirname "$0")/../.."
target=aarch64-unknown-linux-gnu
out=benches/results/aarch64.txt
export CARGO_INCREMENTAL=0 CARGO_PROFILE_DEV_DEBUG=0
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64-static -L /usr/aarch64-linux-gnu"

# A check links nothing, so the headers of this machine's GDAL and PROJ serve.
PKG_CONFIG_ALLOW_CROSS=1 cargo check --quiet --workspace --target "$target"

# Crates none of whose dependencies has a library of the system.
crates=$(cargo metadata --format-version 1 --filter-platform "$target" | python3 -c '
import json, sys
found = json.load(sys.stdin)
nodes = {node["id"]: node for node in found["resolve"]["nodes"]}
names = {package["id"]: package["name"] for package in found["packages"]}
def below(root, tests):
    seen, left = set(), [(root, tests)]
    while left:
        one, with_tests = left.pop()
        for edge in nodes[one]["deps"]:
            kinds = {kind["kind"] for kind in edge["dep_kinds"]}
            if edge["pkg"] not in seen and (None in kinds or with_tests and "dev" in kinds):
                seen.add(edge["pkg"])
                left.append((edge["pkg"], False))
    return {names[one] for one in seen}
system = {"gdal-sys", "proj-sys", "libsqlite3-sys", "pyo3-ffi"}
print(*sorted(names[one] for one in found["workspace_members"] if not below(one, True) & system))')
{
  echo "Written by benches/packages/aarch64.sh: $(rustc --version), $(qemu-aarch64-static --version | head -1)"
  echo "The whole workspace compiles for $target (cargo check)."
  echo "Unit tests in the emulator:"
  for crate in $crates; do
    counts=$(cargo test --quiet --lib --target "$target" -p "$crate" | grep '^test result' | sed -E 's/^test result: ok\. ([0-9]+ passed); [0-9]+ failed; ([0-9]+ ignored).*/\1, \2/')
    echo "  $crate: $counts"
  done
} > "$out.part"
mv "$out.part" "$out"
cat "$out"
