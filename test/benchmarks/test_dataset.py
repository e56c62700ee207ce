# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The paper's data: boxes that just touch where the label says, folded without changing that."""
from __future__ import annotations

import numpy as np
import oracle
import pytest
from poses import IDENTITY

from benchmarks.paper import dataset
from benchmarks.paper.dataset import (
    FEATURES,
    GENERATORS,
    NO_FOLD,
    OCTANT,
    Placements,
)
from benchmarks.paper.features import to_features, to_octant
from benchmarks.paper.models import EXPERTS, SUBSETS
from benchmarks.pose_sets import CONTAINER, CUBE
from box_contact_ros import ContactSolver
from box_contact_ros.solver.paper import TouchingPairs
from box_contact_ros.solver.pose import rotation_matrix

COUNT = 4000
SMALL = (300, 200, 400)


def draw(size=CUBE, kinds=GENERATORS, count=COUNT, seed=11) -> Placements:
    """`count` placements of every kind, one kind after the other."""
    rng = np.random.default_rng(seed)
    parts = [dataset.touching(rng, count, size, kind) for kind in kinds]
    return Placements(parts[0].size, *(np.concatenate([getattr(part, name) for part in parts])
                                       for name in ('inputs', 'point', 'normal')))


@pytest.fixture(scope='module', params=[CUBE, CONTAINER], ids=['cube', 'container'])
def placements(request: pytest.FixtureRequest) -> Placements:
    return draw(request.param)


@pytest.fixture(scope='module')
def cubes() -> Placements:
    return draw()


def in_second_box(placements: Placements) -> np.ndarray:
    """Return the impact points (n, 3) in the second box's frame."""
    turn = rotation_matrix(placements.pose[:, 3:])
    return np.einsum('nji,nj->ni', turn, placements.point - placements.pose[:, :3])


# --- placements -----------------------------------------------------------------------------------


def test_points_lie_on_both_trihedra(placements: Placements) -> None:
    """On a face +x, +y or +z of the first box and a face −x, −y or −z of the second."""
    half = 0.5 * np.array(placements.size)
    for point, side in ((placements.point, 1.0), (in_second_box(placements), -1.0)):
        relative = side * point / half
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
    """In 60 digits: the same separation and normal, for both kinds and both sizes."""
    for size in (CUBE, CONTAINER):
        some = draw(size, count=20)
        a = oracle.make_box(IDENTITY, size)
        for pose, normal in zip(some.pose, some.normal):
            gaps = oracle.axis_gaps(a, oracle.make_box(pose, size))
            _, axis, gap = max(gaps, key=lambda entry: entry[2])
            assert abs(float(gap)) <= 1e-14 * max(size)
            assert float(np.dot(oracle.as_array(axis), normal)) == pytest.approx(1.0, abs=1e-12)


def test_impact_point_is_what_the_solver_calls_the_point(placements: Placements) -> None:
    """Model `exact`: the centroid of the overlap when pressed in by 1e-9 of the size.

    Where features are nearly parallel the overlap grows along them, so 1 % may be farther off.
    """
    solver = ContactSolver(placements.size, placements.size, model='exact')
    found = solver.batch(np.tile(IDENTITY, (len(placements), 1)), placements.pose)
    touch = found.colliding
    assert touch.mean() > 0.9  # the rest is apart by its rounding
    off = np.linalg.norm(found.point - placements.point, axis=1)[touch] / max(placements.size)
    assert np.quantile(off, 0.99) < 1e-6


@pytest.mark.parametrize('kind', GENERATORS)
def test_placements_as_written_interpenetrate(kind) -> None:
    """As the paper writes it: some are deep; the point is on both cubes; no normal is missing."""
    kept = dataset.touching(np.random.default_rng(2), COUNT, CUBE, kind, as_written=True)
    assert (dataset.query(kept).separation < -0.1).mean() > 0.3
    assert np.isfinite(kept.normal).all()
    for point in (kept.point, in_second_box(kept)):
        assert np.all(np.abs(point).max(axis=1) <= 1.0 + 1e-12)


