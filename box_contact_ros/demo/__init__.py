# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane in MuJoCo, its node, and the demo."""

from ..extras import require

require('sim')
