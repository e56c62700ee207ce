# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Is a plan sound? Right values by hand, bodies, causes, and what is refused."""
from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from patience import PATIENCE

from box_contact_ros import Plan, inspect_plan
from box_contact_ros.plans.inspection import CAUSES
from box_contact_ros.plans.plan import Fault
from box_contact_ros.plans.plot import COLOURS

pytest.importorskip('clarabel')
G = 9.81
LEVEL = (0.0, 0.0, 0.0, 1.0)
FLOOR = ((50, 50, 1), (0, 0, -0.5, *LEVEL))


def box(x, z, size=(1, 1, 1), y=0.0, turn=LEVEL):
    return size, (x, y, z, *turn)


def turned(axis, degrees):
    half = np.radians(degrees) / 2
    return (*np.sin(half) * np.array(axis), np.cos(half))


def plan_of(boxes, masses, *, floor=FLOOR, **fields):
    """Return a plan of boxes on a floor, which is box 0."""
    sizes, poses = zip(floor, *boxes)
    masses = None if masses is None else [0, *masses]
    return Plan(sizes, poses, masses, ground=0, **fields)


def loads(found):
    """Return what each patch carries [kg], by the lower and the upper box."""
    return {(a, b): load / np.linalg.norm(found.acceleration)
            for (a, b), load in zip(found.carried_by.tolist(), found.loads)}


CUBES = [10.0, 10.0, 10.0]
PLANK, PAD = (3, 1, 0.1), (0.2, 1, 1)


@pytest.mark.parametrize('boxes, masses, wanted', [
    ([box(0, 0.5)], [10], {(0, 1): 10}),
    ([box(0, 0.5), box(0.49, 1.5)], [10, 10], {(0, 1): 20, (1, 2): 10}),
    # A plank that overhangs by 0.6 m, held by 30 kg on its inner end.
    ([box(0, 0.5), box(0.6, 1.5, (2, 1, 1)), box(-0.1, 2.5, (0.6, 1, 1))], [10, 10, 30],
     {(0, 1): 50, (1, 2): 40, (2, 3): 30}),
    ([*(box(x, 0.5, PAD) for x in (-1, 0, 1)), box(0, 1.05, PLANK)], [1, 1, 1, 12],
     {(0, 1): 5, (0, 2): 5, (0, 3): 5, (1, 4): 4, (2, 4): 4, (3, 4): 4}),
    # A table, with 8 kg off its middle: by moments about both axes.
    ([*(box(0.9 * x, 0.5, (0.1, 0.1, 1), 0.4 * y) for x in (-1, 1) for y in (-1, 1)),
      box(0, 1.05, (2, 1, 0.1)), box(0.45, 1.6, (0.2, 0.2, 1), 0.2)], [1] * 4 + [20, 8],
     {(1, 5): 5, (2, 5): 7, (3, 5): 7, (4, 5): 9, (5, 6): 8}),
])
def test_loads_are_those_by_hand(boxes, masses, wanted):
    found = inspect_plan(plan_of(boxes, masses))
    assert found.sound and found.stands.all() and not found.cause.astype(bool).any()
    got = loads(found)
    for pair, load in wanted.items():
        assert got[pair] == pytest.approx(load, abs=0.01)
    assert found.corner_loads.sum(axis=1) == pytest.approx(found.loads)
    assert found.mass == sum(masses) and (found.loaded_margin > 0).all()
    assert found.load[0] == pytest.approx(G * sum(masses))


@pytest.mark.parametrize('boxes, masses, cause', [
    ([box(0, 0.5), box(0.51, 1.5)], [10, 10], ['', 'unsupported']),
    # Each centre is above what carries it; those of both upper cubes together are not.
    ([box(0, 0.5), box(0.3, 1.5), box(0.7, 2.5)], [10, 10, 30],
     ['', 'tips under its load', 'goes with what falls']),
    ([box(0, 0.5), box(0, 2.5), box(0, 3.5)], [10, 10, 10], ['', 'hangs', 'goes with what falls']),
    ([box(0, np.sqrt(0.5) - 1e-3, turn=turned((1, 0, 0), 45))], [10], ['unsupported']),
])
def test_what_falls_has_a_cause(boxes, masses, cause):
    found = inspect_plan(plan_of(boxes, masses))
    assert found.cause.tolist() == ['', *cause] and not found.sound
    assert np.array_equal(found.stands, found.cause == '')


