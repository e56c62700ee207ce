# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Engines that are measured where they are installed; an extra brings the small ones."""
