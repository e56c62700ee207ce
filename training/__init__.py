# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data sets, fitting and the program `train`. Drawing and folding samples needs no PyTorch."""
