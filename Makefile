# SPDX-License-Identifier: Apache-2.0
# make demo: set everything up and run the paper's experiment; make test: set up and test.

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt
SOURCES := setup.py setup.cfg pyproject.toml constraints.txt tools/install_ros.sh

.PHONY: help setup demo test test-all test-oldest lint docs bench soak clean

help:
	@echo 'make demo   set up and run the experiment of the paper on real ROS 2 nodes'
	@echo 'make setup  set up, and compile the laws of the paper'
	@echo 'make test   set up and run the tests, without those that take long by their nature'
	@echo 'make test-all   all of them'
	@echo 'make test-oldest   the numerical tests and a live node with the oldest Numba and NumPy'
	@echo 'make lint   style and types'
	@echo 'make docs   the documentation as a site, build/docs/index.html; needs Node.js with npm'
	@echo 'make bench  speeds, as ratios within one run'
	@echo 'make soak   ten minutes in real time at 1 kHz; SECONDS=60 for a shorter try, HOSTILE=SEED with random input,'
	@echo '            FIGHT=SEED with clients that compete for the reference'
	@echo 'make clean  remove what make and the demo made'

# With PYTHON=..., also if the environment exists already.
.PHONY: check-python
check-python:
	@[ -z "$(PYTHON)" ] || tools/choose_python.sh "$(PYTHON)" $(BIN)/python >/dev/null

$(VENV)/.installed: $(SOURCES) | check-python
	@python=$$(tools/choose_python.sh "$(PYTHON)") && \
	echo "Setting up $(VENV) with $$python (once, about 700 MB) ..." && \
	if [ -n "$$AMENT_PREFIX_PATH" ]; then site=--system-site-packages; fi && \
	$$python -m venv $$site $(VENV)
	@$(PIP) --upgrade pip setuptools wheel
	@tools/install_ros.sh $(BIN)/python
	@PYTHONWARNINGS=ignore $(PIP) --no-build-isolation -e .
	@touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	@PYTHONWARNINGS=ignore $(PIP) --no-build-isolation -e .[test,lint]
	@touch $@

# The build of PyTorch without CUDA: 0.8 GB installed instead of several GB. Not all indices have it.
TORCH = torch==$$(sed -n 's/^torch==//p' constraints.txt)+cpu
$(VENV)/.installed-all: $(VENV)/.installed-dev
	@PYTHONWARNINGS=ignore $(PIP) --no-build-isolation -e .[robots]
	@PYTHONWARNINGS=ignore $(PIP) --no-build-isolation $(TORCH) -e .[baselines] 2>/dev/null || \
		echo "pip has no $(TORCH); the tests of Stable-Baselines3 are skipped" >&2
	@touch $@

setup: $(VENV)/.installed
	@$(BIN)/masmc warm

demo: $(VENV)/.installed
	@$(BIN)/masmc demo

# The files of tests are shared out to processes, each file whole but the pages of the documentation:
# its fixtures are made once, and those that take minutes first (test/conftest.py). Tests of nodes
# wait more than they compute: four processes keep two cores busy; among slow tests, which compile
# for longer, three.
PYTEST = $(BIN)/python -m pytest --dist loadfile --no-loadscope-reorder $(PYTEST_OPTIONS)

test: $(VENV)/.installed-dev
	@$(PYTEST) -n 4 -m 'not slow'

test-all: $(VENV)/.installed-all
	@$(PYTEST) -n 3

# An environment of its own, of Python 3.11: pip has no Numba 0.58 for Python 3.12, Ubuntu 24.04 has.
OLDEST := .venv-oldest
OLDEST_TESTS := $(addprefix test/,numerics/test_portable_math.py robot/test_kinematics.py \
	robot/test_dynamics.py robot/test_tree_dynamics.py law/test_implicit.py jit/test_scratch.py \
	jit/test_code_files.py jit/test_sources.py params/test_params_declaration.py loop/test_same_bits.py \
	messages/test_compiled_messages.py)
test-oldest:
	@$${PYTHON:-python3.11} -m venv $(OLDEST)
	@$(OLDEST)/bin/python -m pip install --quiet --disable-pip-version-check setuptools wheel
	@tools/install_ros.sh $(OLDEST)/bin/python constraints-oldest.txt
	@$(OLDEST)/bin/python -m pip install --quiet --disable-pip-version-check \
		-c constraints-oldest.txt --no-build-isolation -e . hypothesis mpmath pytest sympy
	@$(OLDEST)/bin/python -m pytest -m 'not slow' $(OLDEST_TESTS) \
		test/nodes/test_lockstep.py::test_lockstep_separate_processes_equal_simulation

lint: $(VENV)/.installed-dev
	@$(BIN)/ruff check .
	@$(BIN)/mypy
	@$(BIN)/mypy tools/*.py examples/*.py

# A small environment with the extra `docs` alone: the Python API is read from the sources. Warnings
# are errors. The site needs no network; building it needs one the first time.
DOCS := .venv-docs
$(DOCS)/.installed: setup.py constraints.txt
	@python=$$(tools/choose_python.sh "$(PYTHON)") && $$python -m venv $(DOCS)
	@$(DOCS)/bin/python -m pip install --quiet --disable-pip-version-check setuptools
	@packages=$$($(DOCS)/bin/python -c "import setuptools; from distutils.core import run_setup; \
		print(*run_setup('setup.py', stop_after='init').extras_require['docs'])") && \
	$(DOCS)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt $$packages
	@touch $@

build/docs_assets: tools/docs_assets.sh
	@tools/docs_assets.sh

# A page that computes the paper's runs; the environment of the package compiles it.
build/docs_assets/paper.html: $(VENV)/.installed $(wildcard masmc_ros/native/templates/*) | build/docs_assets
	@$(BIN)/masmc page paper --laws all --overwrite --output $@

# Runs of all laws for the figures of their pages, and of the animation of the first page.
build/docs_figures: $(VENV)/.installed tools/docs_figures.py tools/docs_animation.html
	@$(BIN)/python tools/docs_figures.py $@
	@touch $@

docs: $(DOCS)/.installed build/docs_assets build/docs_assets/paper.html build/docs_figures
	@rm -rf docs/api  # of an interrupted build
	@$(DOCS)/bin/python -m sphinx --builder html --quiet --fail-on-warning --keep-going \
		--doctree-dir build/doctrees docs build/docs
	@echo 'build/docs/index.html'

bench: $(VENV)/.installed-dev
	@$(BIN)/python -m benchmarks

SECONDS := 600
soak: $(VENV)/.installed-dev
	@$(BIN)/python -m benchmarks.soak $(SECONDS) $(if $(HOSTILE),--hostile --seed $(HOSTILE)) \
		$(if $(FIGHT),--fight --seed $(FIGHT))

clean:
	rm -rf $(VENV) $(OLDEST) $(DOCS) docs/api build install demo report *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
