# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Landings: by which way of contact and force the load comes to rest."""
