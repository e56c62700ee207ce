# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What proves and compares: README.md here has the map."""

from box_contact_ros.extras import expect_extras

expect_extras()
