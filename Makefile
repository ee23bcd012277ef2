# Everything runs in a virtual environment of its own, .venv; `make demo` is the place to start.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# setuptools warns of the folders beside setup.py in every editable installation.
INSTALL := PYTHONWARNINGS=ignore $(BIN)/python -m pip install --quiet --editable

# Compiled modules and rewritten assertions are kept, whatever the environment says: every process of
# the tests would make them again.
export PYTHONDONTWRITEBYTECODE :=
# SymPy remembers a thousand results of each of its functions; tests derive more than that.
export SYMPY_CACHE_SIZE ?= 20000

.PHONY: demo test test-fast test-browser test-processors test-wheels test-kernels test-kernels-examples mutations night check docs docs-check pictures linkcheck bench ladder twenty words release clean

demo: $(VENV)/.installed-plot
	@$(BIN)/python examples/seed.py demo
	@$(BIN)/python examples/hanging.py demo

test: $(VENV)/.installed-test
	$(BIN)/python -m pytest -n auto --dist worksteal

# Less than a minute; the rest goes through whole solves, searches, examples and refinements.
test-fast: $(VENV)/.installed-test
	$(BIN)/python -m pytest -n auto --dist worksteal -m "not slow"

# The page that plays motions, in a real browser: chromium and chromedriver have to be there.
test-browser: $(VENV)/.installed-browser
	$(BIN)/python -m pytest tests/browser/*.py

# Solvers in C on 32-bit ARM and on aarch64, which qemu emulates: qemu-user-static has to be there.
test-processors: $(VENV)/.installed-test
	$(BIN)/python -m pytest tests/processors/*.py

# Examples, known answers, the twenty, the ladder and the words under five kernels of BLAS and with
# parameters changed by a part in 1e12: some hours.
test-kernels: $(VENV)/.installed-test
	$(BIN)/python tools/kernels.py

# The part of it that continuous integration has time for: the examples under the narrowest kernel
# beside that of this processor.
test-kernels-examples: $(VENV)/.installed-test
	$(BIN)/python tools/kernels.py examples --runs Prescott

# Lines of the sources changed one at a time, each under the tests that ought to notice it; changed C
# is compiled in place, for which pip installs setuptools and Cython in environments of its own alone.
mutations: $(VENV)/.installed-test
	$(BIN)/python -m pip install --quiet 'setuptools>=77' 'Cython>=3.2.1'
	$(BIN)/python tools/mutations.py

# Once a night: examples as users run them, the list of changes, the ladder and the campaigns; what
# they said last is committed, benchmarks/results/night.
night: $(VENV)/.installed-test $(VENV)/.installed-bench
	$(BIN)/python -m pip install --quiet 'setuptools>=77' 'Cython>=3.2.1'
	$(BIN)/python tools/night.py

check: $(VENV)/.installed-test $(VENV)/.installed-check
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy tests/whole/typed_script.py
	$(BIN)/lint-imports
	$(BIN)/python -m pytest tests/codegen/test_generated.py tests/whole/test_text.py -k "committed or test_text"

# Examples that have not changed are not run again; those that have take some minutes in all.
docs: $(VENV)/.installed-docs
	@rm -rf docs/reference/names  # pages of names that are gone
	$(BIN)/sphinx-build -W --keep-going -n -q -b html docs docs/_build/html

# The same without running the examples, which the tests do, and away from what `make docs` has built.
MANUAL := build/manual
docs-check: $(VENV)/.installed-docs
	@rm -rf $(MANUAL) && mkdir -p $(MANUAL)/docs && cp -r examples CHANGELOG.md CONTRIBUTING.md $(MANUAL)
	@cp --parents cli/troubleshooting.md $(MANUAL)
	@cp -r $(filter-out docs/_build docs/examples,$(wildcard docs/*)) $(MANUAL)/docs && rm -rf $(MANUAL)/docs/reference/names
	$(BIN)/sphinx-build -W --keep-going -n -q -D plot_gallery=0 -b html $(MANUAL)/docs $(MANUAL)/html

# The pictures of the first pages, which are committed: docs/pictures.
pictures: $(VENV)/.installed-docs
	$(BIN)/python docs/_ext/pictures.py

# Links to other sites, which needs the network.
linkcheck: $(VENV)/.installed-docs
	$(BIN)/sphinx-build -W --keep-going -q -b linkcheck docs docs/_build/links

# opty is installed without cyipopt, which it needs for solving alone and which cannot be installed without Ipopt's headers;
# nosnoc needs nothing beside what is there.
bench: $(VENV)/.installed-bench
	cd benchmarks && ../$(BIN)/python run.py && ../$(BIN)/python accuracy.py

ladder: $(VENV)/.installed-bench
	cd benchmarks && ../$(BIN)/python run.py --only ladder

twenty: $(VENV)/.installed-bench
	cd benchmarks && ../$(BIN)/python twenty.py

words: $(VENV)/.installed-bench
	cd benchmarks && ../$(BIN)/python best_of_word.py

# A source distribution and a manylinux wheel for every interpreter here, each tried, ready to be uploaded.
release: $(VENV)/.installed-release
	$(BIN)/python tools/release.py

# The tests that are not slow against each of these wheels, under its own interpreter.
test-wheels: $(VENV)/.installed-release
	$(BIN)/python tools/wheels.py

# The folders of sources are part of what is installed: a changed extension is compiled again.
SOURCES := setup.py pyproject.toml $(wildcard codegen/*.pyx codegen/*.pxd codegen/*.pxi codegen/*.h simulation/*.pyx simulation/*.px[di] simulation/*.h program/*.pyx program/*.pxd program/*.[ch] guess/*.pyx guess/*.px[di] guess/*.[ch] mechanics/*.pyx mechanics/*.px[di] solvers/*.pyx solvers/*.pxi solvers/*.[ch] proving/*.pyx proving/*.[ch] check/*.pyx check/*.pxi) $(wildcard generated/*/kernels.c)

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip

# dmoc is built once; what its extras name comes beside it.
$(VENV)/.installed: $(SOURCES) | $(VENV)/bin/python
	@echo "Installing dmoc and compiling its kernels (about a minute) ..."
	@$(INSTALL) .
	@touch $@

$(VENV)/.installed-%: $(VENV)/.installed
	@$(BIN)/python -m pip install --quiet 'dmoc[$*]'
	@touch $@

$(VENV)/.installed-bench: $(VENV)/.installed
	@$(BIN)/python -m pip install --quiet 'dmoc[bench]'
	@$(BIN)/python -m pip install --quiet --no-deps 'opty>=1.5' 'nosnoc>=0.2'
	@touch $@

$(VENV)/.installed-release: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet 'pip>=25.1'  # an older one, of an environment that was there, knows no --group
	$(BIN)/python -m pip install --quiet --group release
	@touch $@

clean:
	rm -rf $(VENV) build dist demo *.egg-info docs/_build docs/examples docs/reference/names examples/figures
	find . -name '*.so' -not -path './$(VENV)/*' -delete
