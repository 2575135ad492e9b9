# skysweep: `make demo` shows it at work, `make test` and `make lint` are what CI runs.
# Rust must be installed in the version that Cargo.toml names or newer. `make setup` installs the system packages that are missing,
# with apt-get; `make demo` and `make test` call it. No other target installs system packages: it names `make setup` instead.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.ONESHELL:
.DEFAULT_GOAL := help

# Builds GDAL and PROJ from source into what is built (see docs/decisions/static-build.md).
STATIC := RUSTFLAGS='--cfg skysweep_static' CMAKE_TOOLCHAIN_FILE=$(CURDIR)/crates/formats/static.cmake CARGO_TARGET_DIR=target/static
PACKAGES := libgdal-dev pkg-config libsqlite3-dev g++
SKYSWEEP := target/release/skysweep
TOWN := data-samples/town
# What plugins.qgis.org wants to know of the plugin: where its source and its tracker are, and whom to write to.
PLUGIN_HOME := https://example.org/skysweep
PLUGIN_EMAIL := plugin@example.org
DEMO := out/demo

# Fails when Cargo is absent; sets MISSING to what else is needed to build.
define FIND_MISSING
command -v cargo > /dev/null || { echo "error: cargo not found: install Rust from https://rustup.rs, then run make again" >&2; exit 2; }
MISSING=
for tool in pkg-config c++; do command -v "$$tool" > /dev/null || MISSING="$$MISSING $$tool"; done
for library in gdal proj sqlite3; do pkg-config --exists "$$library" 2> /dev/null || MISSING="$$MISSING $$library.pc"; done
endef

.PHONY: help setup check check-static demo test quick test-python fuzz lint readme stubs notebooks static wheel bench bench-kernels plugin test-qgis

help: ## list the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /make \1\t/' | expand -t 20

setup: ## install the system packages that are missing (Debian, Ubuntu: apt-get, with sudo unless you are root)
	@$(FIND_MISSING)
	[ -n "$$MISSING" ] || exit 0
	if ! command -v apt-get > /dev/null; then
	  echo "error: missing:$$MISSING. GDAL >= 3.4, PROJ >= 9.1 and SQLite (each with headers), pkg-config and a C++ compiler are" \
	    "needed. This system has no apt-get: install them with its own package manager, then run make again" >&2
	  exit 2
	fi
	SUDO=; [ "$$(id -u)" = 0 ] || SUDO=sudo
	WANTED=; for p in $(PACKAGES); do
	  dpkg-query -W -f '$${Status}' "$$p" 2> /dev/null | grep -q 'ok installed' || WANTED="$$WANTED $$p"
	done
	echo "installing system packages with apt-get:$${WANTED:- $(PACKAGES)}"
	$$SUDO apt-get update -qq
	$$SUDO env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $${WANTED:-$(PACKAGES)} > /dev/null
	$(FIND_MISSING)
	[ -z "$$MISSING" ] || { echo "error: after the installation these are still missing:$$MISSING" >&2; exit 2; }

check-static:
	@MISSING=
	for tool in cargo cmake c++ pkg-config sqlite3; do command -v "$$tool" > /dev/null || MISSING="$$MISSING $$tool"; done
	pkg-config --exists libopenjp2 2> /dev/null || MISSING="$$MISSING libopenjp2.pc"
	[ -z "$$MISSING" ] || { echo "error: missing:$$MISSING. The static build needs Rust and, on Debian and Ubuntu," \
	  "apt-get install cmake g++ pkg-config sqlite3 libopenjp2-7-dev" >&2; exit 2; }

check:
	@$(FIND_MISSING)
	[ -z "$$MISSING" ] || { echo "error: missing:$$MISSING. Run 'make setup', which installs the system packages" >&2; exit 2; }

demo: setup ## a surface model of the sample town, its accuracy and its picture, in out/demo
	@cargo build --release --bin skysweep
	$(SKYSWEEP) dsm $(TOWN)/view_*.tif -o $(DEMO) --overwrite
	echo
	echo "against the true surface:"
	$(SKYSWEEP) eval $(DEMO)/dsm/dsm.tif $(TOWN)/truth/dsm.tif --align xyz
	echo
	echo "surface model  $(DEMO)/dsm/dsm.tif"
	echo "picture        $(DEMO)/dsm/relief.png"
	echo "report         $(DEMO)/report/report.html"

test: setup ## unit, property, integration and documentation tests, and those of the Python package
	@crates/python/tests/environment.sh > /dev/null & ENVIRONMENT=$$!
	cargo test --workspace
	wait "$$ENVIRONMENT" || true
	crates/python/tests/run.sh

