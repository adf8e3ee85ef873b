# Every target does its own set-up. Requirements: Python 3.11-3.13, pip, make, git. Root is not needed.
# The environment is .venv, at the versions and hashes of requirements-dev.lock, wheels only.

PYTHON ?= python3
UV_VERSION := 0.13.8
BIN := .venv/bin
# Tests and tools read and write UTF-8 whatever the terminal shows; a flight prints what it can show.
UTF8 := PYTHONUTF8=1 PYTHONIOENCODING=
PYTEST = $(UTF8) $(BIN)/pytest

# What the shell says about Python, pip and uv is for other environments: modules of a ROS workspace,
# a pip that installs for the user. Kept is where packages come from, and how text is printed.
# PYTHONDONTWRITEBYTECODE would compile the imports of each process of a flight anew, for two seconds.
KEPT := PYTHON PYTHONUTF8 PYTHONIOENCODING PYTHONUNBUFFERED \
	$(addprefix PIP_,CONFIG_FILE INDEX_URL EXTRA_INDEX_URL FIND_LINKS NO_INDEX TRUSTED_HOST CERT \
		CLIENT_CERT PROXY RETRIES TIMEOUT DEFAULT_TIMEOUT CACHE_DIR KEYRING_PROVIDER) \
	$(addprefix UV_,CONFIG_FILE DEFAULT_INDEX INDEX INDEX_URL EXTRA_INDEX_URL FIND_LINKS NO_INDEX \
		INDEX_STRATEGY INSECURE_HOST KEYRING_PROVIDER SYSTEM_CERTS NATIVE_TLS OFFLINE NO_CACHE \
		CACHE_DIR LINK_MODE HTTP_TIMEOUT HTTP_RETRIES CONCURRENT_DOWNLOADS VERSION)
unexport $(filter-out $(KEPT) UV_INDEX_%,$(filter PYTHON% PIP_% UV_%,$(.VARIABLES))) VIRTUAL_ENV

# uv trusts the system's certificates and asks the index that pip is configured for, unless
# UV_DEFAULT_INDEX names another one.
export UV_SYSTEM_CERTS ?= 1
export UV_PYTHON_DOWNLOADS := never
export UV_PYTHON_PREFERENCE := only-system
PIP_INDEX = $${PIP_INDEX_URL:-$$($(PYTHON) -m pip config get global.index-url 2>/dev/null || true)}
UV = UV_DEFAULT_INDEX="$${UV_DEFAULT_INDEX:-$(PIP_INDEX)}" .boot/uv

# A folder with an environment is ready when a file in it says that it was made of these very files:
# dates say nothing after git, cp or rsync. $(call ready,FOLDER,FILES) is that file.
ready = $(1)/ready-$(shell cat $(2) | cksum | cut -d ' ' -f 1)
# An environment is made so that it can be moved and copied; one whose Python is gone is made anew.
fresh = { grep -qs 'relocatable = true' $(1)/pyvenv.cfg && $(1)/bin/python -I -c '' 2>/dev/null || \
	rm -rf $(1); } && .boot/uv venv --quiet --relocatable --allow-existing --no-project --python $(2) $(1)
# The last line of a recipe that makes a folder: ready for these files, and for no earlier ones.
done = rm -f $(@D)/ready* && touch $@
# $(call tool,FOLDER,LOCK): an environment with what a lock names, wheels only, hashes checked.
tool = $(call fresh,$(1),.venv/bin/python) && \
	$(UV) pip sync --quiet --python $(1) --require-hashes --only-binary :all: $(2)
$(shell .venv/bin/python -I -c '' 2>/dev/null || rm -f .venv/ready*; \
	.boot/uv --version >/dev/null 2>&1 || rm -f .boot/uv)
READY := $(call ready,.venv,requirements-dev.lock pyproject.toml messages/build_hook.py Makefile)

.DEFAULT_GOAL := help
.PHONY: help setup run test test-long px4 nightly faults soak wheel code-checks tests-of-clocks tests-of-clients \
	tests-of-processes tests-of-studies tests-of-the-rest \
	fsw-kernels sitl-kernels mutate fuzz interop lock docs docs-test pictures pages clean