def test_what_beds_press_to_the_rim_stands():
    """A light box bears on its edge before its neighbour bears all; that one can."""
    sizes = [(0.23, 0.12, 0.2), (0.23, 0.12, 0.2), (0.31, 0.17, 0.43), (0.31, 0.17, 0.23),
             (0.18, 0.2, 0.25), (0.19, 0.22, 0.1)]
    places = [(0.68, 0.66, 0.1), (0.68, 0.54, 0.1), (0.645, 0.45, 0.215), (0.645, 0.63, 0.315),
              (0.54, 0.51, 0.555), (0.51, 0.51, 0.73)]
    masses = np.array([0, 0, 0, 0.3, 0.75, 4.8])
    plan = Plan(sizes, [(*place, *LEVEL) for place in places], masses, ground=[0, 1, 2])
    found = inspect_plan(plan)
    assert found.sound and (found.loaded_margin[3:] > found.tolerance).all()
    load = loads(found)
    assert load[3, 4] + load[2, 4] == pytest.approx(5.55) and load[4, 5] == pytest.approx(4.8)
    heavier = Plan(sizes, plan.poses, [0, 0, 0, 0.3, 0.75, 48], ground=[0, 1, 2])
    assert inspect_plan(heavier).sound  # the post carries any


@pytest.mark.parametrize('friction, cause', [
    (0.5, ['', '', '']), (0.05, ['unsupported', 'unsupported', 'goes with what falls'])])
def test_friction_holds_an_arch(friction, cause):
    """Two cubes lean over an edge by 2 cm; the stone across them, held by friction, keeps them."""
    tables = [((1, 1, 1), (x, 0, 0.5, *LEVEL)) for x in (-1.5, 1.5)]
    boxes = [box(-0.98, 1.5), box(0.98, 1.5), box(0, 2.5, (1.98, 1, 1))]
    plan = Plan(*zip(*tables, *boxes), [0, 0, 10, 10, 2], ground=[0, 1])
    assert inspect_plan(plan, friction=friction).cause[2:].tolist() == cause


def test_geometry_alone_does_not_see_a_load_that_holds():
    """A plank that overhangs by 0.6 m, below 30 kg on its inner end."""
    found = inspect_plan(plan_of([box(0, 0.5), box(0.6, 1.5, (2, 1, 1)),
                                  box(-0.1, 2.5, (0.6, 1, 1))], None))
    assert found.cause.tolist() == ['', '', 'unsupported', 'goes with what falls']


def test_geometry_alone_does_not_see_a_load_that_tips():
    boxes = [box(0, 0.5), box(0.3, 1.5), box(0.7, 2.5), box(3, 0.5), box(3.6, 1.5)]
    found = inspect_plan(plan_of(boxes, None))
    assert found.cause.tolist() == ['', '', '', '', '', 'unsupported']
    assert np.isnan(found.loads).all() and np.isnan(found.load).all() and np.isnan(found.mass)
    assert found.share[3] == pytest.approx(0.6) and found.margin[3] == pytest.approx(0.1)


def test_nothing_hangs_between_walls():
    """Rigid statics would let it: the walls press as hard as it takes. Beds do not press at all."""
    walls = [((1, 3, 3), (x, 0, 1.5, *LEVEL)) for x in (-1, 1)]
    for sides in (False, True):
        found = inspect_plan(Plan(*zip(*walls, box(0, 1.5)), [0, 0, 10], ground=[0, 1]),
                             sides=sides)
        assert found.cause.tolist() == ['', '', 'hangs']