quick: check ## before a commit: format, clippy, rules of code and pages, Python's functions, unit tests of the crates that differ from BASE (HEAD~1)
	@cargo fmt --all --check
	cargo clippy --workspace --lib --bins -- -D warnings
	cargo test --quiet -p skysweep -p skysweep-python --test architecture --test documents --test signatures
	BASE=$${BASE:-$$(git rev-parse --quiet --verify HEAD~1 || echo HEAD)}
	CHANGED=$$({ git diff --name-only "$$BASE"; git ls-files --others --exclude-standard; } |
	  sed -nE 's|^crates/([a-z]+)/.*|\1|p' | sort -u)
	PACKAGES=; for crate in $$CHANGED; do [ ! -f "crates/$$crate/Cargo.toml" ] || PACKAGES="$$PACKAGES -p skysweep-$$crate"; done
	if [ -n "$$PACKAGES" ]; then cargo test --quiet --lib $$PACKAGES; else echo "no crate differs from $$BASE"; fi

test-python: check ## the tests of the Python package alone, in target/python/venv
	@cargo build --workspace
	crates/python/tests/run.sh

fuzz: check ## up to an hour of hostile input: mutated files over all readers and whole runs (SKYSWEEP_FUZZ_SEED chooses others)
	@SKYSWEEP_FUZZ_INPUTS=400000 SKYSWEEP_FUZZ_RUNS=10000 SKYSWEEP_FUZZ_SECONDS=3600 \
	  cargo test --test fuzz -- --nocapture 2>&1 | tee >(grep '^fuzz:' > benches/results/fuzz.txt)

lint: check ## format, clippy on every target (benches too), documentation; warnings are errors
	@cargo fmt --all --check
	cargo clippy --workspace --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps

plugin: ## the plugin for QGIS, in out/skysweep_qgis.zip
	@rm -rf out/qgis out/skysweep_qgis.zip
	mkdir -p out/qgis
	cp -r qgis/skysweep out/qgis/
	rm -rf out/qgis/skysweep/__pycache__
	cp LICENSE-MIT out/qgis/skysweep/LICENSE
	cp LICENSE-APACHE out/qgis/skysweep/
	sed -i -e 's|https://example.org/skysweep|$(PLUGIN_HOME)|; s|plugin@example.org|$(PLUGIN_EMAIL)|' out/qgis/skysweep/metadata.txt
	python3 -c 'import shutil; shutil.make_archive("out/skysweep_qgis", "zip", "out/qgis", "skysweep")'
	echo "plugin         out/skysweep_qgis.zip"

test-qgis: check ## the algorithms in an installed QGIS, without a window (not part of make test)
	@cargo build --bin skysweep
	qgis/tests/run_qgis.sh target/debug/skysweep

readme: check ## bring the numbers of benches/results into README.md and docs
	@SKYSWEEP_WRITE_NUMBERS=1 cargo test --quiet --test documents numbers

stubs: check ## write the Python functions of the jobs anew, of the configurations
	@SKYSWEEP_WRITE_STUBS=1 cargo test --quiet -p skysweep-python --test signatures the_functions

notebooks: check ## run the notebooks of docs/notebooks and store what their cells show
	@cargo build --workspace
	PYTHONPATH=$$(crates/python/tests/site.sh); export PYTHONPATH
	[ -d target/python/notebooks ] || python3 -m venv target/python/notebooks
	target/python/notebooks/bin/pip install --quiet --disable-pip-version-check numpy matplotlib nbconvert ipykernel
	env -u SKYSWEEP_DATA target/python/notebooks/bin/jupyter nbconvert --log-level WARN --to notebook --execute --inplace docs/notebooks/*.ipynb

static: check-static ## one file for machines without GDAL and PROJ: target/static/release/skysweep (about 15 minutes)
	@$(STATIC) cargo build --release --bin skysweep
	ls -lh target/static/release/skysweep

wheel: check-static ## the Python package as a wheel in out/wheels, with its own GDAL and PROJ (about 15 minutes)
	@python3 -m venv target/python/maturin
	target/python/maturin/bin/pip install --quiet --disable-pip-version-check 'maturin>=1.7,<2'
	$(STATIC) target/python/maturin/bin/maturin build --release --out out/wheels

bench: check ## speed against error: every preset on every scene; writes benches/results (about 15 minutes)
	@cargo bench --bench scenes

bench-kernels: check ## criterion benches of the kernels
	@cargo bench --workspace --exclude skysweep
