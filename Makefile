# What continuous integration runs, by parts. `make setup` once, then `make check` before a pull request, or one part.
# Without make (on Windows): the same lines, with .venv\Scripts in place of .venv/bin.

PYTHON ?= python3
BIN ?= .venv/bin
TESTS ?=
PROCESSES ?= 2
PARALLEL = -n $(PROCESSES) --dist loadfile

.PHONY: help setup check style format test slow faults browser gate docs serve oldest clean

help:  ## show this
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 12

setup:  ## make .venv with all tools, and let git check what is committed
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet -e '.[dev,docs,browser]' pre-commit
	if test -d .git; then $(BIN)/pre-commit install; fi

check: style test gate slow faults docs browser  ## everything below but oldest: about as long as continuous integration

style:  ## lint, format, types, import rules: a minute
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format:  ## mend what ruff can mend
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

test:  ## the quick tests; of one folder: make test TESTS=tests/metrics
	$(BIN)/pytest -q $(PARALLEL) $(TESTS)

slow:  ## tests that take seconds, every command and program of the pages among them
	$(BIN)/pytest -q $(PARALLEL) -m slow $(TESTS)

faults:  ## kills, full disks and other accidents, and determinism
	$(BIN)/pytest -q $(PARALLEL) -m faults $(TESTS)

browser:  ## reports in a headless browser, which has to be installed (Chromium or Chrome)
	$(BIN)/pytest -q -m browser $(TESTS)

gate:  ## the synthetic building is mapped as well as the reference says
	$(BIN)/omnieval check --reference runs/reference/synthetic.toml

docs:  ## the documentation site, into site/; a warning is an error
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet

serve:  ## the site at http://127.0.0.1:8000, made again when a page changes
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs serve

oldest:  ## the quick tests with the oldest versions of all dependencies, in .venv-oldest (Python 3.11)
	$(PYTHON) -m venv .venv-oldest
	.venv-oldest/bin/pip install --quiet -c .ci/lowest.txt -e '.[test]'
	.venv-oldest/bin/python -m pytest -q $(PARALLEL) tests/imaging tests/descriptors tests/results tests/test_loop.py

clean:  ## remove what was built, not .venv
	rm -rf build dist site .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
