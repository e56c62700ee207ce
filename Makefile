# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# On a machine with git, a C++ compiler and Python 3.11 to 3.14, each target makes what it needs in
# .venv (.ci/setup), then does the work. A second call starts at once.

SHELL := bash
.SHELLFLAGS := -euo pipefail -c
.ONESHELL:
.NOTPARALLEL:
.DEFAULT_GOAL := help
.PHONY: help demo view test check reports rivals docs docs-links tables dist coverage clean
.PHONY: test-arm test-builds test-colcon test-debian13 test-reports test-schemas test-training

# Arguments for the program behind the target: make test ARGS='-k sat -x'
ARGS ?=
# The Python that .venv is made with: make demo PYTHON=/path/to/python3.12 (once there is a .venv,
# only after make clean)
PYTHON ?=
export PYTHON

# .venv is complete. Another environment's packages must not shine through, nor a ROS that was
# installed with apt and sourced in this shell: its libraries do not go with the wheels'. Programs
# start twice as fast where Python may keep their bytecode, which images for containers forbid.
unexport PYTHONDONTWRITEBYTECODE PYTHONHOME PYTHONPATH RMW_IMPLEMENTATION
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
ifdef ROS_DISTRO
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH LD_LIBRARY_PATH ROS_DISTRO
endif

PY := .venv/bin/python
CMAKE := .venv/bin/cmake
# One worker more than cores: tests of nodes mostly wait. A file's tests share what it has set up.
WORKERS := $(shell expr $$(getconf _NPROCESSORS_ONLN) + 1)
PYTEST := $(PY) -m pytest -n $(WORKERS) --dist loadfile -rs --durations 10
LINT := echo ruff; $(PY) -m ruff check .; echo mypy; $(PY) -m mypy

help:
	@echo 'make demo     the crane, the contact node, and contacts live in this terminal'
	echo 'make view     the same in the browser, again and again'
	echo 'make test     ruff, mypy, and all tests of what the package answers'
	echo 'make test-builds  another compiler, sanitizers, wheels and other installations'
	echo 'make test-reports  the reports and the demo, each in a quick run, examples and pages'
	echo 'make test-training  the tests of training, for which it fetches PyTorch'
	echo 'make check    linters, and the quick tests of core, solver and scene: a minute'
	echo 'make test-colcon  tests of what an installation changes, by `colcon test` in a workspace'
	echo 'make test-schemas  the AsyncAPI document, by its own parser, which npm fetches'
	echo 'make test-arm the library on an emulated 64-bit ARM: the same bits as here'
	echo 'make test-debian13  make demo, then make test, on a fresh Debian 13 (root)'
	echo 'make dist     wheel and source distribution in dist/, both installed and tried'
	echo 'make coverage lines of solver, scenes and nodes that their tests run'
	echo 'make reports  every table and picture of docs, in hours; ARGS=--quick tries them out,'
	echo '              LEAVE_OUT=drake does without a rival that is not installed'
	echo 'make rivals   fetch Box3D and Jolt, and compile what the reports run'
	echo 'make docs     the documentation as HTML: build/docs/index.html'
	echo 'make docs-links asks every link to another site'
	echo 'make tables   write the figures of docs/results/ into README and docs'
	echo 'make clean    remove .venv and everything that was generated'
	echo
	echo 'Each does its own set-up, in .venv. Arguments: make test ARGS="-k sat -x".'
	echo 'The set-up looks for Python 3.11 to 3.14; another place: make demo PYTHON=/path/to/python3.12'

demo:
	@.ci/setup demo
	exec $(PY) -m box_contact_ros.demo.demo $(ARGS)

view:
	@.ci/setup demo
	exec $(PY) -m box_contact_ros.demo.demo --view $(ARGS)

test:
	@.ci/setup test
	$(LINT)
	exec $(PYTEST) $(ARGS)

check:
	@.ci/setup test
	$(LINT)
	exec $(PYTEST) -m 'not slow' test/core test/solver test/models test/forces test/stream test/scene \
	    test/package/test_house.py test/package/test_ament.py $(ARGS)

