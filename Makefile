# Every target builds .venv first where it is missing or older than pyproject.toml or
# constraints.txt. Needed: make, python3 (3.11 or later) with venv, nothing else.

PYTHON ?= python3
# A folder with real data for `make test-data`; without it the tests that need it are skipped.
SI3FP_TEST_DATA ?=

BIN := .venv/bin
READY := .venv/.ready
SOURCES := src tests training benchmarks tools

.PHONY: help venv test test-data lint format demo clean

help:
	@echo "make demo       panoramas to a simulated model, on the street that ships with si3fp"
	@echo "make test       lint, types, imports, tests"
	@echo "make test-data  the slow tests; SI3FP_TEST_DATA names a folder with real data"
	@echo "make lint       ruff, mypy, import-linter"
	@echo "make format     let ruff rewrite the sources"
	@echo "make clean      remove .venv, caches and the demo's output"

venv: $(READY)

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "si3fp needs Python 3.11 or later; '$(PYTHON)' is missing or older."; \
	  echo "Install one and name it: make PYTHON=python3.11 $(or $(MAKECMDGOALS),venv)"; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' || { \
	  echo "'$(PYTHON)' cannot make virtual environments."; \
	  echo "On Debian and Ubuntu: apt-get install python3-venv"; exit 1; }
	$(PYTHON) -m venv --clear .venv
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[dev,energy,geo,estate]'
	@touch $@

test: lint
	$(BIN)/python -m pytest

test-data: venv
	@test -n "$(SI3FP_TEST_DATA)" || echo "SI3FP_TEST_DATA is not set: tests of real data are skipped."
	$(BIN)/python -m pytest -m slow

lint: venv
	$(BIN)/ruff check $(SOURCES)
	$(BIN)/ruff format --check $(SOURCES)
	$(BIN)/mypy
	$(BIN)/lint-imports

format: venv
	$(BIN)/ruff check --fix-only $(SOURCES)
	$(BIN)/ruff format $(SOURCES)

# Anew each time: results of an older state of the code would prove nothing.
demo: venv
	$(BIN)/si3fp demo --overwrite

clean:
	rm -rf .venv .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache demo-run
