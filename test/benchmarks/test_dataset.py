# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The paper's data: boxes that just touch where the label says, folded without changing that."""
from __future__ import annotations

import numpy as np
import oracle
import pytest
from poses import IDENTITY

from benchmarks.paper import dataset
from benchmarks.paper.dataset import GENERATORS, Placements
from benchmarks.paper.models import EXPERTS, to_octant
from benchmarks.pose_sets import CUBE
from box_contact_ros import ContactSolver
from box_contact_ros.solver.pose import rotation_matrix

pytestmark = pytest.mark.reports

COUNT = 4000
SMALL = (300, 200, 400)


def draw(kinds=GENERATORS, count=COUNT, seed=11) -> Placements:
    """`count` placements of every kind, one kind after the other."""
    rng = np.random.default_rng(seed)
    parts = [dataset.touching(rng, count, kind) for kind in kinds]
    return Placements(*(np.concatenate([getattr(part, name) for part in parts])
                        for name in ('inputs', 'point', 'normal')))


@pytest.fixture(scope='module')
def placements() -> Placements:
    return draw()


def in_second_box(placements: Placements) -> np.ndarray:
    """Return the impact points (n, 3) in the second box's frame."""
    turn = rotation_matrix(placements.pose[:, 3:])
    return np.einsum('nji,nj->ni', turn, placements.point - placements.pose[:, :3])


# --- placements -----------------------------------------------------------------------------------


def test_points_lie_on_both_trihedra(placements: Placements) -> None:
    """On a face +x, +y or +z of the first box and a face −x, −y or −z of the second."""
    for point, side in ((placements.point, 1.0), (in_second_box(placements), -1.0)):
        relative = side * point
        assert np.all(np.abs(relative) <= 1.0 + 1e-12)
        assert np.all(np.abs(relative.max(axis=1) - 1.0) <= 1e-12)


def test_every_face_vertex_and_edge_occurs() -> None:
    """3 faces, 7 vertices; 9 edges of either trihedron, and no other."""
    corners = np.round(in_second_box(draw(kinds=GENERATORS[:1])))
    assert len(np.unique(corners, axis=0)) == 7
    assert not np.any(np.all(corners == 1.0, axis=1))
    crossing = draw(kinds=GENERATORS[1:])
    for point in (crossing.point, in_second_box(crossing)):
        on_edge = np.where(np.abs(np.abs(point) - 1.0) < 1e-12, np.sign(point), 0.0)
        assert len(np.unique(on_edge, axis=0)) == 9
        assert np.all(np.count_nonzero(on_edge, axis=1) == 2)


def test_placements_against_the_oracle() -> None:
    """In 60 digits: the same separation and normal, for both kinds."""
    some, a = draw(count=20), oracle.make_box(IDENTITY, CUBE)
    for pose, normal in zip(some.pose, some.normal):
        gaps = oracle.axis_gaps(a, oracle.make_box(pose, CUBE))
        _, axis, gap = max(gaps, key=lambda entry: entry[2])
        assert abs(float(gap)) <= 1e-14 * max(CUBE)
        assert float(np.dot(oracle.as_array(axis), normal)) == pytest.approx(1.0, abs=1e-12)


def test_impact_point_is_what_the_solver_calls_the_point(placements: Placements) -> None:
    """Model `exact`: the centroid of the overlap when pressed in by 1e-9 of the size.

    Where features are nearly parallel the overlap grows along them, so 1 % may be farther off.
    """
    solver = ContactSolver(CUBE, CUBE, model='exact')
    found = solver.batch(np.tile(IDENTITY, (len(placements), 1)), placements.pose)
    touch = found.colliding
    assert touch.mean() > 0.9  # the rest is apart by its rounding
    off = np.linalg.norm(found.point - placements.point, axis=1)[touch] / max(CUBE)
    assert np.quantile(off, 0.99) < 1e-6


@pytest.mark.parametrize('kind', GENERATORS)
def test_placements_as_written_interpenetrate(kind) -> None:
    """As the paper writes it: some are deep; the point is on both cubes; no normal is missing."""
    kept = dataset.touching(np.random.default_rng(2), COUNT, kind, as_written=True)
    assert (dataset.query(kept).separation < -0.1).mean() > 0.3
    assert np.isfinite(kept.normal).all()
    for point in (kept.point, in_second_box(kept)):
        assert np.all(np.abs(point).max(axis=1) <= 1.0 + 1e-12)


def test_a_mixture_has_its_share_of_each_kind() -> None:
    """Of placements as written some do not interpenetrate, so fewer than the share are deep."""
    def deep(**how) -> float:
        some = dataset.mixed(np.random.default_rng(3), COUNT, **how)
        assert len(some) == COUNT
        return float((dataset.query(some).separation < -1e-9).mean())

    assert deep() == 0.0
    assert deep(kept=0.3) == pytest.approx(0.3 * deep(kept=1.0), abs=0.02)