def slope(degrees):
    """Return a plan of a cube on a slope of so many degrees."""
    turn, (x, z) = turned((0, 1, 0), degrees), np.array(
        (np.sin(np.radians(degrees)), np.cos(np.radians(degrees)))) / 2
    return plan_of([box(x, z, turn=turn)], [10], floor=((50, 50, 1), (-x, 0, -z, *turn)))


@pytest.mark.parametrize('degrees, friction, holds', [
    (20, 0.5, True), (26.5, 0.5, True), (26.6, 0.5, False), (30, 0.5, False), (30, 0.6, True),
    (20, 0.0, False)])
def test_a_cube_on_a_slope_slides_from_the_angle_of_friction_on(degrees, friction, holds):
    found = inspect_plan(slope(degrees), friction=friction)
    assert found.cause[1] == ('' if holds else 'slides')
    assert found.loads[0] == pytest.approx(10 * G * np.cos(np.radians(degrees)), rel=1e-5)
    if holds:
        assert found.loaded_margin[1] == pytest.approx(
            0.5 * np.cos(np.radians(degrees)) - 0.5 * np.sin(np.radians(degrees)), abs=1e-6)


@pytest.mark.parametrize('boxes, brake, cause', [
    ([box(0, 0.5), box(0, 1.5)], 0.4, ['', '']),
    ([box(0, 0.5), box(0, 1.5)], 0.6, ['slides', 'goes with what falls']),
    ([box(0, 1.5, (1, 1, 3))], 0.333, ['']), ([box(0, 1.5, (1, 1, 3))], 0.334, ['unsupported']),
    ([box(-1, 0.5), box(1, 0.5), box(0, 1.05, PLANK)], 0.4, ['', '', '']),
    ([box(-1, 0.5), box(1, 0.5), box(0, 1.05, PLANK)], 0.6, ['slides', 'slides', 'goes with what '
                                                             'falls'])])
def test_what_a_lorry_carries_slides_or_tips_when_it_brakes(boxes, brake, cause):
    """By brake / μ, and by brake · height / half width."""
    found = inspect_plan(plan_of(boxes, [10] * len(boxes)), acceleration=(brake * G, 0, -G))
    assert found.cause.tolist() == ['', *cause]


def test_a_trailer_weighs_on_its_axles():
    """Pins at 1.6 and 9.6 m, 7 t of its own, 12 t at 4 m and 8 t at 9 m: by moments."""
    pins = [((0.3, 2, 0.5), (x, 0, 0.25, *LEVEL)) for x in (1.6, 9.6)]
    found = inspect_plan(Plan(*zip(*pins, box(6.8, 0.6, (13.6, 2.4, 0.2)), box(4, 1.2),
                                   box(9, 1.2)), [0, 0, 7e3, 12e3, 8e3], ground=[0, 1]))
    assert found.sound and found.load[:2] / G == pytest.approx([11_450, 15_550], abs=20)


CONTAINERS = [((6.058, 2.438, 2.591), (-3.067, 0, 1.2955, *LEVEL)),
              ((6.058, 2.438, 2.591), (3.067, 0, 1.2955, *LEVEL)),
              ((12.192, 2.438, 2.591), (0, 0, 1.5 * 2.591, *LEVEL))]


def test_containers_bear_on_their_corners():
    """The centre of mass is off by 5 % of the length. By faces, the bed shares more evenly."""
    plan = plan_of(CONTAINERS, [2e3, 2e3, 24e3],
                   centres=[(0, 0, 0)] * 3 + [(0.05 * 12.192, 0, 0)])
    by_corners = loads(inspect_plan(plan, bears='corners'))
    assert by_corners[1, 3] == pytest.approx(10_800, abs=5)
    assert by_corners[2, 3] == pytest.approx(13_200, abs=5)
    by_faces = loads(inspect_plan(plan))
    assert by_faces[1, 3] == pytest.approx(10_200, abs=60)
    assert np.isnan(inspect_plan(plan, bears='corners').pressure[1:3]).all()


