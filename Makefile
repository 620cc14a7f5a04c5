# Two commands for a newcomer: `make demo` and `make test`. Everything is installed into .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test deep bench lint clean

demo: $(VENV)/installed
	$(BIN)/strapdown demo --out report.html

test: $(VENV)/installed-test lint
	$(BIN)/python tests/compile_all.py
	$(BIN)/python -m pytest -n 2 -m "not deep"
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -n 2 -m "short and not deep"

# What is slow and rarely red. Writes its result to tests/deep.txt, which is committed.
deep: $(VENV)/installed-test
	$(BIN)/python tests/deep.py

lint: $(VENV)/installed-test
	$(BIN)/ruff format --check --quiet
	$(BIN)/ruff check --quiet
	$(BIN)/lint-imports --no-cache
	$(BIN)/mypy

bench: $(VENV)/installed-bench
	$(BIN)/python benchmarks/bench.py

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/installed: pyproject.toml reproductions/pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e . -e reproductions
	touch $@

$(VENV)/installed-test: pyproject.toml reproductions/pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[test]" -e reproductions
	touch $@ $(VENV)/installed

$(VENV)/installed-bench: pyproject.toml reproductions/pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[test,bench]" -e reproductions
	touch $@ $(VENV)/installed

clean:
	rm -rf $(VENV) build dist report.html
