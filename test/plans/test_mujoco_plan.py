# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The example that fills a plan from a model of MuJoCo equals a reader of its own, in ten models.

mujoco_plans.json has what that reader made of mujoco_models.py; a robot that cannot move was
`sound` then.
"""
from __future__ import annotations

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('clarabel')
mujoco = pytest.importorskip('mujoco')

from mujoco_models import MODELS

from box_contact_ros import inspect_plan

HERE = Path(__file__)
RECORDED = json.loads(HERE.with_name('mujoco_plans.json').read_bytes())


@pytest.fixture(scope='module')
def plan_of():
    """Return the function of the example."""
    return runpy.run_path(str(HERE.parents[2] / 'docs/examples/mujoco_plan.py'))['plan_of']


@pytest.mark.parametrize('name', MODELS)
def test_the_example_equals_the_reader(plan_of, name):
    plan, wanted = plan_of(mujoco.MjModel.from_xml_string(MODELS[name])), RECORDED[name]
    boxes = [n for n, name in enumerate(plan.names) if name != 'floor']
    assert [plan.names[n] for n in boxes] == wanted['names']
    for field in 'sizes', 'poses', 'masses', 'centres':
        assert np.abs(getattr(plan, field)[boxes] - wanted[field]).max() < 1e-5, field
    assert [n in plan.ground for n in boxes] == wanted['ground']
    same = np.equal.outer(plan.body[boxes], plan.body[boxes])
    assert np.array_equal(same, np.equal.outer(wanted['body'], wanted['body']))
    assert [[plan.names[n] for n in pair] for pair in plan.apart] == wanted['apart']
    found = inspect_plan(plan)
    rows = [[row.kind, *row.names] for row in found.rows() if row.kind != 'shape']
    assert found.verdict == wanted['verdict'] and rows == wanted['rows']
    named = sorted(name for fault in plan.faults for name in fault.names)
    assert named == wanted['named'] and len(plan.faults) == len(named) + (name == 'slope')