def test_boxes_of_a_body_bear_on_their_corners():
    """Four boxes in one body, and a fifth on it: the ground is fixed, and none of these."""
    plan = plan_of([box(0, 0.5 + k) for k in range(5)], [10] * 5, body=[0, 1, 1, 1, 1, 2])
    found = inspect_plan(plan, bears='corners')
    assert found.sound and loads(found) == pytest.approx({(0, 1): 50, (4, 5): 10})


def test_pressure_is_the_greatest_below_a_load():
    """N / A in the middle, and N / A · (1 + 6 e / a) off it; then a triangle."""
    for off, factor in ((0.0, 1.0), (0.1, 1.6), (0.3, 2 / (3 * 0.2))):
        found = inspect_plan(plan_of([box(0, 0.5)], [10], centres=[(0, 0, 0), (off, 0, 0)]))
        assert found.pressure[0] == pytest.approx(10 * G * factor, rel=1e-6)


def test_a_limit_is_on_what_is_on_top():
    boxes = [box(0, 0.5), box(0, 1.5), box(0, 2.5)]
    found = inspect_plan(plan_of(boxes, CUBES, limits=[np.inf, 19.9, 10, 0]))
    assert found.cause.tolist() == ['', 'overloaded', '', ''] and found.stands.all()
    assert not found.sound and 'overloaded            1  20 kg on top' in str(found)


def test_a_pair_that_overlaps_does_not_carry():
    """Beside an overlap a box stands, and has its own share; it may have two faults."""
    found = inspect_plan(plan_of([box(0, 0.5), box(0.4, 0.6, (1, 1, 1.2)), box(0, 0.5)], CUBES))
    assert found.stands.all() and not found.cause.any() and len(found.overlaps) == 3
    assert found.share[1:].tolist() == pytest.approx([1, 1, 1])
    hanging = inspect_plan(plan_of([box(0, 3), box(0.9, 3)], [10, 10]))
    assert [row.kind for row in hanging.rows()] == ['overlap', 'hangs', 'hangs']
    assert hanging.height[1:].tolist() == [2.5, 2.5]
    sunk = inspect_plan(plan_of([box(0, 0.5), box(0.2, 1.4)], [10, 10]))  # by nothing else
    assert sunk.stands.all() and [row.kind for row in sunk.rows()] == ['overlap']


def test_what_goes_with_a_box_that_falls_names_it():
    boxes = [box(0, 0.5), box(0.6, 1.5), box(0.7, 2.5), box(0.7, 3.5), box(9, 5), box(9, 6)]
    found = inspect_plan(plan_of(boxes, [10] * 6, limits=[np.inf] * 5 + [5, 5]))
    assert found.goes_with.tolist() == [-1, -1, -1, 2, 2, -1, 5]
    assert [(row.kind, *row.names) for row in found.rows()][:3] == [
        ('hangs', '5'), ('goes with what falls', '6'), ('unsupported', '2')]
    assert all(f'with {n}\n' in str(found) for n in (2, 5))


def test_what_was_left_out_comes_first():
    faults = [Fault('mass', ('b',), 'has no mass'), Fault('pose', ('c',), 'x is missing: left out')]
    found = inspect_plan(plan_of([box(0, 5)], [10], faults=faults))
    assert [row.kind for row in found.rows()] == ['pose', 'hangs', 'mass']


@pytest.mark.parametrize('start', [0, 50, 500, 5000, 500_000])
@pytest.mark.parametrize('tolerance', [1e-5, None])
def test_coordinates_in_float32_need_a_tolerance(start, tolerance):
    """Ten containers flush side by side overlap by rounding, or the answer says why."""
    place = np.zeros((11, 7))
    place[:, 6], place[10, 1:3] = 1, (start + 10, -0.5)
    place[:10, 1] = np.float32(start + 2.438 * np.arange(10))
    place[:10, 2] = np.float32(1.2955)
    plan = Plan([(12.192, 2.438, 2.591)] * 10 + [(100, 200, 1)], place, 2e4, ground=10)
    found = inspect_plan(plan, tolerance=tolerance)
    told = 'coordinates are float32' in str(found)
    assert told == ((tolerance or 1e-4) < 2**-22 * (start + 9 * 2.438))
    assert told or found.sound


