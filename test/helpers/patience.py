# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The one limit of time in the tests."""

PATIENCE = 200.0
"""Time [s] for what has to come: a limit against hanging, no more. Machines may be busy."""
