# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Boxes without a scene: contacts, distances and patches of faces, and what input is refused."""
