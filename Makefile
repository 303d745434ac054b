# Two commands do everything: `make demo` and `make test`. The rest are parts of them.
# The first that runs and is new enough: a name may be there for a version that is not.
CANDIDATES := python3.11 python3.12 python3.13 python3 python
NEW_ENOUGH := import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))
PYTHON ?= $(firstword $(foreach name,$(CANDIDATES),$(shell $(name) -c '$(NEW_ENOUGH)' 2>/dev/null && echo $(name))))
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
# Unpacks with a quarter of the processor time of pip, and compiles nothing that is not imported.
UV := $(BIN)/python -m uv --quiet pip install --python $(BIN)/python
install = $(UV) $(1) || $(PIP) install $(1)
# One more than the two cores of the machines that it runs on: a third of the time tests wait.
JOBS ?= 3
PACKAGES := slopewise models planner services benchmarks
CORE := hatch_build.py $(wildcard planner/core/* planner/core/*/*)

# What Python compiled is kept, also where the environment has this set: processes share it.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo test lint style types tests core nightly bench docs format clean

demo: $(VENV)/.installed  ## plan a dozen candidates over a generated hill, and say where the page is
	$(BIN)/slopewise demo --out out/demo

test: style  ## everything that has to hold: style, types, import contracts, tests
	$(MAKE) --no-print-directory -j 2 types tests  # types are derived on one core alone

lint: style types  ## style, types, import contracts

style: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.installed-dev
	$(BIN)/mypy
	$(BIN)/lint-imports

tests: $(VENV)/.installed-dev
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m "not nightly"

core: $(VENV)/.tools  ## the compiled core, again, and nothing else
	$(BIN)/python hatch_build.py

nightly: $(VENV)/.installed-dev  ## thousands of generated cases, all real terrain, half an hour of random input under sanitizers
	$(BIN)/python -m pytest -n $(JOBS) -m nightly --timeout 7200
	SLOPEWISE_FUZZ_SECONDS=600 $(BIN)/python -m pytest -n $(JOBS) -m "nightly or not nightly" --timeout 7200 tests/planner/test_sanitizers.py

bench: $(VENV)/.installed-dev  ## the planner beside its peers
	$(BIN)/slopewise bench --json out/bench.json

docs: $(VENV)/.installed-dev  ## what is generated in README.md and docs/, and docs/ as a site in out/docs
	$(BIN)/python docs/site/samples.py
	$(BIN)/python docs/site/reference.py
	$(BIN)/python docs/site/results.py
	$(BIN)/python docs/site/notebook.py
	$(BIN)/python docs/site/sizes.py
	$(BIN)/mkdocs build --strict

format: $(VENV)/.installed-dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf $(VENV) out build dist *.egg-info planner/_core.*so

$(VENV)/bin/python:
	$(if $(PYTHON),,$(error no Python of at least 3.11 runs here: install one, such as python3.12 with its venv, or name it with PYTHON=))
	$(PYTHON) -m venv $(VENV)

# What the core is compiled with; in the environment itself, so that it is compiled only once.
$(VENV)/.tools: $(VENV)/bin/python constraints.txt
	-$(PIP) install --only-binary :all: uv -c constraints.txt
	$(PIP) install editables hatchling nanobind -c constraints.txt
	$(PIP) install nanobind $$($(BIN)/python -c "import hatch_build as h; print(*h.missing_tools())") -c constraints.txt
	touch $@

$(VENV)/.installed: $(VENV)/.tools pyproject.toml $(CORE)
	$(call install,-e . -c constraints.txt --no-build-isolation)
	$(BIN)/python -m compileall -q $(PACKAGES)
	touch $@

# Packages arrive while the core is compiled, by name alone: what is missing is installed after it.
$(VENV)/.installed-dev: $(VENV)/.tools pyproject.toml $(CORE)
	$(UV) --no-deps -r constraints.txt & $(BIN)/python hatch_build.py; wait
	$(call install,-e ".[dev]" -c constraints.txt --no-build-isolation)
	$(BIN)/python -m compileall -q $(PACKAGES)
	touch $@ $(VENV)/.installed