def test_faces_lie_on_faces() -> None:
    """Tilted by up to TILT, they touch; the point is the middle of the overlap, on both faces."""
    laid = dataset.touching(np.random.default_rng(2), 500, dataset.face_face_candidates)
    assert np.abs(dataset.query(laid).separation).max() < 1e-12
    turn = rotation_matrix(laid.pose[:, 3:])
    level = np.abs(np.einsum('nij,ni->nj', turn, laid.normal)).max(axis=1)
    assert level.min() > np.cos(dataset.TILT) - 1e-9
    assert np.sum(laid.point * laid.normal, axis=1) == pytest.approx(np.ones(500))
    assert np.abs(in_second_box(laid)).max() < 1.0 + 3 * dataset.TILT
    a, b = dataset.as_poses(laid.inputs)
    b[:, :3] -= 0.1 * laid.normal  # deeper than the tilt reaches
    middle = ContactSolver(CUBE, CUBE, model='exact').batch(a, b).point
    across = np.linalg.norm(np.where(laid.normal == 1.0, 0.0, middle - laid.point), axis=1)
    assert np.quantile(across, 0.9) < 0.1


def test_a_committee_shares_out_the_classes() -> None:
    """Each expert has its class alone; the classifier a third of each, and none of an expert's."""
    sets = dataset.committee(5, counts=(300, 30, 30))
    classes = sets.pop('classifier')['training']
    assert tuple(sets) == EXPERTS
    assert np.array_equal(classes.outputs.sum(axis=0), [100, 100, 100])
    assert set(np.unique(classes.outputs)) == {0.0, 1.0}
    for kind, (name, expert) in enumerate(sets.items()):
        assert len(expert['training']) == 300, name
        known = {row.tobytes() for row in expert['training'].inputs}
        own = classes.inputs[classes.outputs[:, kind] == 1.0]
        assert not any(row.tobytes() in known for row in own)


# --- folding --------------------------------------------------------------------------------------


def direction(angles: np.ndarray) -> np.ndarray:
    """Return unit vectors (n, 3) of azimuth and elevation (n, 2)."""
    azimuth, elevation = angles.T
    return np.column_stack([np.cos(elevation) * np.cos(azimuth),
                            np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


@pytest.mark.parametrize('is_folded', [False, True])
def test_folded_boxes_touch_where_the_folded_label_says(is_folded: bool,
                                                        placements: Placements) -> None:
    """What a network is taught is a touching pose with its right answer."""
    patterns = (dataset.folded if is_folded else dataset.as_drawn)(placements)
    folds = to_octant(placements.inputs[:, :3], placements.rotation)
    again = Placements(patterns.inputs, *(folds.folded(part) if is_folded else part
                                          for part in (placements.point, placements.normal)))
    sat = dataset.query(again)
    assert np.abs(sat.separation).max() < 1e-11
    assert np.sum(sat.normal * again.normal, axis=1).min() > 1.0 - 1e-9
    for point in (again.point, in_second_box(again)):
        np.testing.assert_allclose(np.abs(point).max(axis=1), 1.0, atol=1e-11)
    assert np.all(again.point.max(axis=1) > 1.0 - 1e-12)  # on a face +x, +y or +z
    length = np.linalg.norm(again.point, axis=1, keepdims=True)
    np.testing.assert_allclose(direction(patterns.outputs[:, :2]) * length, again.point,
                               atol=1e-12)
    np.testing.assert_allclose(direction(patterns.outputs[:, 2:]), again.normal, atol=1e-12)
    if is_folded:  # twice is back
        np.testing.assert_array_equal(folds.folded(again.point), placements.point)
        assert (patterns.inputs[:, :3] >= 0.0).all()
        assert (np.abs(patterns.inputs[:, 3:]) <= 0.5 * np.pi + 1e-12).all()


# --- sets -----------------------------------------------------------------------------------------


def all_inputs(sets: dict[str, dataset.Patterns]) -> np.ndarray:
    return np.concatenate([patterns.inputs for patterns in sets.values()])


@pytest.mark.reports
def test_paper_sets() -> None:
    """The paper's sizes, all patterns distinct, outputs within the paper's ranges."""
    sets = dataset.paper(1)
    assert {name: len(patterns) for name, patterns in sets.items()} == {
        'training': 8000, 'cross-validation': 5000, 'external': 75000}
    assert len(np.unique(all_inputs(sets), axis=0)) == 88000
    for patterns in sets.values():
        assert np.all(np.abs(patterns.outputs) <= np.pi * np.array([1.0, 0.5, 1.0, 0.5]) + 1e-12)


def test_sets_by_signs_have_the_signs_of_their_names() -> None:
    made = dataset.by_signs(1, counts=SMALL, kept=0.5)
    assert len(made) == 8
    for signs, sets in made.items():
        assert [len(sets[name]) for name in dataset.SETS] == list(SMALL)
        wanted = [1.0 if sign == '+' else -1.0 for sign in signs]
        assert np.all(np.sign(all_inputs(sets)[:, 3:]) == wanted)


@pytest.mark.reports
def test_sets_come_from_the_seed_alone() -> None:
    """Again the same; another seed, nothing in common."""
    for make in (lambda *a, **k: {'paper': dataset.paper(*a, **k)},
                 dataset.by_signs):
        first, again = make(7, counts=SMALL), make(7, counts=SMALL)
        other = make(8, counts=SMALL)
        for subset, sets in first.items():
            for name, patterns in sets.items():
                np.testing.assert_array_equal(patterns.inputs, again[subset][name].inputs)
                np.testing.assert_array_equal(patterns.outputs, again[subset][name].outputs)
            both = np.concatenate([all_inputs(sets), all_inputs(other[subset])])
            assert len(np.unique(both, axis=0)) == len(both)
