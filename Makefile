# Everything runs from a clone: Python 3.11+ with venv, and make, are all that is needed.
PYTHON ?= python3
WORKERS ?= 2
BUILD := build

VENV := .venv
VENV8 := .venv-occt8
BIN := $(VENV)/bin
BIN8 := $(VENV8)/bin
# one thread of linear algebra for each test process: two pools on two cores only get in each other's way
export OPENBLAS_NUM_THREADS := 1
# pip asks for its own newest version at each call and would rather cache than not: keep both quiet
PIP_FLAGS := --disable-pip-version-check --quiet

.DEFAULT_GOAL := help
.PHONY: help setup setup-occt8 demo test test-occt8 stress lint types bench docs clean

help:  ## list the targets
	@grep -hE '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

setup: $(VENV)/.stamp  ## make .venv: CadQuery 2.8 and build123d 0.12 on OCCT 7.9.3
setup-occt8: $(VENV8)/.stamp  ## make .venv-occt8: build123d 0.13 on OCCT 8.0

# A stamp is written last, so an interrupted set-up is taken up again, and one older than pyproject.toml renewed.
define make_venv
	@$(PYTHON) -c 'import sys; sys.exit("gtcad needs Python 3.11 or newer, $(PYTHON) is " + sys.version.split()[0] if sys.version_info < (3, 11) else 0)'
	@echo "setting up $(1) (gtcad[$(2),dev]: downloads about 1 GB the first time)"
	@$(PYTHON) -m venv $(1)
	@$(1)/bin/python -m pip install $(PIP_FLAGS) -e '.[$(2),dev]'
	@touch $(1)/.stamp
endef

$(VENV)/.stamp: pyproject.toml
	$(call make_venv,$(VENV),cadquery)

$(VENV8)/.stamp: pyproject.toml
	$(call make_venv,$(VENV8),build123d)

demo: $(VENV)/.stamp  ## export the samples to STEP within 1e-4 mm and prove what the files hold
	@$(BIN)/python samples/demo.py --output $(BUILD)/demo

test: $(VENV)/.stamp  ## run the tests on OCCT 7.9.3
	$(BIN)/python -m pytest -n $(WORKERS)

test-occt8: $(VENV8)/.stamp  ## run the same tests on OCCT 8.0
	$(BIN8)/python -m pytest -n $(WORKERS)

stress: $(VENV)/.stamp  ## run the long randomised tests
	$(BIN)/python -m pytest -n $(WORKERS) -m stress

lint: $(VENV)/.stamp  ## ruff: lint and format
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.stamp  ## mypy --strict
	$(BIN)/mypy

bench: $(VENV)/.stamp  ## measure against what runs beside it; writes build/benchmarks.md
	$(BIN)/python -m tests.benchmarks --output $(BUILD)/benchmarks.md

docs: $(VENV)/.stamp  ## render the pictures of the README and the samples into build/
	$(BIN)/python samples/render.py --output $(BUILD)/pictures
	$(BIN)/python samples/combs.py --output $(BUILD)/pictures
	$(BIN)/python samples/minimal.py --output $(BUILD)/pictures
	$(BIN)/python samples/unroll.py --output $(BUILD)/pictures
	$(BIN)/python samples/optimize.py --output $(BUILD)/pictures

clean:  ## remove what was made, the environments included
	rm -rf $(BUILD) $(VENV) $(VENV8) dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