help: ## show this list
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / { printf "make %-9s %s\n", $$1, $$2 }' Makefile

setup: $(READY) messages/dialect.py ## create .venv with everything in it (nothing to do if nothing changed)
	@echo "setup: .venv is ready"

run: setup ## set up, then fly the three-wall scenario with motion capture
	$(BIN)/pandion fly walls --sensors mocap

# One line for a check that passes, all of its output for one that does not.
define check
@out=$$($(2) 2>&1) && printf '%-14s%s\n' '$(1)' "$$(printf '%s\n' "$$out" | grep . | tail -n 1)" || \
	{ printf '%-14sfailed: %s\n%s\n' '$(1)' '$(2)' "$$out"; exit 1; }
endef

test: setup ## set up, then run every check: ruff, mypy, import-linter, pytest
	@echo "checks in four rows at once; each reports when it is over"
	@$(MAKE) --no-print-directory --jobs=4 code-checks tests-of-processes tests-of-clients tests-of-studies \
		tests-of-the-rest

# Folders are in rows that take about as long. Four rows for two cores: those of processes and clients
# often wait for clocks, and the others have their core meanwhile. Kernels are compiled once, before
# whoever needs them, because rows that compile the same kernels at once take twice the time; what
# needs none comes before. Few rows: each imports everything and loads the kernels, for eight seconds.
OF_CLOCKS := tests/fsw/link/test_stream_links.py tests/messages
OF_CLIENTS := tests/conversations tests/interop
OF_PROCESSES := tests/benchmarks tests/cli tests/processes tests/timing
OF_STUDIES := $(addprefix tests/,architecture fuzz library mutation sitl studies view) \
	$(addprefix tests/fsw/autopilot/,control estimation)
code-checks:
	$(call check,lint,$(BIN)/ruff check .)
	$(call check,format,$(BIN)/ruff format --check .)
	$(call check,types,$(BIN)/mypy)
	$(call check,imports,$(BIN)/lint-imports)
tests-of-clocks: code-checks
	$(call check,clocks,$(PYTEST) -m "not long" $(OF_CLOCKS))
tests-of-clients: tests-of-clocks fsw-kernels sitl-kernels
	$(call check,clients,$(PYTEST) -m "not long" $(OF_CLIENTS))
tests-of-processes: fsw-kernels sitl-kernels
	$(call check,processes,$(PYTEST) -m "not long" $(OF_PROCESSES))
tests-of-studies: fsw-kernels sitl-kernels
	$(call check,studies,$(PYTEST) -m "not long" $(OF_STUDIES))
tests-of-the-rest: fsw-kernels sitl-kernels
	$(call check,the rest,$(PYTEST) -m "not long" $(addprefix --ignore=, \
		$(OF_CLOCKS) $(OF_CLIENTS) $(OF_PROCESSES) $(OF_STUDIES)))
fsw-kernels:
	@$(BIN)/python -m studies.flight.kernels fsw px4
sitl-kernels:
	@$(BIN)/python -m studies.flight.kernels sitl

test-long: setup ## the tests that make test leaves out to be short, and properties with more examples
	$(PYTEST) -m long
	PROPERTIES=thorough $(PYTEST) -m hypothesis

px4: setup ## fly with a real PX4, plant below and planner above (long): PX4_BUILD=folder of its SITL build
	PX4_BUILD="$(PX4_BUILD)" $(PYTEST) -m long -s -rs tests/real_px4

faults: setup ## fly every mode with every fault, write build/faults.html (long): ONLY=motor SEED=1 DRAWN=300
	@mkdir -p build
	$(BIN)/pandion faults --matrix --journal build/faults.jsonl \
		--json build/faults.json --html build/faults.html \
		$(if $(ONLY),--only "$(ONLY)") $(if $(SEED),--seed $(SEED)) $(if $(DRAWN),--drawn $(DRAWN))

