# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Samples, fit and recipe of the network of `mlp`; `python -m training` makes all weights.

The data and the fit of the paper's networks are in `benchmarks.paper`.
"""

from box_contact_ros.extras import expect_extras

expect_extras()
