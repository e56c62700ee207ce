# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the models are compared with: the paper's networks."""

from ..extras import require

require('soup')
