# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Python face of the core: solvers, their results, their models and weights."""
