# `make demo` and `make test` do all the set-up on a machine that has Python 3.11 or 3.12, then the
# work. Both share one virtual environment, .venv, and a second call starts at once.

SHELL := bash
.SHELLFLAGS := -euo pipefail -c
.ONESHELL:
.NOTPARALLEL:
.DEFAULT_GOAL := help
.PHONY: help demo view test test-arm lint coverage clean

# Arguments for the program behind the target: make test ARGS='-k sat -x'
ARGS ?=
# The Python that .venv is made with: make demo PYTHON=/path/to/python3.12 (once there is a .venv,
# only after make clean)
PYTHON ?=

# The environment below is complete. Another one's packages must not shine through, nor a ROS that
# was installed with apt and sourced in this shell: its libraries do not go with the wheels'.
unexport PYTHONHOME PYTHONPATH RMW_IMPLEMENTATION _ROS_WHEELS_BOOTSTRAP_COMPLETE
ifdef ROS_DISTRO
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH LD_LIBRARY_PATH ROS_DISTRO
endif
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# pip's output goes through a pipe here, and would otherwise come in large blocks.
export PYTHONUNBUFFERED := 1

VENV_PYTHON := .venv/bin/python
# What the installation is made from: a change of one of these installs again.
INSTALL_INPUTS := setup.py setup.cfg pyproject.toml constraints.txt box_contact_ros/cli.py \
    $(shell find box_contact_ros -name '*.[ch]pp')

help:
	@echo 'make demo     the crane, the contact node, and contacts live in this terminal'
	echo 'make view     the same in the browser, with models to switch and runs to repeat'
	echo 'make test     ruff, mypy and all tests'
	echo 'make test-arm the C++ test on an emulated 64-bit ARM'
	echo 'make lint     ruff, mypy and ament'\''s linters only'
	echo 'make coverage share of the core that its own tests run'
	echo 'make clean    remove .venv and everything that was generated'
	echo
	echo 'Each does its own set-up, in .venv. Arguments: make test ARGS="-k sat -x".'
	echo 'The set-up looks for Python 3.11 or 3.12; another place: make demo PYTHON=/path/to/python3.12'

demo: .venv/.installed-demo
	@exec $(VENV_PYTHON) -m box_contact_ros.apps.demo $(ARGS)

view: .venv/.installed-view
	@exec $(VENV_PYTHON) -m box_contact_ros view $(ARGS)

test: .venv/.installed-test
	@echo 'ruff'
	$(VENV_PYTHON) -m ruff check .
	echo 'mypy'
	$(VENV_PYTHON) -m mypy
	echo 'pytest'
	exec $(VENV_PYTHON) -m pytest $(ARGS)

test-arm: .venv/.installed-test
	@exec bash test/core/arm.sh $(VENV_PYTHON)

lint: .venv/.installed-test
	@$(VENV_PYTHON) -m ruff check . $(ARGS)
	$(VENV_PYTHON) -m mypy
	exec $(VENV_PYTHON) -m pytest test/package/test_ament.py

# Lines of the core's Python side, the solver and scenes, that their own tests run.
coverage: .venv/.installed-test
	@$(VENV_PYTHON) -m coverage run -m pytest \
	    test/solver test/scene test/baselines/test_paper_models.py test/package/test_package.py $(ARGS)
	$(VENV_PYTHON) -m coverage report

clean:
	@if [ -e .venv ] && [ ! -e .venv/.made-by-make ]; then
	    echo 'left alone: .venv, which this Makefile did not make'
	else
	    rm -rf .venv
	fi
	rm -rf build dist install log box_contact_ros.egg-info
	find box_contact_ros -name '*.so' -delete
	rm -rf .pytest_cache .ruff_cache .mypy_cache .hypothesis
	find box_contact_ros test launch -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true

# Stamps are written last: a set-up that was interrupted is taken up again by the next call.
.venv/.installed-demo: .venv/.created $(INSTALL_INPUTS)
	@$(call install,ros$(comma)sim,ROS 2 Jazzy and MuJoCo,1 to 3 minutes)
	touch $@

.venv/.installed-view: .venv/.created $(INSTALL_INPUTS)
	@$(call install,ros$(comma)sim$(comma)view$(comma)soup,ROS 2 Jazzy$(comma) MuJoCo$(comma) viser,1 to 3 minutes)
	touch $@ .venv/.installed-demo