def test_a_mixture_has_its_share_of_each_kind() -> None:
    """Of placements as written some do not interpenetrate, so fewer than the share are deep."""
    def deep(**how) -> float:
        some = dataset.mixed(np.random.default_rng(3), COUNT, CUBE, **how)
        assert len(some) == COUNT
        return float((dataset.query(some).separation < -1e-9).mean())

    assert deep() == 0.0
    assert deep(kept=0.3) == pytest.approx(0.3 * deep(kept=1.0), abs=0.02)


def test_faces_lie_on_faces() -> None:
    """Tilted by up to TILT, they touch; the point is the middle of the overlap, on both faces."""
    laid = dataset.touching(np.random.default_rng(2), 500, CUBE, dataset.face_face_candidates)
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


@pytest.mark.parametrize('how', [NO_FOLD, OCTANT, FEATURES])
def test_folded_boxes_touch_where_the_folded_label_says(how: str, cubes: Placements) -> None:
    """What a network is taught is a touching pose with its right answer."""
    result = dataset.fold(cubes, how)
    patterns = result.patterns()
    again = Placements(CUBE, patterns.inputs, result.point, result.normal)
    sat = dataset.query(again)
    assert np.abs(sat.separation).max() < 1e-11
    assert np.sum(sat.normal * again.normal, axis=1).min() > 1.0 - 1e-9
    for point in (result.point, in_second_box(again)):
        np.testing.assert_allclose(np.abs(point).max(axis=1), 1.0, atol=1e-11)
    assert np.all(result.point.max(axis=1) > 1.0 - 1e-12)  # on a face +x, +y or +z
    length = np.linalg.norm(result.point, axis=1, keepdims=True)
    np.testing.assert_allclose(direction(patterns.outputs[:, :2]) * length, result.point,
                               atol=1e-12)
    np.testing.assert_allclose(direction(patterns.outputs[:, 2:]), result.normal, atol=1e-12)


def test_reference_features(cubes: Placements) -> None:
    """vertex_face: on face +x. edge_edge: on the edge along z at (+, +); normals across."""
    result = dataset.fold(cubes, FEATURES)
    face = result.subset == SUBSETS['vertex_face']
    np.testing.assert_array_equal(result.normal[face], np.tile([1.0, 0.0, 0.0], (face.sum(), 1)))
    np.testing.assert_allclose(result.point[face, 0], 1.0, atol=1e-12)
    assert np.all(np.abs(result.point[~face, :2] - 1.0) < 1e-12)
    n = result.normal[~face]
    assert np.all(np.abs(n[:, 2]) < 1e-12) and np.all(n[:, 0] >= n[:, 1] - 1e-12)
    assert np.all(n[:, 1] >= -1e-12)


def test_labels_unfold(cubes: Placements) -> None:
    """Label → folded → unfolded is the label, by the maps that the solver uses."""
    sat = dataset.query(cubes)
    results = {how: dataset.fold(cubes, how) for how in (OCTANT, FEATURES)}
    for how, result in results.items():
        pairs = TouchingPairs(sat.axis < 0, sat.axis, sat.normal, cubes.inputs[:, :3],
                              cubes.rotation)
        folds = to_octant(*pairs[3:]) if how == OCTANT else to_features(pairs)[0]
        for found, label in ((result.point, cubes.point), (result.normal, cubes.normal)):
            np.testing.assert_allclose(folds.unfolded(found), label, rtol=0, atol=1e-15)
            np.testing.assert_allclose(folds.folded(label), found, rtol=0, atol=1e-15)
        np.testing.assert_array_equal(folds.offset, result.inputs[:, :3])
        turn = rotation_matrix(dataset.as_poses(result.inputs)[1][:, 3:])
        np.testing.assert_allclose(folds.rotation, turn, atol=1e-12)


# --- subsets --------------------------------------------------------------------------------------