def test_a_tolerance_that_nobody_gave_refuses_nothing():
    boxes = [box(0, 0.5), ((1, 1, 1.5e-4), (0, 0, 1.000075, *LEVEL)), box(0, 1.50015)]
    found = inspect_plan(plan_of(boxes, [10, 0.1, 10]))
    assert found.sound and found.carried_by.tolist() == [[0, 1], [1, 2], [2, 3]]
    with pytest.raises(ValueError, match="half of the thinnest box '2', not 0.0001"):
        inspect_plan(plan_of(boxes, None), tolerance=1e-4)


def test_overlaps_count_beyond_the_tolerance():
    plan = plan_of([box(0, 0.5), box(0.9, 0.5), box(0, 1.49995)], CUBES)
    found = inspect_plan(plan)
    assert found.overlaps.tolist() == [[1, 2]] and found.depths == pytest.approx([0.1])
    assert found.stands.all() and not found.sound
    assert len(inspect_plan(plan, tolerance=1e-5).overlaps) == 3
    assert inspect_plan(plan_of([box(0, 0.5), box(0.9, 0.5), box(0, 1.49995)], CUBES,
                                apart=[(2, 1), (3, 2)])).sound


def test_boxes_of_a_body_hold_together():
    """Alone, the arm of an L would fall. Its foot holds it, and what is on it."""
    boxes = [box(0, 0.5), box(0.7, 1.5), box(0.9, 2.5)]
    assert inspect_plan(plan_of(boxes, [10, 1, 1])).cause[2] == 'unsupported'
    found = inspect_plan(plan_of(boxes, [10, 1, 1], body=[0, 1, 1, 2]))
    assert found.sound and found.carried_by.tolist() == [[0, 1], [2, 3]]
    assert loads(found) == pytest.approx({(0, 1): 12, (2, 3): 1})
    assert found.margin[1] == found.margin[2] == pytest.approx(0.5 - 0.7 / 11)
    assert found.loaded_margin[1] == pytest.approx(0.5 - (0.7 + 0.9) / 12)
    fixed = inspect_plan(Plan(*zip(box(0, 5), box(0.9, 6), box(1, 7)), 1, ground=1, body=[3, 3, 4]))
    assert fixed.sound and fixed.margin[0] == np.inf


def test_a_fault_of_the_file_is_a_line():
    faults = [Fault('gap', ('a',), 'nothing is below it'), Fault('mass', ('b',), 'has no weight')]
    told = Fault('ignored', ('c',), 'not read')
    for some, verdict in ((faults, 'not sound'), (faults[1:], 'not all judged'), ([told], 'sound')):
        found = inspect_plan(plan_of([box(0, 0.5)], [10], faults=some))
        assert found.verdict == verdict and found.sound == (verdict == 'sound')
        assert str(found).count('\n') == len(some) + (len(some) > 1)  # a line that counts
    assert str(found) == ('ignored               c  not read\n1 box, 10.0 kg, centre of mass 0.000 '
                          '0.000 0.500 m, friction 0.5: sound; 1 column was not read')


@pytest.mark.parametrize('plan', [Plan([], []), Plan([], [], []), Plan((1, 1, 1), [
    box(0, 0)[1]], 5, ground=0), Plan((1, 1, 1), [box(0, 0)[1], box(0, 1)[1]], 0, ground=[0, 1])])
def test_little_is_an_answer(plan):
    found = inspect_plan(plan)
    assert found.verdict == 'not all judged' and len(found.stands) == len(plan)
    assert 'support not judged' in str(found)


@pytest.mark.parametrize(('friction', 'told', 'slides'), [
    (None, 0.5, False), (None, 0.05, True), ([np.nan, 0.05], 0.5, True), ([0.05, 0.5], 0.5, True),
    ([0.3, 0.3], 0.05, False), ([np.nan, 0.9], 0.05, True)])
