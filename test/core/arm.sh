#!/usr/bin/env bash
# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Compile the library for aarch64, run it under qemu, and compare its answers with this machine's.
#
# usage: arm.sh [PYTHON]     (default: .venv/bin/python)
# Needed: on Debian and Ubuntu `apt install g++-aarch64-linux-gnu qemu-user`.
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/../.."
for program in aarch64-linux-gnu-g++ qemu-aarch64; do
    command -v "$program" >/dev/null || {
        echo "error: $program is not installed (apt install g++-aarch64-linux-gnu qemu-user)" >&2
        exit 1
    }
done
exec "${1:-.venv/bin/python}" -m pytest -n 0 -v test/core/test_builds.py -m arm
