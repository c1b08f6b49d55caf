# Every target except help uses the virtual environment in .venv. It is made on first use, and again
# after a change of environment.txt or pyproject.toml.

SHELL := /bin/sh
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help book pdf lab test coverage check browser-test bench same nightly release lock checksums clean

export PYTHON
# Packages, settings and kernels of the user have no effect on the results. The home folder may be
# read-only.
unexport PYTHONPATH PYTHONHOME
export MPLCONFIGDIR := $(CURDIR)/.venv/matplotlib
export IPYTHONDIR := $(CURDIR)/.venv/ipython
export JUPYTER_CONFIG_DIR := $(CURDIR)/.venv/jupyter
export JUPYTER_DATA_DIR := $(CURDIR)/.venv/jupyter
export JUPYTER_RUNTIME_DIR := $(CURDIR)/.venv/jupyter
PY := .venv/bin/python
STAMP := .venv/.installed
TESTS := .venv/.installed-tests

help:  ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 22

book: $(STAMP)  ## build the book and print its address
	@$(PY) tools/build_book.py

pdf: $(TESTS) book  ## print the book as one PDF; needs Chromium
	@$(PY) tools/make_pdf.py

lab: book  ## open JupyterLab on a copy of the notebooks, in lab/, which no build overwrites
	@mkdir -p lab && cp -Rn book/_build/notebooks/. lab
	@$(PY) -m jupyter lab lab

PARALLEL = --numprocesses auto --maxprocesses 4
FAST = -m "not browser and not nightly" $(PARALLEL) --dist worksteal

test: $(TESTS)  ## run the tests
	@$(PY) -m pytest $(FAST)

coverage: $(TESTS)  ## run the tests and report the lines that they reach; takes twice as long
	@$(PY) -m pytest $(FAST) --cov --cov-report=term

check: $(TESTS)  ## check style, format, types and words
	@$(PY) -m ruff check .
	@$(PY) -m ruff format --check .
	@$(PY) -m mypy
	@$(PY) tools/check_language.py

browser-test: $(TESTS)  ## test the built pages in a headless Chromium
	@$(PY) -m pytest -m browser tests/book $(PARALLEL) --dist worksteal

bench: $(TESTS)  ## measure times as ratios to a reference in the same process
	@$(PY) -m pytest benchmarks --quiet -p no:cacheprovider

same: $(TESTS) book  ## compute all numbers and pages again with other arithmetic, and compare
	@$(PY) tools/same_numbers.py

nightly: $(TESTS)  ## run the checks that do not depend on a single change; takes long
	@.ci/nightly

release: pdf  ## write the files of a release to dist/release
	@$(PY) tools/release.py

COMPILE = $(PY) -m uv pip compile --universal --python-version 3.11 --fork-strategy fewest \
	--generate-hashes --no-emit-index-url --quiet

lock: $(STAMP)  ## resolve the locks of the book, the tests and the notebooks
	@$(COMPILE) --extra book --extra notebooks --group lock --upgrade --output-file environment.txt pyproject.toml
	@$(COMPILE) --all-extras --group lock --constraint environment.txt --upgrade \
		--output-file tools/environment-test.txt pyproject.toml
	@$(COMPILE) --extra notebooks --extra images --constraint environment.txt --upgrade \
		--output-file tools/environment-notebooks.txt pyproject.toml
	@for platform in x86_64-unknown-linux-gnu aarch64-apple-darwin x86_64-pc-windows-msvc; do \
		for version in 3.11 3.14; do \
			$(PY) -m uv pip install --quiet --dry-run --only-binary :all: --require-hashes \
				--python-platform $$platform --python-version $$version \
				--target dist/nowhere --requirement environment.txt || exit 1; \
		done; \
	done

checksums:  ## record the checksums of the printed numbers, after both entries agree
	@cd data/printed && find . -name '*.toml' -o -name '*.csv' | sed 's|^\./||' | LC_ALL=C sort \
		| xargs sha256sum > SHA256SUMS

clean:  ## remove built pages and caches (not .venv)
	@rm -rf book/_build book/_extra/* .coverage .pytest_cache .mypy_cache .ruff_cache .hypothesis dist
	@find src tests tools benchmarks book -name __pycache__ -prune -exec rm -rf {} +

$(STAMP): environment.txt pyproject.toml
	@if ! $(PY) -m pip --version >/dev/null 2>&1; then \
		found=$$(sh tools/find-python) && "$$found" -m venv --clear .venv; \
	fi
	@echo "Installing the $$(grep -c '^[a-z].*==' environment.txt) locked packages into .venv, once"
	@sed -n '/^uv==/,/^[a-z]/{/^uv==/p;/^ .*--hash/p;}' environment.txt > .venv/uv.txt
	@$(PY) -m pip install --quiet --disable-pip-version-check --require-hashes -r .venv/uv.txt || { \
		echo "No package index can be reached. The first run needs one; later runs do not." >&2; \
		exit 1; }
	@$(PY) -m uv pip sync --quiet --compile-bytecode --require-hashes --python $(PY) environment.txt
	@$(PY) -m pip install --quiet --no-deps --no-build-isolation --editable .
	@$(PY) -c "import matplotlib.font_manager"  # prints a message if it takes long
	@rm -f $(TESTS)
	@touch $@

# The packages of environment.txt, in the same versions, and those of tests and tools.
$(TESTS): $(STAMP) tools/environment-test.txt
	@echo "Installing the packages of the tests into .venv, once"
	@rm -f $(STAMP)  # an interrupted installation starts again
	@$(PY) -m uv pip sync --quiet --compile-bytecode --require-hashes --python $(PY) \
		tools/environment-test.txt
	@$(PY) -m pip install --quiet --no-deps --no-build-isolation --editable .
	@touch $(STAMP) $@
