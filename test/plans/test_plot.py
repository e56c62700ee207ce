# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of a plan: what covers what, which boxes are drawn, and their labels."""
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('matplotlib')
pytest.importorskip('clarabel')

from box_contact_ros import Plan, contacts_of, inspect_plan, read_plan
from box_contact_ros.plans import plot
from box_contact_ros.solver.pose import rotation_matrix

FILES = Path(__file__).resolve().parents[2] / 'docs' / 'examples'


def depth_at(size, pose, point):
    """Return how near to the viewer a box is at a point of the picture; None: it is not there."""
    axes = rotation_matrix(pose[None, 3:])[0]
    start = axes.T @ (point[0] * plot.RIGHT + point[1] * plot.UP - pose[:3])
    along = axes.T @ (plot.VIEWER / np.linalg.norm(plot.VIEWER))
    ends = np.sort(np.stack(((-size / 2 - start) / along, (size / 2 - start) / along)), axis=0)
    near, far = ends[0].max(), ends[1].min()
    return far if near < far else None


@pytest.mark.parametrize('seed', range(4))
def test_what_covers_another_box_is_drawn_after_it(seed):
    """By rays to the viewer through random points of the picture; upright boxes that are apart."""
    rng = np.random.default_rng(seed)
    sizes = rng.permuted(np.tile([4.0, 1.0, 0.3], (60, 1)), axis=1)
    poses = np.hstack((rng.uniform(-3, 3, (60, 3)), np.tile([0, 0, 0, 1], (60, 1))))
    poses[:, 6], poses[:, 5] = rng.uniform(-1, 1, (2, 60))  # turned about z
    pairs, _ = contacts_of(sizes, poses)
    apart = np.setdiff1d(np.arange(60), pairs[:, 1])
    sizes, poses = sizes[apart], poses[apart]
    faces = plot._faces(sizes, poses)[0]
    place = np.argsort(plot._from_behind(sizes, poses, faces))
    compared = 0
    for point in rng.uniform(faces.min(axis=(0, 1, 2)), faces.max(axis=(0, 1, 2)), (600, 2)):
        hit = {box: depth for box in range(len(sizes))
               if (depth := depth_at(sizes[box], poses[box], point)) is not None}
        order = sorted(hit, key=lambda box: place[box])
        assert order == sorted(hit, key=hit.__getitem__)
        compared += len(hit) > 1
    assert compared > 15


def test_a_stack_is_drawn_from_below():
    """By the depth of their centres the long box would cover the one that stands on its end."""
    sizes = np.array([[6.0, 1.0, 1.0], [1.0, 1.0, 1.0]])
    poses = np.array([[0, 0, 0.5, 0, 0, 0, 1], [-2.5, 0, 1.5, 0, 0, 0, 1.0]])
    assert (poses[:, :3] @ plot.VIEWER)[0] > (poses[:, :3] @ plot.VIEWER)[1]
    assert plot._from_behind(sizes, poses, plot._faces(sizes, poses)[0]).tolist() == [0, 1]


def test_a_pallet_is_drawn_whole_with_its_faults():
    figure = inspect_plan(read_plan(FILES / 'files' / 'pallet.csv')).plot()
    axes, = figure.axes
    assert {text.get_text() for text in axes.texts} == {
        'salt: unsupported\nshare 0.37, centre 50 mm outside', 'crisps: overloaded\n18 kg on top'}
    faces, = axes.collections
    assert len(faces.get_paths()) == 3 * 7
    corners = np.concatenate([path.vertices for path in faces.get_paths()])
    low, high = zip(axes.get_xlim(), axes.get_ylim())
    assert (corners > low).all() and (corners < high).all()


def test_the_worst_of_many_have_labels():
    figure = inspect_plan(read_plan(FILES / 'pallets' / 'packing_plans.json')).plot()
    assert len(figure.axes[0].texts) == plot.MOST_LABELS
    assert len(figure.axes[0].collections[0].get_paths()) == 3 * 189  # no floor of ten metres


def test_boxes_in_each_other_have_no_order():
    """A ring of overlaps is drawn by depth."""
    poses = np.array([[x, 0, 0, 0, 0, 0, 1.0] for x in (0.0, 0.1, 0.2)])
    figure = inspect_plan(Plan((1, 1, 1), poses)).plot()
    assert len(figure.axes[0].collections[0].get_paths()) == 9