# The reports run one after the other, as most of them measure time; each runs though one before it
# failed. With ARGS=--quick results go to quick-results/, and docs/ stays as it is.
RESULTS := $(if $(filter --quick,$(ARGS)),quick-results,docs/results)
# Rivals that may be missing, of mujoco fcl coal bullet drake box3d jolt rapier:
# make reports LEAVE_OUT='drake jolt'
LEAVE_OUT ?=
LEFT_OUT := $(if $(LEAVE_OUT),--leave-out $(LEAVE_OUT))
BENCH := box_contact_ros.bench.bench --duration $(if $(filter --quick,$(ARGS)),6,60)
reports:
	@.ci/setup reports
	failed=
	if [ $(RESULTS) = docs/results ]; then $(MAKE) rivals ARGS= || failed=' rivals'; fi
	run() { echo "== $$*"; $(PY) -m "$$@" || failed+=" $$1"; }
	# Those with rivals come first: one that is missing shows at once.
	run benchmarks.native $(ARGS) $(LEFT_OUT)
	run benchmarks.distance $(ARGS) $(LEFT_OUT)
	run benchmarks.motion $(ARGS) $(LEFT_OUT)
	run benchmarks.frontier $(ARGS) $(LEFT_OUT)
	run benchmarks.stacks $(ARGS) $(LEFT_OUT)
	run benchmarks.accuracy $(ARGS)
	run benchmarks.stability $(ARGS)
	run benchmarks.named_failures $(ARGS)
	run benchmarks.fuzz $(ARGS)
	run benchmarks.landing $(ARGS)
	run benchmarks.force_lines $(ARGS)
	run benchmarks.scenes $(ARGS)
	run benchmarks.speed $(ARGS)
	run benchmarks.paper $(ARGS)
	run benchmarks.paper.search $(ARGS)
	for model in exact mlp paper; do
	    run $(BENCH) --model $$model --beside quiet nice busy --out $(RESULTS)/bench_$$model.md
	done
	run $(BENCH) --rate 1000 --nodes echo floor contact --out $(RESULTS)/bench_1000_hz.md
	if [ $(RESULTS) = docs/results ]; then
	    for figures in docs/figures/make_*.py; do $(PY) $$figures || failed+=" $$figures"; done
	    $(PY) docs/tables.py || failed+=' docs/tables.py'
	fi
	if [ -n "$$failed" ]; then echo "failed:$$failed" >&2; exit 1; fi

# From sources that are here: make rivals ARGS=-DFETCHCONTENT_SOURCE_DIR_JOLT=/path/to/JoltPhysics
rivals:
	@.ci/setup test
	$(CMAKE) -S benchmarks/stack_calls -B build/rivals -DLEAVE_OUT='$(LEAVE_OUT)' $(ARGS)
	exec $(CMAKE) --build build/rivals --parallel $$(getconf _NPROCESSORS_ONLN)

test-builds test-reports:
	@.ci/setup test
	exec $(PYTEST) -m $(@:test-%=%) $(ARGS)

test-training:
	@.ci/setup training
	exec $(PYTEST) -m training $(ARGS)

# All tests there, which takes six times as long: make test-colcon ARGS=test
test-colcon:
	@.ci/setup test
	exec bash test/package/colcon.sh $(PY) $(ARGS)

test-schemas:
	@.ci/setup test
	for program in node npm; do
	    command -v $$program >/dev/null || {
	        echo "error: $$program is not installed (apt install nodejs npm)" >&2; exit 1; }
	done
	exec $(PY) -m pytest -m network test/node/test_msg_schemas.py $(ARGS)

test-arm:
	@.ci/setup test
	exec bash test/core/arm.sh $(PY)

# Another release, other commands: make test-debian13 DEBIAN=forky ARGS='"make demo"'
DEBIAN ?= trixie
test-debian13:
	@exec bash test/package/debian.sh $(DEBIAN) $(ARGS)

dist:
	@.ci/setup test
	exec bash test/package/dist.sh $(PY)

# Lines of solver, scenes and nodes that their own tests run, in all processes.
coverage:
	@.ci/setup test
	$(PY) -m coverage erase
	$(PY) -m coverage run -m pytest test/solver test/models test/forces test/scene test/stream \
	    test/node test/package/test_package.py $(ARGS)
	$(PY) -m coverage combine -q
	$(PY) -m coverage report --fail-under 95

docs:
	@.ci/setup test
	$(PY) -m sphinx -q -W --keep-going -b html docs build/docs $(ARGS)
	echo 'open $(CURDIR)/build/docs/index.html'

docs-links:
	@.ci/setup test
	$(PY) -m sphinx -q -W --keep-going -b linkcheck docs build/docs-links $(ARGS)

tables:
	@.ci/setup demo
	exec $(PY) docs/tables.py $(ARGS)

clean:
	@if [ -e .venv ] && [ ! -e .venv/.made-by-make ]; then
	    echo 'left alone: .venv, which this Makefile did not make'
	else
	    rm -rf .venv
	fi
	rm -rf build dist install log box_contact_ros.egg-info
	find box_contact_ros -name '*.so' -delete
	rm -rf .pytest_cache .ruff_cache .mypy_cache .hypothesis
	find benchmarks box_contact_msgs box_contact_ros docs launch test training -name __pycache__ -type d -prune -exec rm -rf {} + || true
