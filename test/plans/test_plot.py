# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of a plan: what covers what, which boxes are drawn, and their labels."""
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('matplotlib')
pytest.importorskip('clarabel')

from matplotlib.backends.backend_agg import FigureCanvasAgg

from box_contact_ros import Plan, contacts_of, inspect_plan, read_plan
from box_contact_ros.plans import plot
from box_contact_ros.solver.pose import rotation_matrix

FILES = Path(__file__).resolve().parents[2] / 'docs' / 'examples'


def depth_at(size, pose, point, view):
    """Return how near to the viewer a box is at a point of the picture; None: it is not there."""
    axes = rotation_matrix(pose[None, 3:])[0]
    start = axes.T @ (point @ plot.edges_of(view.viewer) - pose[:3])
    along = axes.T @ (view.viewer / np.linalg.norm(view.viewer))
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
    view = plot.view_from(plot.CORNERS[seed], sizes, poses)
    place = np.argsort(plot._from_behind(sizes, poses, view))
    faces = view.faces
    compared = 0
    for point in rng.uniform(faces.min(axis=(0, 1, 2)), faces.max(axis=(0, 1, 2)), (600, 2)):
        hit = {box: depth for box in range(len(sizes))
               if (depth := depth_at(sizes[box], poses[box], point, view)) is not None}
        order = sorted(hit, key=lambda box: place[box])
        assert order == sorted(hit, key=hit.__getitem__)
        compared += len(hit) > 1
    assert compared > 15


def test_a_stack_is_drawn_from_below():
    """By the depth of their centres the long box would cover the one that stands on its end."""
    sizes = np.array([[6.0, 1.0, 1.0], [1.0, 1.0, 1.0]])
    poses = np.array([[0, 0, 0.5, 0, 0, 0, 1], [-2.5, 0, 1.5, 0, 0, 0, 1.0]])
    view = plot.view_from(plot.CORNERS[0], sizes, poses)
    assert (poses[:, :3] @ view.viewer)[0] > (poses[:, :3] @ view.viewer)[1]
    assert plot._from_behind(sizes, poses, view).tolist() == [0, 1]


def test_a_pallet_is_drawn_whole_with_its_faults():
    figure = inspect_plan(read_plan(FILES / 'files' / 'pallet.csv')).plot()
    axes, = figure.axes
    assert {text.get_text() for text in axes.texts} == {
        'salt: unsupported\nshare 0.37, centre 50 mm outside', 'crisps: overloaded\n18 kg on top'}
    faces, dashed = axes.collections
    assert not dashed.get_paths()
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


