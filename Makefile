# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
#
# Everything runs in .venv, which scripts/venv.sh makes from requirements.txt. With ROS sourced
# (ROS_DISTRO set) it uses that ROS instead of rclpy's wheels.

BIN := .venv/bin
JOBS ?= 2
COUNT ?= 200
SEED ?= 1
# What computes: the same numbers have to come out without numba and with the oldest numpy. The
# control benchmark compares schemes, not numbers, and takes ten minutes without numba.
PLAIN ?= test/model test/plant test/control test/test_kernels.py
OLDEST ?= $(PLAIN) test/nodes
WITHOUT_NUMBA := --ignore test/control/test_benchmark.py
export PYTHON CHROMIUM
# Without compiled modules every start of a process takes a second or two longer.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help install demo test test-plain test-oldest browser-test mutants docs lint build clean

help:  ## show this list (default)
	@sed -n 's/^\([a-z-]*\):.*## /\1|/p' $(MAKEFILE_LIST) | \
		while IFS='|' read -r name text; do printf '  make %-12s %s\n' "$$name" "$$text"; done

install:  ## make .venv with pinned requirements and this package
	@sh scripts/venv.sh .venv

demo: install  ## run the whole story on simulated hardware and write report/
	@$(BIN)/fam_bundle demo

# A file goes to one worker, which makes its fixtures once: a browser, a cluster, a benchmark. In the
# order of test/conftest.py, which begins with the longest files. On two cores there is room for a
# third worker, while tests wait for a rig or a browser.
test: JOBS = 3
test: install  ## run all tests (JOBS=3 in parallel)
	@$(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder

test-plain: install  ## run the tests of model, plant and control without numba
	@FAM_BUNDLE_PLAIN=1 $(BIN)/python -m pytest -n $(JOBS) $(WITHOUT_NUMBA) $(PLAIN)

test-oldest:  ## run what the nodes import with Ubuntu 24.04's numpy, scipy, pint; no numba
	@sh scripts/venv.sh .venv-oldest ubuntu
	@.venv-oldest/bin/python -m pytest -n $(JOBS) $(WITHOUT_NUMBA) $(OLDEST)

browser-test: install  ## run the workbench's browser tests; pictures go to docs/images
	@sh scripts/chromium.sh
	@CI=true FAM_BUNDLE_SCREENSHOTS=docs/images $(BIN)/python -m pytest \
		test/workbench/test_browser_story.py test/workbench/test_browser_quality.py

mutants:  ## break COUNT=200 places one at a time and see which faults no test notices (1 to 2 h)
	@sh scripts/venv.sh .venv-mutants mutants
	@.venv-mutants/bin/python scripts/mutants.py .mutants $(COUNT) $(SEED) $(JOBS)

docs:  ## build the documentation into docs/_build/html; runs its notebooks
	@sh scripts/venv.sh .venv-docs docs
	@PATH="$$PWD/.venv-docs/bin:$$PATH" .venv-docs/bin/python -m sphinx -E -W --keep-going -q \
		docs docs/_build/html
	@echo docs/_build/html/index.html

lint: install  ## run ruff and mypy
	@$(BIN)/ruff check .
	@$(BIN)/mypy

build: install  ## build with colcon into install/ (ament_python)
	@$(if $(ROS_DISTRO),$(shell command -v colcon || echo $(BIN)/colcon),$(BIN)/colcon) build

clean:  ## remove .venv, build products and caches; keeps report/
	rm -rf .venv .venv-oldest .venv-docs .venv-mutants .mutants docs/_build build install log *.egg-info
	rm -rf .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find fam_bundle_ros test -name __pycache__ -type d -prune -exec rm -rf {} +
