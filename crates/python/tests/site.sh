#!/usr/bin/env bash
# Makes the package as an installation has it, in target/python/site: the sources with the library beside them, which
# `cargo build --workspace` has built. Prints the folder.
set -euo pipefail
cd "$(dirname "$0")/../../.."
target=${CARGO_TARGET_DIR:-target}
site=$target/python/site
mkdir -p "$site"
rm -rf "$site/skysweep"
mkdir "$site/skysweep"
for file in crates/python/python/skysweep/*.py* crates/python/python/skysweep/py.typed; do ln -s "$PWD/$file" "$site/skysweep/"; done
ln -s "$(realpath "$target/debug/deps/lib_native.so")" "$site/skysweep/_native.abi3.so"
realpath "$site"
