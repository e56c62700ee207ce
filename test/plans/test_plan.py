# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a plan takes, and what it refuses."""
from __future__ import annotations

import numpy as np
import pytest

from box_contact_ros import Plan
from box_contact_ros.plans.plan import Fault

AT = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def test_what_is_left_out_is_known():
    plan = Plan((1, 1, 1), [AT, AT], ground=1)
    assert len(plan) == 2 and plan.sizes.shape == (2, 3) and plan.masses is None
    assert plan.ground.tolist() == [1] and plan.names == ('0', '1') and plan.faults == ()
    assert not plan.centres.any() and (plan.limits == np.inf).all()
    assert plan.body.tolist() == [0, 1] and plan.apart.shape == (0, 2)
    assert len(Plan([], [])) == 0


def test_lists_become_arrays():
    plan = Plan([(1, 2, 3), (1, 1, 1)], [AT, AT], 5, ground=[1, 1], names=['a', 'b'], body=[7, 7],
                limits=[10, np.inf], apart=[(0, 1)], faults=[Fault('gap', ('a',), 'hangs')])
    assert plan.masses.tolist() == [5.0, 5.0] and plan.ground.tolist() == [1]
    assert plan.body.tolist() == [0, 0] and plan.names == ('a', 'b') and len(plan.faults) == 1


def test_a_plan_by_least_corners():
    plan = Plan.from_corners([(0, 0, 0), (1, 0, 0)], [(1, 2, 3), (2, 2, 2)], 5, ground=1)
    assert plan.poses.tolist() == [[.5, 1, 1.5, 0, 0, 0, 1], [2, 1, 1, 0, 0, 0, 1]]
    assert plan.masses.tolist() == [5, 5] and plan.ground.tolist() == [1]
    assert Plan.from_corners([(0, 0, 0)] * 2, (1, 1, 1)).sizes.shape == (2, 3)
    for least, sizes, words in (([(0, 0)], (1, 1, 1), 'least must be corners'),
                                ([(0, 0, np.nan)], (1, 1, 1), r'least\[0\] position .* finite'),
                                ([(0, 0, 0)], [(1, 1, 1)] * 2, 'sizes: 2 sizes, but 1 pose')):
        with pytest.raises(ValueError, match=f'^{words}'):
            Plan.from_corners(least, sizes)


@pytest.mark.parametrize('field, value, words', [
    ('sizes', [(1, 1, 1)], '^sizes: 1 size, but 2 poses$'),
    ('sizes', [(1, 1, 1), (1, -1, 1)], r'sizes\[1\] \(1, -1, 1\) is not positive'),
    ('sizes', (1, np.nan, 1), 'sizes .* is not finite'),
    ('poses', [AT[:6]] * 2, r'poses must be .* not an array of shape \(2, 6\)'),
    ('poses', [AT, (np.inf, *AT[1:])], r'poses\[1\] position .* is not finite'),
    ('poses', [AT, (np.nan,) * 7], r'poses\[1\] position .* is not finite'),
    ('masses', [1, -1], r'masses\[1\] is -1 kg'),
    ('masses', [np.nan, 1], r'masses\[0\] is nan kg'),
    ('masses', [1, 2, 3], r'masses must be .* not an array of shape \(3,\)'),
    ('limits', [1, -2], r'limits\[1\] is -2 kg'),
    ('ground', [2], 'ground must be a whole number from 0 to 1, not 2'),
    ('ground', -1, 'ground must be a whole number from 0 to 1, not -1'),
    ('names', ['a'], 'names must be 2 names'),
    ('names', ['a', 2], r'names\[1\] must be a string, not 2'),
    ('friction', [0, -0.1], r'friction\[1\] is -0.1, not 0 or more'),
    ('friction', np.inf, r'friction\[0\] is inf'),
    ('centres', [(0, 0, 0), (0, np.inf, 0)], r'centres\[1\] \(0, inf, 0\) is not finite'),
    ('body', [0], 'body must be 2 whole numbers'),
    ('apart', [(0, 2)], r'apart\[0\] is \(0, 2\)'),
    ('faults', ['gap'], r"faults\[0\] must be a Fault, not 'gap'"),
])
def test_bad_input_is_refused_with_field_row_and_value(field, value, words):
    with pytest.raises(ValueError, match=f'^{words}'):
        Plan(**{'sizes': (1, 1, 1), 'poses': [AT, AT], field: value})


def test_a_fault_is_of_a_known_kind():
    assert Fault('gap', (), '').verdict == 'not sound'
    assert Fault('pose', (), '').verdict == 'not all judged'
    with pytest.raises(ValueError, match="kind must be one of origin, .*, not 'odd'"):
        Fault('odd', (), '')
