# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The models of the source paper and of FCL, which setup.py registers as entry points."""
from __future__ import annotations

from box_contact_ros.solver.models import Family, ModelEntry

HERE = 'box_contact_ros'
NEEDS = ('size_a', 'size_b', 'weights')
SOUP_DIVISIONS, MOST_SOUP_DIVISIONS = 8, 64
"""Divisions of an edge in model `soup`, and the most that are accepted (49,152 triangles a box)."""

PAPER = ModelEntry(
    name='paper', line="the paper's network 6-20-18-4",
    builder=f'{HERE}.paper.paper_models:paper', takes=NEEDS,
    boxes='two equal cubes, or two 40 ft containers', native_batch=True)
CONTINUOUS = ModelEntry(
    name='paper-continuous', line="the paper's networks 6-20-17-4 on subsets without jumps",
    builder=f'{HERE}.paper.paper_models:paper_continuous', takes=NEEDS,
    boxes='two equal cubes', native_batch=True)
COMMITTEE = ModelEntry(
    name='paper-committee', line="a classifier and the paper's network for each class",
    builder=f'{HERE}.paper.paper_models:paper_committee', takes=NEEDS,
    boxes='two equal cubes', native_batch=True)
FCL = ModelEntry(
    name='fcl', line="FCL's box-box, its deepest contact; a baseline",
    builder=f'{HERE}.soup.fcl_box:FclBox', extra='soup')
SOUP = ModelEntry(
    name='soup', line='polygon soup on FCL, N divisions an edge; a baseline',
    builder=f'{HERE}.soup.soup:Soup', takes=('divisions',), extra='soup',
    most_near=64,  # each takes a third of a second at worst
    family=Family(argument='divisions', default=SOUP_DIVISIONS, most=MOST_SOUP_DIVISIONS))
