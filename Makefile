# Two commands for a newcomer: `make demo` and `make test`. Everything is installed into .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := --quiet --disable-pip-version-check

.PHONY: demo test docs compile library wheel dist deep changed versions branches mutants bench lint clean

demo: $(VENV)/installed
	$(BIN)/strapdown demo --out report.html

test: $(VENV)/installed-test
	$(MAKE) --no-print-directory -j2 lint compile
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not deep"
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -n 2 --dist worksteal -m "short and not deep" $(KERNEL_TESTS)
	$(BIN)/python tests/deep.py --fitting

# Where code differs without the compiler; `make deep` runs all short tests without it.
KERNEL_TESTS := tests/core tests/aiding tests/filters tests/evaluation tests/test_golden.py

compile: $(VENV)/installed-test
	$(BIN)/python tests/compile_all.py

# Kernels as machine code, for the processor of this machine, into the checkout: docs/how-to/library.md.
library: $(VENV)/installed
	$(BIN)/python -m strapdown.native.build src/strapdown/lib

# A wheel with them, for all processors of this architecture, into dist.
wheel: $(VENV)/installed
	$(BIN)/python -m strapdown.native.wheel dist

# Sdist and wheel of both packages in dist, checked, each installed into a new environment and run there.
dist: $(VENV)/installed-dist
	$(BIN)/python tests/distribution.py

# What is slow and rarely red. Writes its result to tests/deep.txt, which is committed.
deep: $(VENV)/installed-test
	$(BIN)/python tests/compile_all.py --deep
	$(BIN)/python tests/deep.py

# The deep tests that changes since the commit of tests/deep.txt can reach.
changed: $(VENV)/installed-test
	$(BIN)/python tests/compile_all.py --deep
	$(BIN)/python tests/deep.py --changed

# The suite on each Python and numba that is there; lists what is not. NOX="-s bounds" runs a part.
versions: $(VENV)/installed-versions
	$(BIN)/nox $(NOX)

# Branches that the short tests take, and mutants that they see. Written to tests/branches.txt and mutants.txt.
branches: $(VENV)/installed-test
	$(BIN)/python tests/branches.py

mutants: branches
	$(BIN)/python tests/mutants.py --count 300 --seed 2 --out tests/mutants.txt

lint: $(VENV)/installed-test
	$(BIN)/ruff format --check --quiet
	$(BIN)/ruff check --quiet
	$(BIN)/lint-imports --no-cache
	$(BIN)/mypy
	$(BIN)/python docs/_site/typed_blocks.py build/shown
	$(BIN)/mypy build/shown
	$(BIN)/basedpyright --pythonpath $(BIN)/python

# Speed and accuracy against their targets: benchmarks/result.json and docs/reference/figures.md, which are committed.
bench: $(VENV)/installed-bench
	$(BIN)/python benchmarks/bench.py
	$(BIN)/python docs/_site/figure_pages.py

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

# Bytecode comes when a module is imported: a quarter of a minute less than that of all that is installed. The
# tests need it whole: they take a warning of the compiler for an error.
$(VENV)/installed: pyproject.toml reproductions/pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install $(PIP) --no-compile -e . -e reproductions
	touch $@

$(VENV)/installed-test: pyproject.toml reproductions/pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install $(PIP) -e ".[test]" -e reproductions
	touch $@ $(VENV)/installed

$(VENV)/installed-docs: pyproject.toml reproductions/pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install $(PIP) -e ".[docs]" -e reproductions
	touch $@ $(VENV)/installed

$(VENV)/installed-versions: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install $(PIP) -e ".[versions]" -e reproductions
	touch $@ $(VENV)/installed

$(VENV)/installed-dist: pyproject.toml reproductions/pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install $(PIP) -e ".[dist]" -e reproductions
	touch $@ $(VENV)/installed

$(VENV)/installed-bench: pyproject.toml reproductions/pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install $(PIP) -e ".[test,bench]" -e reproductions
	touch $@ $(VENV)/installed

# The documentation as a site, into site/: docs/_site/make_site.py. What is stale or leads nowhere fails.
docs: $(VENV)/installed-docs
	$(BIN)/python docs/_site/make_site.py site

clean:
	rm -rf $(VENV) build dist site report.html