def shown(figure):
    """Return the pixels of a figure (h, w, 3), and where each line of a label ends, by its text."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3].astype(int)
    axes, = figure.axes
    ends = {text.get_text(): axes.transData.transform(text.xy) for text in axes.texts}
    return pixels, {text: (int(pixels.shape[0] - y), int(x)) for text, (x, y) in ends.items()}


def in_colour(pixels, verdict):
    """Return which pixels have the colour of a verdict, in one of its shades."""
    colour = np.array(list(bytes.fromhex(plot.COLOURS[verdict][1:])))
    return np.any([np.abs(pixels - shade * colour).max(axis=-1) < 4 for shade in plot.SHADES],
                  axis=0)


def pallet_of_30():
    """Return cartons of which one hangs, one overlaps, one tips and one is overloaded."""
    places = [(.2 + .4 * x, .2 + .4 * y, .125 + .25 * z) for z in range(5) for x in range(3)
              for y in range(2)]
    places[29] = (1.25, .6, 1.125)  # beyond the edge
    places[7] = (.2, .65, .375)
    names = [f'carton {n}' for n in range(30)]
    names[29] = 'a carton with a name that has fifty characters, so'
    limits = [np.inf] * 31
    limits[0] = 20
    return Plan([(.4, .4, .25)] * 30 + [(.4, .4, .25), (9, 9, 1)][1:],
                [(*place, 0, 0, 0, 1) for place in [*places, (0, 0, -.5)]], [10] * 30 + [0],
                ground=30, names=[*names, 'ground'], limits=limits)


@pytest.mark.parametrize('make', [pallet_of_30, lambda: read_plan(FILES / 'files' / 'ship.edi'),
                                  lambda: read_plan(FILES / 'files' / 'semitrailer.csv')])
def test_a_line_ends_on_its_box_where_it_is_seen(make):
    """In pixels; a faulty box of the ship was behind a sound one, on which its line ended."""
    plan = make()
    found = inspect_plan(plan, bears='corners' if 'ship' in plan.names else 'faces')
    figure = found.plot()
    pixels, ends = shown(figure)
    verdicts = dict(zip(plan.names, found.verdicts))
    assert ends
    for text, (row, column) in ends.items():
        name = text.partition(':')[0]
        verdict = next(word for box, word in verdicts.items() if plot.shortened(box) == name)
        near = in_colour(pixels[row - 6:row + 7, column - 6:column + 7], verdict)
        dashed = figure.axes[0].collections[1].get_paths()
        assert near.sum() > 20 or dashed, text
        assert in_colour(pixels, verdict).sum() > 100


def test_the_corner_is_the_one_that_shows_the_fault():
    """A box that falls behind a wall of sound ones, from each of the four corners."""
    wall = [((4, .2, 3), (0, 0, 1.5)), ((.2, 4, 3), (0, 0, 1.5))]
    views = set()
    for x in (-1.5, 1.5):
        for y in (-1.5, 1.5):
            sizes, places = zip(*wall[:1], ((.5, .5, .5), (x, y, 1)), ((9, 9, 1), (0, 0, -.5)))
            found = inspect_plan(Plan(sizes, [(*place, 0, 0, 0, 1) for place in places],
                                      ground=2))
            pixels, _ = shown(found.plot())
            views.add(in_colour(pixels, 'hangs').sum() > 400)
    assert views == {True}


def test_what_is_hidden_is_drawn_through():
    sizes = [(.5, .5, .5), *[(3, .2, 3), (.2, 3, 3)] * 2, (3, 3, .2), (9, 9, 1)]
    places = [(0, 0, 1), (0, 1.6, 1.5), (1.6, 0, 1.5), (0, -1.6, 1.5), (-1.6, 0, 1.5), (0, 0, 3.1),
              (0, 0, -.5)]
    found = inspect_plan(Plan(sizes, [(*place, 0, 0, 0, 1) for place in places], ground=6))
    _, dashed = found.plot().axes[0].collections
    assert len(dashed.get_paths()) == 3 and found.verdicts[0] == 'hangs'


def test_text_of_any_name_is_within_the_picture():
    """Neither a formula nor a bad one, and 50 characters do not make the boxes small."""
    names = ['$x^2$ $\\frac{1}{2}', '$\\bad{$', 'n' * 50, 'ground']
    places = [(0, 0, 2), (3, 0, 2), (6, 0, 2), (0, 0, -.5)]
    found = inspect_plan(Plan([(1, 1, 1)] * 3 + [(20, 20, 1)], [
        (*place, 0, 0, 0, 1) for place in places], ground=3, names=names))
    figure = found.plot()
    FigureCanvasAgg(figure).draw()
    width, height = figure.canvas.get_width_height()
    for text in (*figure.axes[0].texts, *figure.texts):
        box = text.get_window_extent()
        assert 0 <= box.x0 and box.x1 <= width and 0 <= box.y0 and box.y1 <= height, text
    assert figure.get_suptitle() == '3 of 3 boxes have a fault: hangs: 3'
    pixels, _ = shown(figure)
    assert in_colour(pixels, 'hangs').sum() > 3000


TO_LINEAR = np.array([[0.31399, 0.63951, 0.04650], [0.15537, 0.75789, 0.08670],
                      [0.01775, 0.10944, 0.87256]])
"""From linear RGB to what the three kinds of cones see (Hunt, Pointer and Estevez)."""
BLIND = {'protan': np.array([[0, 1.05118, -0.05116], [0, 1, 0], [0, 0, 1]]),
         'deutan': np.array([[1, 0, 0], [0.9513, 0, 0.04866], [0, 0, 1]]), 'none': np.eye(3)}


@pytest.mark.parametrize('kind', BLIND)
def test_colours_differ_for_who_sees_no_red(kind):
    """Those of faults, from each other and from sound ones, by a tenth of white at least."""
    colours = {verdict: np.array(list(bytes.fromhex(colour[1:]))) / 255
               for verdict, colour in plot.COLOURS.items() if verdict not in ('ground',)}
    back = np.linalg.inv(TO_LINEAR)
    seen = {verdict: np.clip(back @ BLIND[kind] @ TO_LINEAR @ colour**2.2, 0, 1)**(1 / 2.2)
            for verdict, colour in colours.items()}
    close = [(a, b, round(float(np.linalg.norm(seen[a] - seen[b])), 2)) for a in seen for b in seen
             if a < b and np.linalg.norm(seen[a] - seen[b]) < 0.13]
    assert close == []
