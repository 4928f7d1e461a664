# Every target sets up what it needs; only Python 3.11+ and make are expected.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PACKAGE := $(VENV)/.package
DEV := $(VENV)/.dev
DOCS := $(VENV)/.docs

.PHONY: demo test lint bench docs clean
.DEFAULT_GOAL := demo

# uv installs in seconds; where it cannot be had, pip does the same work.
define install
	@echo "installing swarmbid$(1) into $(VENV)"
	@if [ -x $(BIN)/uv ] && $(BIN)/uv pip install --quiet --python $(BIN)/python -e '.$(1)'; then :; \
	else $(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.$(1)'; fi
	@touch $@
endef

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	{ echo "swarmbid needs Python 3.11 or later; try: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check uv || echo "no uv; pip will do"

$(PACKAGE): pyproject.toml | $(BIN)/python
	$(call install,[search])

$(DEV): pyproject.toml | $(BIN)/python
	$(call install,[dev])

$(DOCS): pyproject.toml | $(BIN)/python
	$(call install,[docs])

demo: $(PACKAGE)
	@mkdir -p out
	@echo "planning; the first run on a machine also compiles, which takes up to a minute"
	$(BIN)/swarmbid plan examples/substations.yaml -o out/plan.json --report out/report.html
	@echo
	@echo "The report:    $(CURDIR)/out/report.html (open it in a browser)"
	@echo "Ask why:       $(BIN)/swarmbid why out/plan.trace.jsonl customer-098"

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

test: lint
	$(BIN)/pytest

bench: $(DEV)
	$(BIN)/python -m benchmarks

docs: $(DOCS)
	$(BIN)/python -m docs.generate
	$(BIN)/mkdocs build --strict

clean:
	rm -rf $(VENV) out site build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
