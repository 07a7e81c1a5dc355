# make compare and make test each do everything on a fresh machine: environment, install, run.
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin
STAMP = $(VENV)/.installed

.PHONY: help compare sweep test dist install clean

help:  ## this list
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

compare: $(STAMP)  ## simulate the rescue maze, run every algorithm, print the tables
	$(BIN)/python -m bench.compare

sweep: $(STAMP)  ## which algorithm to take: drives degraded until each run is lost
	$(BIN)/python -m bench.sweep --quick

test: $(STAMP)  ## linters, types and tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -n 2

dist: $(STAMP)  ## wheel and sdist in dist/, tried in an empty environment
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dist]'
	rm -rf dist
	$(BIN)/python -m build
	$(BIN)/python tests/try_wheel.py dist/*.whl

install: $(STAMP)  ## the environment alone

clean:  ## remove environment, caches, results and dist
	rm -rf $(VENV) results dist .mypy_cache .ruff_cache .hypothesis .pytest_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(STAMP): pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed, $(PYTHON) is %d.%d; say make PYTHON=..." % sys.version_info[:2] if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv $(VENV) || { echo "python venv is missing: install it (Debian: apt install python3-venv)"; exit 1; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	touch $(STAMP)
