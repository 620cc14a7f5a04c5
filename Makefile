# Two commands for a newcomer: `make demo` and `make test`. Everything is installed into .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test bench lint clean

demo: $(VENV)/installed
	$(BIN)/strapdown demo --out report.html

test: $(VENV)/installed-test lint
	$(BIN)/python tests/compile_all.py
	$(BIN)/python -m pytest -n 2
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -n 2 -m short

lint: $(VENV)/installed-test
	$(BIN)/lint-imports

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