soak: setup ## an hour in real time with random failures and a busy client: MINUTES=60 SEED=1
	@mkdir -p build
	$(BIN)/python -m benchmarks soak --minutes $(or $(MINUTES),60) --seed $(or $(SEED),0) \
		--json build/soak.json

nightly: setup ## every long target, and a table of what passed (hours): ONLY="docs fuzz" or LEAVE=interop
	@$(UTF8) $(BIN)/python -m tests.nightly $(if $(ONLY),--only $(ONLY)) $(if $(LEAVE),--leave $(LEAVE))

# cosmic-ray in an environment of its own; the tests run in .venv, on a copy of the checkout. FILES are
# files and folders, MODULES drawn of them, SAMPLE mutants of each, drawn with SEED, BUDGET the seconds that the tests of
# a file may take; none of them: every mutant, 20 s.
MUTATION := tests/mutation
MUTATE := $(call ready,.mutation/tool,$(MUTATION)/tool.lock)
$(MUTATE): | $(READY)
	@$(call tool,$(@D),$(MUTATION)/tool.lock)
	@$(done)

mutate: setup $(MUTATE) ## change fsw a little, see if a test notices: SAMPLE=40 SEED=1 FILES=fsw/autopilot/mpc JSON=1
	@$(UTF8) PYTHONPATH=. .mutation/tool/bin/python -m tests.mutation.mutate $(FILES) --seed $(or $(SEED),1) \
		$(if $(MODULES),--modules $(MODULES)) $(if $(SAMPLE),--sample $(SAMPLE)) $(if $(BUDGET),--budget $(BUDGET)) $(if $(JSON),--json)

# libFuzzer for Python, in a folder of its own; the readers are those of .venv. TARGETS are names of
# tests/fuzz/fuzz.py, SECONDS for each of them; KEEP=1 keeps inputs that reach something new.
FUZZ := tests/fuzz
FUZZER := $(call ready,.fuzz,$(FUZZ)/tool.lock)
$(FUZZER): | $(READY)
	@$(call tool,$(@D),$(FUZZ)/tool.lock)
	@$(done)

fuzz: setup $(FUZZER) ## new inputs for every reader of files and datagrams: TARGETS=scenario SECONDS=600 KEEP=1
	@$(UTF8) PYTHONPATH=.:$$(echo .fuzz/lib/python*/site-packages) $(BIN)/python -m tests.fuzz.fuzz $(TARGETS) \
		--seconds $(or $(SECONDS),60) $(if $(KEEP),--keep)

# Of other people's clients; each has a lock of its own, and none is needed to fly or to test.
EXTERNAL := tests/interop/external
MAVPROXY := $(call ready,.interop/mavproxy,$(EXTERNAL)/mavproxy.lock)
$(MAVPROXY): | $(READY)
	@$(call tool,$(@D),$(EXTERNAL)/mavproxy.lock)
	@$(done)