def test_subset_depends_on_the_pose_only(cubes: Placements) -> None:
    """The same poses with other labels, or in another order, fall in the same subsets."""
    result = dataset.fold(cubes, FEATURES)
    rng = np.random.default_rng(0)
    order = rng.permutation(len(cubes))
    blind = dataset.fold(Placements(CUBE, cubes.inputs[order], np.full_like(cubes.point, np.nan),
                                    rng.normal(size=cubes.normal.shape)), FEATURES)
    np.testing.assert_array_equal(blind.subset, result.subset[order])
    np.testing.assert_array_equal(blind.inputs, result.inputs[order])


def test_subset_is_what_the_oracle_says() -> None:
    """A face axis of the first box wins, or an edge pair, in 60 digits."""
    some = draw(count=20, seed=5)
    subset = dataset.fold(some, FEATURES).subset
    assert set(subset) == {0, 1}
    a = oracle.make_box(IDENTITY, CUBE)
    for pose, number in zip(some.pose, subset):
        gaps = oracle.axis_gaps(a, oracle.make_box(pose, CUBE))
        axis = max(gaps, key=lambda entry: entry[2])[0]
        assert (axis < 3) == (number == SUBSETS['vertex_face'])
        assert axis < 3 or axis >= 6


def test_features_are_for_cubes() -> None:
    with pytest.raises(ValueError, match='for cubes, not for'):
        dataset.fold(draw(CONTAINER, count=5), FEATURES)


# --- sets -----------------------------------------------------------------------------------------


def all_inputs(sets: dict[str, dataset.Patterns]) -> np.ndarray:
    return np.concatenate([patterns.inputs for patterns in sets.values()])


def test_paper_sets() -> None:
    """The paper's sizes, all patterns distinct, outputs within the paper's ranges."""
    sets = dataset.paper(1)
    assert {name: len(patterns) for name, patterns in sets.items()} == {
        'training': 8000, 'cross-validation': 5000, 'external': 75000}
    assert len(np.unique(all_inputs(sets), axis=0)) == 88000
    for patterns in sets.values():
        assert np.all(np.abs(patterns.outputs) <= np.pi * np.array([1.0, 0.5, 1.0, 0.5]) + 1e-12)


def test_continuous_sets() -> None:
    """The paper's sizes per subset, all patterns distinct."""
    made = dataset.by_subset(1, FEATURES)
    assert set(made) == {'vertex_face', 'edge_edge'}
    for sets in made.values():
        assert [len(sets[name]) for name in dataset.SETS] == [10000, 6000, 50000]
        assert len(np.unique(all_inputs(sets), axis=0)) == 66000


def test_sets_by_signs_have_the_signs_of_their_names() -> None:
    made = dataset.by_subset(1, NO_FOLD, counts=SMALL, kept=0.5)
    assert len(made) == 8
    for signs, sets in made.items():
        assert [len(sets[name]) for name in dataset.SETS] == list(SMALL)
        wanted = [1.0 if sign == '+' else -1.0 for sign in signs]
        assert np.all(np.sign(all_inputs(sets)[:, 3:]) == wanted)


def test_sets_come_from_the_seed_alone() -> None:
    """Again the same; each set without the others; another seed, nothing in common."""
    for make in (lambda *a, **k: {'paper': dataset.paper(*a, **k)},
                 lambda seed, **k: dataset.by_subset(seed, FEATURES, **k)):
        first, again = make(7, counts=SMALL), make(7, counts=SMALL)
        alone = make(7, counts=SMALL, sets=('external',))
        other = make(8, counts=SMALL)
        for subset, sets in first.items():
            assert list(alone[subset]) == ['external']
            np.testing.assert_array_equal(sets['external'].inputs,
                                          alone[subset]['external'].inputs)
            for name, patterns in sets.items():
                np.testing.assert_array_equal(patterns.inputs, again[subset][name].inputs)
                np.testing.assert_array_equal(patterns.outputs, again[subset][name].outputs)
            both = np.concatenate([all_inputs(sets), all_inputs(other[subset])])
            assert len(np.unique(both, axis=0)) == len(both)
