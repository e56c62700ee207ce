# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The polygon soup on FCL, which the source paper compares itself with, and its node."""

from ..extras import require

require('soup')
