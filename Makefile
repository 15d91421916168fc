# What people do with this repository. Every target does its own set-up on a fresh machine (scripts/setup).

# One profile for everything, so that the demo, the tests, clippy and the benches share one build of HDF5.
CARGO_FLAGS ?= --release --locked
# What tests need and users do not.
NOT_SHIPPED := --exclude plyflow-faults --exclude plyflow-e2e --exclude plyflow-benches --exclude plyflow-fuzz
TARGET := $(or $(CARGO_TARGET_DIR),target)
PLYFLOW := $(TARGET)/release/plyflow
# The workflow of `make demo`; `make demo DEMO=workflows/flat-tool/workflow.yaml` runs another.
DEMO ?= workflows/joggle-spar/workflow.yaml
CARGO := . ./.tools/env && cargo

# The book's builder is a workspace of its own: what it needs weighs on nobody who only runs Plyflow.
BOOK := . ./.tools/env && CARGO_TARGET_DIR=$(TARGET)/book-builder cargo
# What needs no HDF5, no plugin and no run: its tests take seconds once built.
QUICK := -p plyflow-abi -p plyflow-model -p plyflow-files -p plyflow-fixed -p plyflow-study -p plyflow-sdk -p plyflow-geometry -p plyflow-surface \
  -p plyflow-kernels -p plyflow-blank -p plyflow-conformance -p plyflow-python-law

# The crates whose loops hold invariants, with these looked at. A package's own settings leave all others as they are built already. In many
# units, as they run but once.
CHECKED := $(foreach crate,mechanics kernels,$(foreach look,debug-assertions=true overflow-checks=true codegen-units=16 opt-level=2,\
  --config profile.release.package.plyflow-$(crate).$(look)))

# With these two beside them the dependencies of the two have the features that the whole workspace gives them, and are not compiled once more.
SAME_FEATURES := -p plyflow -p plyflow-python-law

.PHONY: help build demo check test checked long fuzz device hard-cases templates wheel lint bench book docs pictures clean

help: ## show this list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' Makefile | while IFS="$$(printf '\t')" read -r n t; do printf 'make %-10s %s\n' "$$n" "$$t"; done

build: ## build the program and the plugins into target/release
	@scripts/setup
	$(CARGO) build $(CARGO_FLAGS) --workspace $(NOT_SHIPPED)

demo: build ## run the joggle spar: coarse run, zones, local runs, report
	$(PLYFLOW) run $(DEMO)
	@echo 'report: $(subst /workflow,/report,$(DEMO:.yaml=.html))'

check: ## form, lints and the tests that need no HDF5: under a minute once built
	@scripts/setup python
	$(CARGO) fmt --all --check
	scripts/check-docs
	scripts/check-bits
	scripts/check-imports
	scripts/check-tests
	scripts/check-lengths
	scripts/check-features
	$(CARGO) clippy $(CARGO_FLAGS) --workspace --all-targets -- -D warnings
	$(CARGO) test $(CARGO_FLAGS) $(QUICK) --tests

test: ## run all tests, also with VTK's own reader, Chromium and a step in C
	@scripts/setup tests
	. ./.tools/env && scripts/run-tests $(CARGO_FLAGS) --workspace
	. ./.tools/env && scripts/check-inlined
	scripts/check-vtk
	scripts/check-report

checked: ## run the tests of mechanics and kernels with debug assertions and overflow checks: minutes
	@scripts/setup
	. ./.tools/env && scripts/run-tests --of mechanics --of kernels $(CARGO_FLAGS) $(CHECKED) $(SAME_FEATURES) -p plyflow-mechanics -p plyflow-kernels --tests

long: ## run the tests that take many minutes
	@scripts/setup
	$(CARGO) test $(CARGO_FLAGS) -p plyflow-e2e -p plyflow-faults -p plyflow-forming-explicit -p plyflow-mechanics -- --ignored --nocapture
	. ./.tools/env && PLYFLOW_OPERATIONS=all cargo test $(CARGO_FLAGS) -p plyflow-e2e --test disk -- --nocapture
	$(CARGO) test $(CARGO_FLAGS) -p plyflow-characterisation --test calibration -- --ignored --nocapture

fuzz: ## put readers of files under inputs that coverage leads; an hour, or make fuzz FUZZ_SECONDS=120
	scripts/fuzz --seconds $(or $(FUZZ_SECONDS),3600)

device: ## compile what a GPU computes, without a GPU: registers and spills of each function
	@scripts/setup device
	$(CARGO) build $(CARGO_FLAGS) -p plyflow-kernels --example device_sources
	.tools/venv/bin/python scripts/check-device

hard-cases: build ## run what is made to break elements, laws and contacts, and write docs/hard-cases.md
	scripts/hard-cases

templates: build ## make a folder of each template of a plugin outside of the repository, and build, check and run it
	scripts/check-templates

wheel: build ## pack dist/plyflow-*.whl: program, plugins, header, templates, crates, workflows, and the package for Python
	@scripts/setup wheel
	. ./.tools/env && .tools/venv/bin/python scripts/make-wheel dist

lint: ## check form, lints and JSON Schemas
	@scripts/setup python
	$(CARGO) fmt --all --check
	$(CARGO) clippy $(CARGO_FLAGS) --workspace --all-targets -- -D warnings
	$(BOOK) fmt --manifest-path docs/builder/Cargo.toml --check
	scripts/check-docs
	scripts/check-bits
	scripts/check-imports
	scripts/check-tests
	scripts/check-lengths
	scripts/check-features

bench: build ## measure; rows go to docs/benchmarks
	$(CARGO) build $(CARGO_FLAGS) -p plyflow-benches
	$(TARGET)/release/plyflow-benches

book: ## build the book into target/book, and check its links and formulas
	@scripts/setup
	scripts/check-docs
	$(BOOK) test --quiet --locked --manifest-path docs/builder/Cargo.toml
	$(BOOK) run --quiet --locked --manifest-path docs/builder/Cargo.toml

docs: book ## the book, and the pages of the code (target/doc)
	RUSTDOCFLAGS="-D warnings -A rustdoc::private_intra_doc_links" $(SHELL) -c '$(CARGO) doc $(CARGO_FLAGS) --workspace --no-deps'

pictures: build ## make the pictures of the book anew from runs; half an hour
	scripts/make-pictures

clean: ## remove what was built; stores of workflows and .tools stay
	cargo clean