NODE := $(call ready,.interop/node,$(wildcard $(EXTERNAL)/node/*))
$(NODE): | $(READY)
	@mkdir -p $(@D) && cp $(EXTERNAL)/node/* $(@D)
	@cd $(@D) && npm ci --silent --no-audit --no-fund --ignore-scripts
	@$(done)

COMPANIONS := $(call ready,.interop/companions,$(EXTERNAL)/companions.lock)
$(COMPANIONS): | $(READY)
	@$(call tool,$(@D),$(EXTERNAL)/companions.lock)
	@$(done)

interop: setup $(MAVPROXY) $(COMPANIONS) $(NODE) ## other people's clients (needs npm)
	PANDION_INTEROP=.interop $(PYTEST) $(EXTERNAL)

wheel: setup ## build dist/pandion-*.whl, which pip installs anywhere
	@$(BIN)/python -m hatchling build -t wheel

# Sphinx has an environment and a lock of its own; the API pages import the code from .venv.
DOCS := $(call ready,.docs,requirements-docs.lock)
$(DOCS): | $(READY)
	@$(call tool,$(@D),requirements-docs.lock)
	@$(done)

docs: setup $(DOCS) ## build the documentation site into build/docs (warnings are errors)
	@$(UTF8) .docs/bin/python -m sphinx -q -n -W --keep-going -b html docs build/docs
	@echo "docs: open build/docs/index.html"

docs-test: setup ## run every command and example of the documentation, flights included
	$(PYTEST) tests/docs

pictures: setup ## fly and draw docs/images again
	$(UTF8) $(BIN)/python -m docs.figures

pages: setup ## write the generated pages of docs/reference again
	@$(UTF8) $(BIN)/python -m docs.pages

# A uv that is there is used if it understands what is asked of it; else the pinned one is fetched
# into .boot with `pip download` alone: a fresh Debian has neither ensurepip nor a pip that may install,
# and a user's pip may be told to install elsewhere.
.boot/uv:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' || \
		{ echo "python 3.11, 3.12 or 3.13 is needed; choose one with: make PYTHON=python3.12"; exit 1; }
	@mkdir -p .boot
	@if uv venv --help 2>/dev/null | grep -q -e --system-certs; then \
		echo "setup: using $$(uv --version)"; \
		ln -sf "$$(command -v uv)" .boot/uv; \
	else \
		echo "setup: fetching uv $(UV_VERSION) into .boot"; \
		PIP_REQUIRE_VIRTUALENV=0 $(PYTHON) -m pip download --quiet --no-input --no-deps --dest .boot/wheel \
			--disable-pip-version-check --only-binary :all: uv==$(UV_VERSION) && \
		$(PYTHON) -m zipfile -e .boot/wheel/uv-*.whl .boot/wheel && \
		mv .boot/wheel/uv-*.data/scripts/uv .boot/uv && chmod +x .boot/uv && rm -r .boot/wheel; \
	fi

# Order-only: a newer uv is no reason to install again.
$(READY): | .boot/uv
	@echo "setup: creating .venv"
	@$(call fresh,.venv,"$$($(PYTHON) -c 'import sys; print(sys.executable)')")
	@echo "setup: installing the locked packages (wheels only, hashes checked)"
	@$(UV) pip sync --quiet --python .venv --require-hashes --only-binary :all: \
		requirements-dev.lock
	@echo "setup: generating the MAVLink dialect and installing pandion"
	@.boot/uv pip install --quiet --python .venv --no-build-isolation --no-deps --no-index --editable .
	@for found in .venv/lib/python*/site-packages/_pandion.pth; do echo ../../../.. >"$$found"; done
	@$(done)

# The install has generated it; this is for an edit of the XML.
messages/dialect.py: messages/pandion.xml messages/upstream.xml messages/generate.py | $(READY)
	@$(UTF8) $(BIN)/python -m messages.generate

# Hashes only: no index, no download address, nothing of the machine that made the file.
COMPILE = $(UV) pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes \
	--only-binary :all: --no-emit-index-url --no-annotate --custom-compile-command 'make lock'

lock: .boot/uv ## renew requirements.lock (to fly) and requirements-dev.lock (to test as well)
	@echo "lock: resolving the newest versions"
	@$(COMPILE) pyproject.toml --group build --output-file requirements.lock
	@$(COMPILE) pyproject.toml --group dev --constraints requirements.lock \
		--output-file requirements-dev.lock
	@$(COMPILE) --group mavproxy --no-deps --output-file $(EXTERNAL)/mavproxy.lock
	@$(COMPILE) --group companions --output-file $(EXTERNAL)/companions.lock
	@$(COMPILE) --group docs --constraints requirements-dev.lock --output-file requirements-docs.lock
	@$(COMPILE) --group mutation --no-deps --output-file $(MUTATION)/tool.lock
	@$(COMPILE) --group fuzz --no-deps --output-file $(FUZZ)/tool.lock
	@git diff --stat -- requirements.lock requirements-dev.lock requirements-docs.lock \
		$(EXTERNAL)/*.lock $(MUTATION) $(FUZZ)

clean: ## remove the environment, generated files and caches
	rm -rf .venv .boot .docs .interop .mutation .fuzz build dist messages/dialect.py .mypy_cache .ruff_cache .pytest_cache \
		.hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