@pytest.mark.parametrize('order', [None, [0, 1]])
def test_a_slope_of_15_degrees(friction, told, slides, order):
    """It holds a box by the lesser friction of both; .05 let MuJoCo's box go 3.7 m in 2 s."""
    turn = turned((0, 1, 0), 15)
    up = np.array([np.sin(np.radians(15)), 0, np.cos(np.radians(15))])
    plan = Plan([(9, 9, 1), (1, 1, 1)], [(0, 0, 0, *turn), (*up, *turn)], [0, 10], ground=0,
                friction=friction, order=order)
    found = inspect_plan(plan, friction=told)
    assert found.cause[1] == ('slides' if slides else '') and bool(found.steps) == (
        slides and order is not None)
    known = [0.05 if value != value else value for value in (friction or [])]
    assert f'friction {min([told, *known]):g}' in found.summary() or friction


def test_each_pair_has_its_friction():
    """Of three crates on a lorry that brakes by .4 g, the smooth one slides."""
    boxes = [box(x, 0.5) for x in (-3, 0, 3)]
    found = inspect_plan(plan_of(boxes, [10] * 3, friction=[0.5, 0.45, 0.35, 0.45]),
                         acceleration=(0.4 * G, 0, -G))
    assert found.cause.tolist() == ['', '', 'slides', '']
    assert 'friction 0.35 to 0.5: not sound' in found.summary()


def test_what_lacks_a_mass_must_be_carried_too():
    found = inspect_plan(plan_of([box(0, 0.5), box(0.6, 1.5), box(0, 3)], [10, 0, 0]))
    assert found.cause.tolist() == ['', '', 'unsupported', 'hangs']


def test_in_any_frame_the_answer_is_the_same():
    """All is moved and turned, and so is what the boxes feel."""
    import poses as pose_sets
    rng = np.random.default_rng(1)
    boxes = [box(-1, 0.5), box(1, 0.5), box(0, 1.05, PLANK), box(0.5, 1.6), box(2.2, 1.6)]
    plan = plan_of(boxes, [1, 2, 3, 4, 5])
    wanted = inspect_plan(plan, acceleration=(0.3 * G, 0, -G))
    for turn in pose_sets.unit_quaternions(rng, 5):
        moved = pose_sets.moved(plan.poses, rng.uniform(-5, 5, 3), turn[None])
        felt = pose_sets.moved(np.array([(0.3 * G, 0, -G, *LEVEL)]), np.zeros(3), turn[None])
        found = inspect_plan(Plan(plan.sizes, moved, plan.masses, ground=0),
                             acceleration=felt[0, :3])
        assert found.cause.tolist() == wanted.cause.tolist()
        assert found.load == pytest.approx(wanted.load, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize('field, value, words', [
    ('plan', 5, 'plan must be a Plan, not 5'),
    ('tolerance', -1.0, 'tolerance must be from 0 to 0.5 m'),
    ('tolerance', np.nan, 'tolerance must be from 0 to 0.5 m'),
    ('tolerance', 0.6, 'tolerance must be from 0 to 0.5 m'),
    ('friction', -0.1, 'friction must be 0 or more, and finite, not -0.1'),
    ('friction', np.inf, 'friction must be 0 or more'),
    ('acceleration', (0, 0, 0), 'acceleration must have a length'),
    ('acceleration', (0, 0, np.nan), 'acceleration must have a length'),
    ('acceleration', 9.81, r'acceleration must be a vector \(3,\)'),
    ('bears', 'edges', "bears must be 'faces' or 'corners', not 'edges'"),
    ('sides', 1, 'sides must be True or False, not 1')])
def test_bad_input_is_refused_with_field_and_value(field, value, words):
    arguments = {'plan': plan_of([box(0, 0.5)], [10]), field: value}
    with pytest.raises(ValueError, match=f'^{words}'):
        inspect_plan(**arguments)


def test_geometry_alone_needs_no_solver():
    """And with masses, its lack is one line that names the extra."""
    program = ('import sys\n'
               'sys.modules.update(clarabel=None, scipy=None, tqdm=None)\n'
               'from box_contact_ros import Plan, inspect_plan\n'
               'at = [(0, 0, 0, 0, 0, 0, 1), (0, 0, 1, 0, 0, 0, 1)]\n'
               'print(inspect_plan(Plan((1, 1, 1), at, ground=0)))\n'
               'inspect_plan(Plan((1, 1, 1), at, 1, ground=0))')
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True,
                          timeout=PATIENCE)
    assert done.stdout == '1 box: sound\n' and done.returncode == 1
    assert "'.[plans]'" in done.stderr and 'Traceback' not in done.stderr


