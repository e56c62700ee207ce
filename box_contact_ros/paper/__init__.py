# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The networks of the source paper, in C++: see networks.hpp and symmetry.hpp."""