.venv/.installed-test: .venv/.created $(INSTALL_INPUTS)
	@$(call install,ros$(comma)sim$(comma)view$(comma)bag$(comma)train$(comma)soup$(comma)report$(comma)test,\
	    ROS 2 Jazzy$(comma) MuJoCo$(comma) PyTorch and the test tools,2 to 6 minutes)
	touch $@ .venv/.installed-demo .venv/.installed-view

# An environment holds the project's path in many places, and lives on the Python it was made with.
# After a move, in a copy, or without that Python it is made anew. The stamps have to go while make
# reads this file, before it looks at what is up to date.
ifneq ($(wildcard .venv/.created),)
$(shell { [ "$$(cat .venv/.created)" = "$$(pwd -P)" ] && $(VENV_PYTHON) -c ''; } 2>/dev/null || \
    rm -f .venv/.created .venv/.installed-*)
endif

comma := ,
define install
SECONDS=0
printf 'installing %s into .venv (about $(strip $(3)); log: .venv/setup.log) ' '$(strip $(2))'
rm -f $@
# Without build isolation the pinned setuptools is used, and not fetched a second time.
if ! { $(VENV_PYTHON) -m pip install -c constraints.txt pip setuptools wheel numpy &&
    $(VENV_PYTHON) -m pip install -c constraints.txt --no-build-isolation -e '.[$(strip $(1))]'
    } 2>&1 | tee .venv/setup.log |
    awk '/^Collecting/ {printf "."} /^Installing collected/ {printf " unpacking"} {fflush()}'
then
    printf '\n'
    tail -n 15 .venv/setup.log
    echo 'error: the installation failed; the lines above are the end of .venv/setup.log.' >&2
    echo 'Call make again to take it up where it stopped.' >&2
    exit 1
fi
printf ' done in %s s\n' "$$SECONDS"
endef

# Nothing is created before a usable Python is found. Whether one is usable is asked by running it:
# names may lie, and pyenv's shims exist for versions that they then refuse to start.
.venv/.created:
	@supported() { "$$1" -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)))' >/dev/null 2>&1; }
	version() { "$$1" -c 'import sys; print("%d.%d.%d" % sys.version_info[:3])' 2>/dev/null || echo 'does not start'; }
	if [ -e .venv ] && [ ! -e .venv/.made-by-make ]; then
	    if supported $(VENV_PYTHON) && $(VENV_PYTHON) -m pip --version >/dev/null 2>&1; then
	        echo "using the .venv that is here (Python $$(version $(VENV_PYTHON)))"
	        pwd -P > $@
	        exit 0
	    fi
	    echo 'error: .venv exists, was not made by this Makefile, and has no pip with Python 3.11 or 3.12: move it away, then call make again.' >&2
	    exit 1
	fi
	wanted='$(PYTHON)'
	candidates=(python3.12 python3.11 python3)
	if [ -n "$$wanted" ]; then candidates=("$$wanted"); fi
	found=
	tried=
	for candidate in "$${candidates[@]}"; do
	    command -v "$$candidate" >/dev/null || { tried+=" $$candidate: not found;"; continue; }
	    if supported "$$candidate"; then found=$$candidate; break; fi
	    tried+=" $$candidate: $$(version "$$candidate");"
	done
	if [ -z "$$found" ]; then
	    tried=$${tried# }
	    echo "error: Python 3.11 or 3.12 is needed ($${tried%;}). Install one (apt install python3.12 python3.12-venv, or pyenv install 3.12), or say where it is: make demo PYTHON=/path/to/python3.12" >&2
	    exit 1
	fi
	if ! "$$found" -c 'import ensurepip, venv' >/dev/null 2>&1; then
	    package=python$$("$$found" -c 'import sys; print("%d.%d" % sys.version_info[:2])')-venv
	    echo "error: $$found has no venv module: install it (Debian, Ubuntu: apt install $$package), then call make again." >&2
	    exit 1
	fi
	echo "making .venv with $$found (Python $$(version "$$found")), about 5 s"
	rm -rf .venv
	mkdir .venv
	touch .venv/.made-by-make
	"$$found" -m venv .venv
	pwd -P > $@
