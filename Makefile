# Everything from a bare clone:  make demo  |  make test  |  make help
# Another interpreter:           make PYTHON=python3.12 test
PYTHON ?= python3
JOBS ?= 2

BIN := .venv/bin
STAMP := .venv/.installed
DEMO := results/guided-division
SOURCES := $(wildcard src tests benchmarks experiments docs/*.py)

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-slow docs format bench clean
.DELETE_ON_ERROR:

help: ## show the targets
	@grep -E '^[a-z-]+:.*## ' $(firstword $(MAKEFILE_LIST)) | sed -E 's/:.*## /\t/' | expand -t 12

setup: $(STAMP) ## create .venv with the pinned dependencies and this package

demo: $(STAMP) ## simulate guided division; data, a figure and a movie go to results/guided-division
	$(BIN)/shapespace run guided-division --out $(DEMO) --resume
	$(BIN)/shapespace plot $(DEMO)
	$(BIN)/shapespace movie $(DEMO)

test: $(STAMP) ## format, lint, types, import ranks and tests
	$(BIN)/ruff format --check $(SOURCES)
	$(BIN)/ruff check $(SOURCES)
	$(BIN)/mypy
	$(BIN)/python -m pytest -n $(JOBS) -m "not slow"

test-slow: $(STAMP) ## the tests that take minutes
	$(BIN)/python -m pytest -n $(JOBS) -m slow

docs: $(STAMP) ## run every page of the documentation and build it in build/docs/html
	$(BIN)/python -m sphinx -W --keep-going -b html docs build/docs/html

format: $(STAMP) ## rewrite the sources in the common format and mend what lint can mend
	$(BIN)/ruff format $(SOURCES)
	$(BIN)/ruff check --fix $(SOURCES)

bench: $(STAMP) ## run the benchmarks, one after the other
	@set -e; for file in benchmarks/bench_*.py; do echo "== $$file"; PYTHONPATH=. $(BIN)/python "$$file"; done

clean: ## remove .venv and caches (results stay)
	rm -rf .venv build dist .pytest_cache .ruff_cache .mypy_cache .hypothesis
	find $(SOURCES) -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamp goes away before anything is touched and comes back only when all is done. Without it .venv is made anew, since an
# install that was cut off may leave half a package that pip takes for a whole one. With a stamp that is merely older than the
# two files below, .venv was whole, and pip changes what differs. The variables pin the build back end too, which pip installs
# in an environment of its own: old releases of pip read the first one, new ones the second. Of the modules only those that the
# program imports are compiled, here and also where the user's environment forbids it later: it would cost seconds each time.
$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit("shapespace needs Python 3.11 or newer: make PYTHON=<path of one> ..." if sys.version_info < (3, 11) else 0)'
	@if [ -f $@ ]; then rm $@; else $(PYTHON) -m venv --clear .venv; fi
	@echo "Installing the pinned dependencies into .venv (a few minutes the first time) ..."
	@PIP_CONSTRAINT=constraints.txt PIP_BUILD_CONSTRAINT=constraints.txt \
	  $(BIN)/python -m pip install --quiet --quiet --no-compile --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@PYTHONDONTWRITEBYTECODE= $(BIN)/python -c 'import shapespace.cli, shapespace.study.simulation, shapespace.study.dataset, shapespace.view.movie'
	@touch $@
