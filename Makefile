# Two commands do it all:
#   make demo       install, refine the demo room, print the result table
#   make test       install what is missing and run every test
# And one by one:
#   make install    into .venv, with the command r2sego
#   make extension  the Blender add-on, dist/r2sego-*.zip
#   make window     the tab in a real Blender with its window: BLENDER=/path/to/blender make window
#   make measure    how quickly it draws with a large scene, and its memory: BLENDER=... make measure
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
DEMO_SCENE := build/demo_room.r2s

.PHONY: demo test window measure install extension lint clean
.DEFAULT_GOAL := help

help:
	@sed -n 's/^#   //p' Makefile

# torch comes first and by exact pin: a CPU build on disk is taken where there is one.
$(VENV)/.installed: pyproject.toml requirements.txt
	@command -v $(PYTHON) >/dev/null || { echo "make: $(PYTHON) is missing: install Python 3.11, or say make PYTHON=..."; exit 1; }
	$(PYTHON) batch/check_system.py
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check torch==2.13.0
	$(BIN)/pip install --quiet --disable-pip-version-check -r requirements.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

install: $(VENV)/.installed

demo: install
	$(BIN)/python demo/run_demo.py $(DEMO_SCENE)

test: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder

window: install
	$(BIN)/python -m pytest tests/window -v

measure: install
	$(BIN)/python tests/window/measure.py build/measured-$$(date +%Y%m%d-%H%M%S)

lint: install
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

extension: install
	$(BIN)/python batch/build_extension.py --out dist

clean:
	rm -rf build dist $(VENV)
