# Two commands do it all:
#   make demo       install, refine the demo room, print the result table
#   make test       install what is missing and run every test; YES=1 installs system libraries too
# And one by one:
#   make install    into .venv, with the command r2sego
#   make extension  the Blender add-on, dist/r2sego-*.zip
#   make window     the tab in a real Blender with its window: BLENDER=/path/to/blender make window
#   make measure    how quickly it draws with a large scene, and its memory: BLENDER=... make measure
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/pip install --quiet --disable-pip-version-check
DEMO_SCENE := build/demo_room.r2s
TORCH := $(shell sed -n 's/^ *"\(torch==[^"]*\)",$$/\1/p' pyproject.toml)

.PHONY: demo test window measure install install-tests python system extension lint clean help
.DEFAULT_GOAL := help

help:
	@sed -n 's/^#   //p' Makefile

# torch comes first and by exact pin: a CPU build on disk is taken where there is one.
$(VENV)/.installed: pyproject.toml | python
	$(PYTHON) -m venv $(VENV)
	$(PIP) $(TORCH)
	$(PIP) --editable .
	@touch $@

# On top, for tests alone: bpy is 350 MB, and needs libraries of X11 and GL that the demo does not.
$(VENV)/.tests-installed: $(VENV)/.installed
	$(PIP) --editable '.[blender,test]'
	@touch $@

install: $(VENV)/.installed

install-tests: $(VENV)/.tests-installed

python:
	@command -v $(PYTHON) >/dev/null || { echo "make: $(PYTHON) is missing: install Python 3.11, or say make PYTHON=..."; exit 1; }

# Asked on every run, as a library can go; and before anything is downloaded.
system: python
	@$(PYTHON) batch/check_system.py $(if $(filter-out 0 no,$(YES)),--yes)

demo: install
	$(BIN)/python demo/run_demo.py $(DEMO_SCENE)

test: system install-tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder

window: install-tests
	$(BIN)/python -m pytest tests/window -v

measure: install-tests
	$(BIN)/python tests/window/measure.py build/measured-$$(date +%Y%m%d-%H%M%S)

# What ruff can put right it does; what mypy finds is told, by the rules of pyproject.toml.
lint: install-tests
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/mypy

extension: system install-tests
	$(BIN)/python batch/build_extension.py --out dist

clean:
	rm -rf build dist $(VENV)
