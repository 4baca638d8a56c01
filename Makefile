# SPDX-License-Identifier: Apache-2.0
# Everything a fresh machine needs: `make demo`, `make test`.

VENV ?= .venv
OUT ?= out
BIN := $(VENV)/bin
STAMP := $(VENV)/.robot_vision
CANDIDATES := $(or $(PYTHON),python3 python3.13 python3.12 python3.11 python3.10)
FITS := import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))

# A sourced ROS 2 would mix its own packages with those of the environment made here.
unexport PYTHONPATH
unexport PYTHONHOME
unexport RMW_IMPLEMENTATION
ifdef AMENT_PREFIX_PATH
unexport AMENT_PREFIX_PATH
unexport LD_LIBRARY_PATH
endif
# rclpy's wheels set this once their library path is in place; inherited, it would keep them from doing so.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE

.DEFAULT_GOAL := help
.PHONY: help venv demo test lint bench bags clean

help:
	@echo "make demo    replay bags/corridor.mcap through the real nodes; results under $(OUT)/"
	@echo "make test    all tests, replays over real DDS included"
	@echo "make lint    ruff and mypy"
	@echo "make bench   accuracy and latency, beside the marks to reach"
	@echo "make bags    record the simulated bags anew"
	@echo "make venv    only make $(VENV)/; PYTHON=python3.12 chooses the interpreter"
	@echo "make clean   remove $(VENV)/, $(OUT)/ and every cache"

venv: $(STAMP)

$(STAMP): setup.py setup.cfg
	@python=; for candidate in $(CANDIDATES); do \
	    if "$$candidate" -c '$(FITS)' >/dev/null 2>&1; then python=$$candidate; break; fi; \
	done; \
	if [ -z "$$python" ]; then \
	    echo "robot_vision needs Python 3.10 to 3.13, and none of these is: $(CANDIDATES)."; \
	    echo "python3 says: $$(python3 --version 2>&1). Another one can be named: make venv PYTHON=/path/to/python3.12"; \
	    exit 1; \
	fi; \
	version=$$("$$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])'); \
	if ! "$$python" -c 'import ensurepip, venv' >/dev/null 2>&1; then \
	    echo "Python $$version is here without its module venv. On Debian and Ubuntu: sudo apt install python$$version-venv"; \
	    exit 1; \
	fi; \
	echo "Making $(VENV)/ with Python $$version; the first time this downloads some 300 MB."; \
	"$$python" -m venv --clear "$(VENV)"
	@$(BIN)/python -m pip install --disable-pip-version-check --editable '.[ros,dev]'
	@$(BIN)/robot-vision doctor --warm
	@touch $@

demo: $(STAMP)
	@$(BIN)/robot-vision demo --out $(OUT)

# The viewer is large; only its tests and whoever looks at bags need it.
$(VENV)/.viewer: $(STAMP)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[viewer]'
	@touch $@

# Whole files go to the processes: what a module's tests share is made once, and graphs have domains of their own.
test: $(STAMP) $(VENV)/.viewer
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile $(PYTEST_ARGS)

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy robot_vision bench

bench: $(STAMP)
	$(BIN)/python -m bench $(BENCH_ARGS)

bags: $(STAMP)
	@sed -n 's/^    robot-vision simulate/simulate/p' bags/README.md | while read -r command; do \
	    $(BIN)/robot-vision $$command || exit 1; \
	done

clean:
	rm -rf $(VENV) $(OUT) build install log dist robot_vision.egg-info
	rm -rf .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find robot_vision test bench launch -name __pycache__ -type d -prune -exec rm -rf {} +
