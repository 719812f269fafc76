# Two commands do it all:
#   make demo       install, refine the demo room, print the result table
#   make test       install what is missing and run every test; YES=1 installs system libraries too
# And one by one:
#   make install    into .venv, with the command r2sego
#   make extension  the Blender add-on, dist/r2sego-*.zip
#   make window     the tab in a real Blender with its window: BLENDER=/path/to/blender make window
#   make measure    how quickly it draws with a large scene, and its memory: BLENDER=... make measure
#   make lock       requirements/, the packages with their hashes, after a change of pyproject.toml's lists
# For an NVIDIA GPU under Linux: make install CUDA=1, which fetches 3 GB more
# To train policies: make install POLICY=1, 120 MB more
# For experiments on a cluster: make install CLUSTER=1, 250 MB more
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/pip install --quiet --disable-pip-version-check
LOCKED := $(PIP) --require-hashes
# Python compiles the modules that are imported, once; pip would compile all: most of the time that it takes.
# Of torch it does: a policy's process imports it where nothing may be written.
UNCOMPILED := $(if $(PYTHONDONTWRITEBYTECODE),,--no-compile)
lists = $(foreach list,$(1),--requirement requirements/$(list).txt)
DEMO_SCENE := build/demo_room.r2s
# Of torch the index of packages has for Linux the build with CUDA; PyTorch's own has the one for processors.
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu
TORCH_FROM := $(if $(filter Linux,$(shell uname -s)),--retries 1 --index-url $(TORCH_INDEX))

.PHONY: demo test window measure install install-tests python system extension lint lock clean help
.DEFAULT_GOAL := help

help:
	@sed -n 's/^#   //p' Makefile

# torch comes first, alone and by its hash: no other package is looked for in its index. A build on disk is
# taken where pip knows of one.
$(VENV)/.installed: pyproject.toml requirements/torch.txt requirements/engine.txt requirements/policy.txt requirements/cluster.txt requirements/cuda.txt | python
	$(PYTHON) -m venv $(VENV)
	$(if $(CUDA),,$(LOCKED) --no-deps $(TORCH_FROM) --requirement requirements/torch.txt)
	$(LOCKED) $(UNCOMPILED) $(call lists,engine $(if $(CUDA),cuda) $(if $(POLICY),policy) $(if $(CLUSTER),cluster))
	$(PIP) --no-index --no-deps --no-build-isolation --editable .
	@touch $@

# On top, for tests alone: bpy is 350 MB, and needs libraries of X11 and GL that the demo does not.
$(VENV)/.tests-installed: $(VENV)/.installed requirements/tests.txt
	$(LOCKED) $(UNCOMPILED) $(call lists,engine policy tests)
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

lock: install-tests
	$(BIN)/python batch/lock_packages.py

extension: system install-tests
	$(BIN)/python batch/build_extension.py --out dist

clean:
	rm -rf build dist $(VENV)