def test_each_box_has_a_verdict_and_each_verdict_a_colour():
    boxes = [box(0, 1), box(0.9, 1), box(5, 6), box(-5, 0.4)]  # the last one is in the floor
    found = inspect_plan(plan_of(boxes, [1] * 4))
    assert found.verdicts.tolist() == ['ground', 'overlap', 'overlap', 'hangs', 'overlap']
    assert {*CAUSES, 'overlap', 'outside', 'step', 'way', 'ground', 'sound',
            'not judged'} == set(COLOURS)


def test_the_picture_has_the_legend_of_what_it_shows():
    pytest.importorskip('matplotlib')
    found = inspect_plan(plan_of([box(0, 0.5), box(0.6, 1.5)], [10, 10]))
    figure = found.plot()
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ['sound', 'unsupported']
    labels = [text.get_text() for text in figure.axes[0].texts]
    assert labels == ['2: unsupported\nshare 0.40, centre 100 mm outside']


def test_many_boxes_show_progress(monkeypatch, capsys):
    monkeypatch.setattr(sys.modules['box_contact_ros.plans.inspect_plan'], 'MANY', 1)
    assert inspect_plan(plan_of([box(0, 0.5), box(0, 1.5)], [10, 10])).sound
    assert 'loads' in capsys.readouterr().err


def test_a_box_that_hangs_and_carries_is_among_those_that_fall():
    """A plank on a pad and on a cube that hangs: one group, whose cube nothing carries."""
    found = inspect_plan(plan_of([box(-1, 0.5, PAD), box(1, 0.6, (0.2, 1, 0.8)),
                                  box(0, 1.05, PLANK)], [1, 1, 12]))
    assert found.cause.tolist() == ['', '', 'hangs', 'goes with what falls']


def test_what_takes_too_much_is_not_judged(monkeypatch):
    """A bridge, its pads and what stands on it; the tower beside them is judged."""
    monkeypatch.setattr('box_contact_ros.plans.statics.MOST_WORK', 0.0)
    bridge = [box(-1, 0.5, PAD), box(1, 0.5, PAD), box(0, 1.05, PLANK), box(0, 1.6)]
    plan = plan_of([*bridge, box(9, 0.5), box(9, 1.5)], 6 * [10.0])
    found = inspect_plan(plan)
    assert found.stands.tolist() == [True, *4 * [False], True, True]
    assert found.verdicts.tolist() == ['ground', *4 * ['not judged'], 'sound', 'sound']
    assert found.verdict == 'not all judged' and found.summary().endswith(
        'not all judged; what was read is sound, but 4 were not judged')
    assert np.isnan(found.load[1:3]).all() and found.load[5] == pytest.approx(10 * G)
    assert np.isnan([found.loaded_margin[3], found.pressure[1], *found.corner_loads[0]]).all()
    (fault,) = found.plan.faults
    assert fault.names == ('1', '2', '3', '4')
    # Certain, whatever the loads are: what nothing carries, and a top box that is off its base.
    found = inspect_plan(plan_of([*bridge[:3], box(2.2, 1.6, (1.5, 1, 1)), box(0, 9)], 5 * [10.0]))
    assert found.cause.tolist() == [*4 * [''], 'unsupported', 'hangs']
    assert found.verdict == 'not sound'
