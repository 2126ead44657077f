# Every verb sets up what it needs; a fresh machine has cargo, python3 (3.11 or later) and make.

SHELL := bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Versions that passed the tests; /dev/null for the newest.
CONSTRAINTS ?= constraints.txt
RUST := $(shell find src crates -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock
CRITERION := $(or $(CARGO_TARGET_DIR),target)/criterion
# Open3D brings packages that disturb pytest: it has an environment of its own.
BENCH_VENV := build/bench-venv
# Sets and dictionaries of words keep one order in every run.
export PYTHONHASHSEED := 0

.PHONY: help advisories miri demo docs model test test-rust test-python test-long bench-physics bench-features referee lint workflows bench build fuzz clean

help: ## list the verbs
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /\1\t/' | expand -t 14

demo: $(VENV)/.native ## the whole job on a recording with a known truth; report in demo/report.html
	$(BIN)/granulcal demo --out demo

test: test-rust test-python ## everything that ends within minutes

# What is drawn at random is the same in every run, so that a failure can be had again; `make test-long` draws afresh.
test-rust: export PROPTEST_RNG_SEED ?= 1
test-rust:
	cargo test --workspace --locked

test-python: $(VENV)/.native
	$(BIN)/python -m pytest -m "not slow"

test-long: $(VENV)/.native ## every test, the slow ones too
	cargo test --workspace --locked --release -- --include-ignored
	$(BIN)/python -m pytest

# Python of the system, for which Debian packages siconos.
SICONOS_PYTHON ?= /usr/bin/python3

referee: build ## compare the contact solver with siconos on frozen substeps; installs siconos (apt), some minutes
	$(SICONOS_PYTHON) -c 'import siconos.numerics' 2>/dev/null || scripts/referee/install.sh
	$(SICONOS_PYTHON) scripts/referee/referee.py --cli target/release/granulcal-cli

lint: $(VENV)/.deps ## format, lints, types, spelling, documentation, licences
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --locked -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked
	cargo deny --version >/dev/null 2>&1 || cargo install cargo-deny --locked
	cargo deny --workspace check bans licenses sources
	$(MAKE) --no-print-directory advisories
	$(PYTHON) scripts/walls/check.py
	$(PYTHON) scripts/prose.py
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/pyright
	$(BIN)/typos

# The database comes from the network, which a machine that builds may not have: that is told and no fault.
advisories: ## dependencies with known vulnerabilities; fails for one, is skipped without the network
	cargo deny --version >/dev/null 2>&1 || cargo install cargo-deny --locked
	if timeout 120 cargo deny --workspace fetch db >/dev/null 2>&1; then \
		cargo deny --workspace check --disable-fetch advisories; \
	else echo "advisories: the database cannot be reached; not checked"; fi

# The parts of dem that are unsafe: registers, of this machine's baseline and AVX2, and bodies that threads share.
# Small scenes only, for it is slow. rayon's queues have pointers of integers, of which Miri would warn at length.
MIRI_TESTS ?= lanes:: body:: threads_that_share
MIRI := MIRIFLAGS="-Zmiri-disable-isolation -Zmiri-tree-borrows -Zmiri-permissive-provenance -Zmiri-ignore-leaks" \
	cargo +nightly miri test -p granulcal-dem --lib --locked -- $(MIRI_TESTS)
miri: ## the unsafe parts of crates/dem under Miri; installs nightly Rust with Miri
	rustup run nightly cargo miri --version >/dev/null 2>&1 || rustup toolchain install nightly --profile minimal --component miri,rust-src
	$(MIRI)
	RUSTFLAGS="-C target-feature=+avx2,+fma" $(MIRI)

bench: ## criterion benchmarks and one table of them with the bars; see benches/README.md
	mkdir -p $(CRITERION) && touch $(CRITERION)/.started
	cargo bench --locked
	$(PYTHON) scripts/bench_table.py --newer-than $(CRITERION)/.started

bench-features: $(VENV)/.native ## statistics and depth image beside scipy, dcor and Open3D in one run
	test -x $(BENCH_VENV)/bin/python || $(PYTHON) -m venv $(BENCH_VENV)
	$(BENCH_VENV)/bin/python -m pip install --quiet -r benches/peers/features-requirements.txt
	PYTHONPATH=python $(BENCH_VENV)/bin/python benches/peers/features.py

bench-physics: ## bulk laws against their closed forms, the table of docs/results/physics.md; LAWS="silo repose" chooses
	cargo run --release --locked --example bench_physics -- $(LAWS)

build: $(VENV)/.native ## the command line (target/release/granulcal-cli) and the Python package
	cargo build --release --locked -p granulcal-cli

# Seconds on each target.
FUZZ_SECONDS ?= 600
FUZZ_TARGETS ?= bag mcap png_toml npz model scene prior

fuzz: $(VENV)/.native ## fuzz the readers of files, FUZZ_SECONDS (600) on each of FUZZ_TARGETS and on tasks; installs nightly Rust and cargo-fuzz
	rustup run nightly rustc --version >/dev/null 2>&1 || rustup toolchain install nightly --profile minimal
	cargo fuzz --version >/dev/null 2>&1 || cargo install cargo-fuzz --locked
	for target in $(FUZZ_TARGETS); do \
		mkdir -p fuzz/found/$$target; \
		cargo +nightly fuzz run $$target fuzz/found/$$target fuzz/corpus/$$target \
			$$(ls -d fuzz/regressions/$$target 2>/dev/null) -- \
			-max_total_time=$(FUZZ_SECONDS) -max_len=65536 -timeout=30 -rss_limit_mb=1024; \
	done
	$(BIN)/python fuzz/task.py $(FUZZ_SECONDS)

# The site has an environment of its own: none of it is needed to use or test granulcal.
DOCS_VENV := build/docs-venv
RUST_PAGES := $(or $(CARGO_TARGET_DIR),target)/doc

docs: $(VENV)/.native ## the site in build/site: guide, gallery, commands, Python, theory, results; links are strict
	test -x $(DOCS_VENV)/bin/mkdocs || { $(PYTHON) -m venv $(DOCS_VENV); \
		$(DOCS_VENV)/bin/python -m pip install --quiet -r docs/requirements.txt; }
	$(BIN)/python scripts/build_docs.py
	$(DOCS_VENV)/bin/mkdocs build --strict --quiet --config-file build/mkdocs.yml
	rm -rf $(RUST_PAGES)
	cargo doc --workspace --no-deps --locked
	rm -rf build/site/rust && cp -r $(RUST_PAGES) build/site/rust
	$(BIN)/python scripts/check_site.py build/site

WORKFLOWS_VENV := build/workflows-venv
ACTIONLINT := github.com/rhysd/actionlint/cmd/actionlint@v1.7.12

workflows: ## lint the workflows of .github: their schema, what they may do; with Go also actionlint
	test -x $(WORKFLOWS_VENV)/bin/zizmor || { $(PYTHON) -m venv $(WORKFLOWS_VENV); \
		$(WORKFLOWS_VENV)/bin/python -m pip install --quiet zizmor check-jsonschema; }
	$(WORKFLOWS_VENV)/bin/check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
	$(WORKFLOWS_VENV)/bin/zizmor --offline --quiet .github/workflows
	if command -v go >/dev/null; then go run $(ACTIONLINT); else echo "actionlint: needs Go; not run"; fi

MODEL_POURS ?= 1000
MODEL_DATA ?= data/funnel

model: $(VENV)/.native ## the model of the built-in funnel that ships with the wheel; MODEL_POURS pours (1000) in MODEL_DATA, resumed
	$(BIN)/granulcal generate funnel default -n $(MODEL_POURS) -o $(MODEL_DATA) || test $$? -eq 3 # some pours jam
	$(BIN)/granulcal model funnel --data $(MODEL_DATA) --compact -o python/granulcal/models/funnel

clean: ## remove what was built, not what was measured
	rm -rf target $(VENV) python/granulcal/_native.abi3.so

# The environment: dependencies change with pyproject.toml only.
$(VENV)/.deps: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --editable ".[dev]" --constraint $(CONSTRAINTS)
	touch $@

# The extension: rebuilt when Rust changes, without asking the network.
# Its time is that of the begin: what is edited meanwhile is newer.
$(VENV)/.native: $(VENV)/.deps $(RUST)
	touch $@.begun
	VIRTUAL_ENV=$(abspath $(VENV)) $(BIN)/maturin develop --release --locked
	mv $@.begun $@
