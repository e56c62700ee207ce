# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The committee of the source paper's section 7: errors of its models by kind of contact."""
from __future__ import annotations

import numpy as np

from box_contact_ros.solver.weights_file import load_weights

from .. import output
from ..contestant import Contestant, ours
from ..errors import degrees_between, distances
from ..pose_sets import CUBE, Pairs
from . import dataset
from .dataset import Placements
from .models import EXPERTS, committee, weights_path

COUNT = 20_000  # placements of each kind
SEED = 37  # other placements than any training's
PRESSED = 1e-9  # by which they are made to overlap, so that rounding parts none [m]


def placements(step: int) -> dict[str, Placements]:
    """Return placements by kind of contact, new ones for every network."""
    rng = np.random.default_rng(SEED)
    kinds = zip(EXPERTS, (*dataset.GENERATORS, dataset.face_face_candidates))
    return {kind: dataset.touching(rng, COUNT // step, candidates)
            for kind, candidates in kinds}


def errors(model: Contestant, some: Placements) -> tuple[float, float]:
    """Return the mean error of the point [mm] and of the normal [deg] against the labels."""
    a, b = dataset.as_poses(some.inputs)
    b[:, :3] -= PRESSED * dataset.query(some).normal
    sizes = np.tile(CUBE, (len(a), 1))
    found = model.solve(Pairs(a, b, sizes, sizes))
    return (1e3 * float(distances(found.point, some.point).mean()),
            float(degrees_between(found.normal, some.normal).mean()))


def section(step: int) -> str:
    """Return the section: errors by model and kind, and how often the classifier is wrong."""
    kinds = placements(step)
    rows = []
    for model in (ours('paper'), ours(committee(), name='paper-committee')):
        row: list[object] = [f'`{model.name}`']
        for some in kinds.values():
            point, normal = errors(model, some)
            row += [f'{point:.0f}', f'{normal:.1f}']
        rows.append(row)
    head = [f'{kind}: {what}' for kind in kinds for what in ('point [mm]', 'normal [°]')]
    card = load_weights(weights_path('paper-committee')).card
    return output.page('benchmarks/paper/pages/committee', table=output.markdown_table(
        ['', *head], rows), wrong=100 * card['metrics']['classifier']['external']['wrong'],
        count=COUNT // step)
