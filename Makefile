# skysweep: `make demo` shows it at work, `make test` and `make lint` are what CI runs.
# Rust (1.95 or newer) has to be there; the system packages below are installed when they are missing.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.ONESHELL:
.DEFAULT_GOAL := help

PACKAGES := libgdal-dev pkg-config libsqlite3-dev g++
SKYSWEEP := target/release/skysweep
TOWN := data-samples/town
DEMO := out/demo

.PHONY: help setup demo test lint bench bench-kernels

help: ## list the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /make \1\t/' | expand -t 20

setup: ## install the system packages that are missing (Debian, Ubuntu: apt)
	@command -v cargo > /dev/null || { echo "error: cargo not found: install Rust from https://rustup.rs, then run make again" >&2; exit 2; }
	have_all() { command -v pkg-config c++ > /dev/null && pkg-config --exists gdal proj sqlite3; }
	have_all && exit 0
	if ! command -v apt-get > /dev/null; then
	  echo "error: GDAL >= 3.4, PROJ >= 9.1, SQLite (with headers), pkg-config and a C++ compiler are needed;" \
	    "this system has no apt-get: install them with its own package manager, then run make again" >&2
	  exit 2
	fi
	SUDO=; [ "$$(id -u)" = 0 ] || SUDO=sudo
	MISSING=; for p in $(PACKAGES); do
	  dpkg-query -W -f '$${Status}' "$$p" 2> /dev/null | grep -q 'ok installed' || MISSING="$$MISSING $$p"
	done
	echo "installing system packages with apt-get:$${MISSING:- $(PACKAGES)}"
	$$SUDO apt-get update -qq
	$$SUDO env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $${MISSING:-$(PACKAGES)} > /dev/null
	have_all || { echo "error: after the installation pkg-config still does not find gdal, proj and sqlite3" >&2; exit 2; }

$(SKYSWEEP): setup FORCE
	@cargo build --release --bin skysweep

.PHONY: FORCE
FORCE:

demo: $(SKYSWEEP) ## a surface model of the sample town, its accuracy and its picture, in out/demo
	@$(SKYSWEEP) dsm $(TOWN)/view_*.tif -o $(DEMO) --overwrite
	echo
	echo "against the true surface:"
	$(SKYSWEEP) eval $(DEMO)/dsm/dsm.tif $(TOWN)/truth/dsm.tif --align xyz
	echo
	echo "surface model  $(DEMO)/dsm/dsm.tif"
	echo "picture        $(DEMO)/dsm/relief.png"
	echo "report         $(DEMO)/report/report.json"

test: setup ## unit, property, integration and documentation tests
	@cargo test --workspace

lint: setup ## format, clippy on every target (benches too), documentation; warnings are errors
	@cargo fmt --all --check
	cargo clippy --workspace --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps

bench: setup ## speed against error: every preset on every scene; writes benches/results (about 12 minutes)
	@cargo bench --bench scenes

bench-kernels: setup ## criterion benches of the kernels
	@cargo bench --workspace --exclude skysweep
