# Two commands do everything on a fresh machine: `make demo` and `make test`.
# Each sets up what it needs: a virtual environment with pinned versions, and system packages where it may.

PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet --constraint constraints.txt
SOURCES := pyproject.toml constraints.txt

# Numerical libraries keep to one thread each: the robot has few cores and a map must not depend on how many.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

BROWSER_PACKAGES := chromium
WINDOW_PACKAGES := xvfb libusb-1.0-0 libegl1 libgl1 libx11-6 libudev1 libidn2-0

.PHONY: install demo test test-slow check bench clean

install: .venv/.run                 ## what the robot and the laptop need to run, without the 3D window

demo: .venv/.run                    ## an emulated dive with its live page; Ctrl-C ends it
	@exec $(BIN)/lacuna demo $(ARGS)

test: .venv/.test                   ## every test but the slow ones
	@sh .ci/packages $(BROWSER_PACKAGES) $(WINDOW_PACKAGES)
	$(BIN)/python -m pytest -n 2 -m "not slow" $(ARGS)

test-slow: .venv/.test              ## the slow tests
	@sh .ci/packages $(BROWSER_PACKAGES) $(WINDOW_PACKAGES)
	$(BIN)/python -m pytest -n 2 -m slow $(ARGS)

check: .venv/.check                 ## style, types, import rules
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: .venv/.run                   ## the figures of the README
	@exec $(BIN)/lacuna bench $(ARGS)

clean:
	rm -rf .venv build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache

.venv/.made:
	@sh .ci/venv $(PYTHON)
	@touch $@

.venv/.run: .venv/.made $(SOURCES)
	$(PIP) --editable '.[laptop]'
	@touch $@

.venv/.check: .venv/.made $(SOURCES)
	$(PIP) --editable '.[laptop,dev]'
	@touch $@ .venv/.run

.venv/.test: .venv/.made $(SOURCES)
	$(PIP) --editable '.[laptop,dev,view]'
	@touch $@ .venv/.run .venv/.check
