"""Model `mlp`: SAT decides and gives normal and depth exactly; a network gives the point.

Stages of a block of pairs, each a loop without branches over structures of arrays:

1. `load_block`, `query_block`: verdict, separation, axis (`pose`, `sat`).
2. `press`: pairs shallower than DEPTH_FLOOR are pressed in, as the point's definition says.
3. `outline_block`: the exact bounding box of A∩B, in the frame of one of the boxes, and a point
   inside (`outline`).
4. `centroid_block`: a network says where in this bounding box the centroid is (`sites`).
5. `place_block`: the answer is cut to where a centroid can be (that of a convex body lies in the
   middle half of its bounding box: Bonnesen and Fenchel 1934, §34), and the way there from the
   inside point is shortened where it would leave the other box. It starts inside A∩B, so it ends in
   both boxes, whatever the network says.

Outside the range that the network was trained for (ASPECT_MAX, RATIO_MAX, DEPTH_MAX) the answer is
the exact one, and counted. So it is for boxes that the card of the weights does not list, if it
lists any: those of a scene (`train --scene`).
"""
from __future__ import annotations

import numpy as np

from .block import (
    CENTROID,
    EXACT_ANSWERS,
    HALF,
    HALF_A,
    HALF_B,
    IN_B,
    IN_RANGE,
    INSIDE,
    LANES,
    MIDDLE,
    NORMALS,
    OFFSET_A,
    OFFSETS,
    OTHER,
    POINT,
    ROTATION,
    SEPARATION,
    SIZE,
    TOUCH,
    new_work,
)
from .contact import (
    APART,
    REFUSED,
    TOUCHING,
    Contacts,
    to_common_frame,
    write_apart,
    write_faults,
    write_found,
    write_nothing,
    write_one,
)
from .exact import solve_exact
from .jit import inlined, kernel
from .network import Weights, WeightsError, load_weights
from .outline import (
    outline_block,
)
from .overlap import DEPTH_FLOOR, centroid, press, press_on, repeat_pressed
from .pose import load_block, load_one, load_sizes
from .resources import resource_path
from .sat import query_block
from .sites import (
    ACTIVATION,
    DESCRIPTION,
    INPUTS,
    OUTPUTS,
    UNITS_MAX,
    centroid_block,
    centroid_one,
    site_numbers,
)

ASPECT_MAX = 20.0
"""Longest by shortest edge of either box up to which the network is asked."""
RATIO_MAX = 20.0
"""Longest edge of one box by that of the other."""
DEPTH_MAX = 0.1
"""Depth by the shortest edge of the two boxes."""
RANGE_SLACK = 1.0 + 1e-9
"""The limits of the range belong to it, rounding included."""

FLAT = 0.25 * DEPTH_FLOOR
"""Half extent of A∩B's bounding box, of the size, below which pressing in gave it no volume."""

CENTROID_REACH = 0.5
"""Farthest a centroid can be from the middle of its bounding box, in half extents."""


@inlined
def asked(work, q, i):
    """The network's answer along axis q [m], cut to where a centroid can be.

    It is from the middle of the bounding box.
    """
    return work[HALF + q + i] * min(CENTROID_REACH, max(-CENTROID_REACH, work[CENTROID + q + i]))


@inlined
def _share(work, f, i, dx, dy, dz):
    """Share of the step (dx, dy, dz) [m] that stays between the other box's faces f.

    The step is from the inside point.
    """
    nx = work[NORMALS + 3 * f + i]
    ny = work[NORMALS + 3 * f + LANES + i]
    nz = work[NORMALS + 3 * f + 2 * LANES + i]
    start = work[OFFSETS + f + i] + (
        (nx * (work[INSIDE + i] - work[MIDDLE + i])
         + ny * (work[INSIDE + LANES + i] - work[MIDDLE + LANES + i]))
        + nz * (work[INSIDE + 2 * LANES + i] - work[MIDDLE + 2 * LANES + i]))
    step = (nx * dx + ny * dy) + nz * dz
    room = (work[OTHER + f + i] - start) if step >= 0.0 else (work[OTHER + f + i] + start)
    step = abs(step)
    return max(0.0, room) / step if step > max(0.0, room) else 1.0


@kernel
def place_block(count, work):
    """POINT of a block, from the network's answer."""
    if count == 1:
        _place(1, work)
    else:
        _place(LANES, work)


@inlined
def _place(lanes, work):
    for i in range(lanes):
        dx = (work[MIDDLE + i] + asked(work, 0, i)) - work[INSIDE + i]
        dy = (work[MIDDLE + LANES + i] + asked(work, LANES, i)) - work[INSIDE + LANES + i]
        dz = (work[MIDDLE + 2 * LANES + i] + asked(work, 2 * LANES, i)
              ) - work[INSIDE + 2 * LANES + i]
        share = min(min(_share(work, 0, i, dx, dy, dz),
                        _share(work, LANES, i, dx, dy, dz)),
                    _share(work, 2 * LANES, i, dx, dy, dz))
        x = work[INSIDE + i] + share * dx
        y = work[INSIDE + LANES + i] + share * dy
        z = work[INSIDE + 2 * LANES + i] + share * dz
        in_b = work[IN_B + i] > 0.5
        work[POINT + i] = (work[OFFSET_A + i] + (
            (work[ROTATION + i] * x + work[ROTATION + LANES + i] * y)
            + work[ROTATION + 2 * LANES + i] * z)) if in_b else x
        work[POINT + LANES + i] = (work[OFFSET_A + LANES + i] + (
            (work[ROTATION + 3 * LANES + i] * x + work[ROTATION + 4 * LANES + i] * y)
            + work[ROTATION + 5 * LANES + i] * z)) if in_b else y
        work[POINT + 2 * LANES + i] = (work[OFFSET_A + 2 * LANES + i] + (
            (work[ROTATION + 6 * LANES + i] * x + work[ROTATION + 7 * LANES + i] * y)
            + work[ROTATION + 8 * LANES + i] * z)) if in_b else z


@kernel
def range_block(count, work):
    """IN_RANGE of a block: 1.0 for pairs of the kind that the network was trained for."""
    if count == 1:
        _range(1, work)
    else:
        _range(LANES, work)


@inlined
def _range(lanes, work):
    for i in range(lanes):
        a0, a1, a2 = work[HALF_A + i], work[HALF_A + LANES + i], work[HALF_A + 2 * LANES + i]
        b0, b1, b2 = work[HALF_B + i], work[HALF_B + LANES + i], work[HALF_B + 2 * LANES + i]
        long_a, short_a = max(max(a0, a1), a2), min(min(a0, a1), a2)
        long_b, short_b = max(max(b0, b1), b2), min(min(b0, b1), b2)
        # What is limited, by its limit: 1 at the border of the range.
        excess = max(long_a / (ASPECT_MAX * short_a), long_b / (ASPECT_MAX * short_b))
        excess = max(excess, max(long_a, long_b) / (RATIO_MAX * min(long_a, long_b)))
        excess = max(excess, -work[SEPARATION + i] / (2.0 * DEPTH_MAX * min(short_a, short_b)))
        # Where corners or edges touch exactly, B may need pressing along several axes (`press_on`);
        # until then A∩B has no volume. Otherwise it holds a ball of radius depth / (2 √3).
        thinnest = min(min(work[HALF + i], work[HALF + LANES + i]), work[HALF + 2 * LANES + i])
        flat = thinnest < FLAT * work[SIZE + i]
        work[IN_RANGE + i] = 0.0 if flat or not excess <= RANGE_SLACK else 1.0


@kernel
def _exact_point(work, i):
    """What model `exact` answers for a pair that has been pressed in."""
    press_on(work, i)
    return centroid(work, i)


@kernel
def solve_mlp(poses_a, poses_b, sizes_a, sizes_b, work, numbers, status, colliding,
                    separation, normal, point):
    """Model `mlp` for all rows; returns the numbers of rows refused and answered exactly.

    numbers: see `sites.site_numbers`.
    """
    bad = 0
    exact = 0
    rows = poses_a.shape[0]
    for start in range(0, rows, LANES):
        count = min(LANES, rows - start)
        refused = load_block(poses_a, poses_b, sizes_a, sizes_b, start, count, work)
        if refused:
            bad += refused
            write_faults(work, start, count, status)
        query_block(count, work)
        touching = 0
        for i in range(count):
            if work[SEPARATION + i] <= work[TOUCH + i]:
                touching += 1
                press(work, i)
        if touching > 0:
            outline_block(LANES, work)
            centroid_block(work, numbers)
            place_block(LANES, work)
            range_block(LANES, work)
            for i in range(count):
                if work[IN_RANGE + i] == 0.0 and work[SEPARATION + i] <= work[TOUCH + i]:
                    exact += 1
                    p = _exact_point(work, i)
                    work[POINT + i] = p[0]
                    work[POINT + LANES + i] = p[1]
                    work[POINT + 2 * LANES + i] = p[2]
            to_common_frame(work)
        for i in range(count):
            if work[SEPARATION + i] <= work[TOUCH + i]:
                write_found(work, i, start + i, colliding, separation, normal, point)
            else:
                write_apart(work, i, start + i, colliding, separation, normal, point)
    return bad, exact


@kernel
def one_mlp(work, numbers, pose_a, pose_b, normal, point):
    """A single pair, poses (7,): writes normal (3,) and point (3,).

    Returns APART, TOUCHING or REFUSED, and the separation.
    """
    if load_one(pose_a, pose_b, work):
        return REFUSED, 0.0
    query_block(1, work)
    if work[SEPARATION] > work[TOUCH]:
        write_nothing(normal, point)
        return APART, work[SEPARATION]
    press(work, 0)
    repeat_pressed(work)
    outline_block(1, work)
    range_block(1, work)
    if work[IN_RANGE] == 0.0:
        work[EXACT_ANSWERS] += 1.0
        write_one(work, _exact_point(work, 0), normal, point)
        return TOUCHING, work[SEPARATION]
    centroid_one(work, numbers)
    place_block(1, work)
    write_one(work, (work[POINT], work[POINT + LANES], work[POINT + 2 * LANES]), normal, point)
    return TOUCHING, work[SEPARATION]


SAME_EXTENT = 1e-6
"""Relative difference up to which an extent is one that the network was trained for: sizes may
have been through float32 or a text file, and the point moves by as little."""


def _listed_sizes(weights: Weights) -> np.ndarray | None:
    """The pairs of sizes (pairs, 2, 3) that a card lists, extents sorted, or None: any."""
    listed = weights.card['sizes']
    try:
        sizes = np.array(listed, dtype=np.float64)
    except (TypeError, ValueError):
        sizes = np.empty(0)
    if listed and (sizes.ndim != 3 or sizes.shape[1:] != (2, 3) or not np.all(sizes > 0.0)):
        raise WeightsError(f'weights file {weights.path}: the sizes in its card are no pairs of '
                           f'three extents')
    return np.sort(sizes, axis=-1) if listed else None


class Mlp:
    """SAT and a network for the point, for any sizes or those that the weights' card lists.

    Sizes (2, 3) are those of single calls.
    """

    def __init__(self, sizes: np.ndarray, weights: str | None = None) -> None:
        try:
            path = weights or resource_path('weights', 'mlp.safetensors')
        except FileNotFoundError as error:
            raise WeightsError(
                "model 'mlp' has no weights: train them, name a file with `weights`, or use "
                "model 'exact', which needs none") from error
        self.weights = load_weights(path)
        network = self.weights.networks.get('point')
        if network is None or (network.widths[0], network.widths[-1]) != (INPUTS, OUTPUTS):
            raise WeightsError(
                f"weights file {path} has no network 'point' with {INPUTS} inputs and {OUTPUTS} "
                f"outputs, which model 'mlp' needs")
        if len(network.widths) != 3 or network.widths[1] > UNITS_MAX:
            raise WeightsError(f"weights file {path}: network 'point' must have one hidden layer, "
                               f'of at most {UNITS_MAX} units')
        if self.weights.card['inputs'].get('description') != DESCRIPTION:
            raise WeightsError(f'weights file {path} is for other inputs than this version has')
        if self.weights.card.get('activation') != ACTIVATION:
            raise WeightsError(f"weights file {path}: this version's units are {ACTIVATION!r}, not "
                               f"{self.weights.card.get('activation')!r}")
        self._exact_answers = 0
        self._numbers = site_numbers(network)
        self._work = new_work()
        # A memory of its own, so that a single call finds its sizes in it.
        self.one_scratch = (new_work(), site_numbers(network))
        load_sizes(sizes, self.one_scratch[0])
        self._listed = _listed_sizes(self.weights)
        self._looked_up = (b'', np.zeros(1, dtype=np.bool_))
        # Single calls have no test of the sizes: a solver for boxes that are not listed has no
        # `one`, and all its calls end in `solve`.
        if self._in_card(sizes[:1], sizes[1:]).all():
            self.one = one_mlp

    @property
    def exact_answers(self) -> int:
        """Contacts outside the trained range or sizes so far, which were answered exactly."""
        return self._exact_answers + int(self.one_scratch[0][EXACT_ANSWERS])

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              status: np.ndarray, found: Contacts) -> int:
        """Fill `found` for poses (n, 7), sizes (n or 1, 3); returns how many rows are refused."""
        if self._listed is not None:
            asked = self._in_card(size_a, size_b)
            if not asked.all():
                return self._solve_partly(a, b, size_a, size_b, status, found, asked)
        bad, exact = solve_mlp(a, b, size_a, size_b, self._work, self._numbers, status,
                                     *found)
        self._exact_answers += exact
        return int(bad)

    def _solve_partly(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
                      status: np.ndarray, found: Contacts, asked: np.ndarray) -> int:
        """`solve` with the network for the rows `asked` (n or 1,), exactly for the others."""
        refused = 0
        asked = np.broadcast_to(asked, len(a))
        for by_network in (True, False):
            rows = np.flatnonzero(asked == by_network)
            if not len(rows):
                continue
            sizes = [size if len(size) == 1 else size[rows] for size in (size_a, size_b)]
            part = Contacts(*(whole[rows] for whole in found))
            reasons = np.zeros(len(rows), dtype=np.int8)
            if by_network:
                bad, exact = solve_mlp(a[rows], b[rows], *sizes, self._work, self._numbers,
                                             reasons, *part)
            else:
                bad = solve_exact(a[rows], b[rows], *sizes, self._work, reasons, *part)
                exact = np.count_nonzero(part.colliding & (reasons == 0))
            self._exact_answers += int(exact)
            refused += int(bad)
            status[rows] = reasons
            for whole, piece in zip(found, part):
                whole[rows] = piece
        return refused

    def _in_card(self, size_a: np.ndarray, size_b: np.ndarray) -> np.ndarray:
        """(n or 1,) whether the card lists these sizes (n or 1, 3), or any.

        The order of the boxes does not matter, nor which of a box's axes is called x, y, z.
        """
        if self._listed is None:
            return np.ones(1, dtype=np.bool_)
        shared = len(size_a) == len(size_b) == 1  # mostly the solver's own: looked up once
        key = size_a.tobytes() + size_b.tobytes() if shared else b''
        if shared and key == self._looked_up[0]:
            return self._looked_up[1]
        one, other = np.sort(size_a, axis=-1), np.sort(size_b, axis=-1)
        listed = np.zeros(max(len(one), len(other)), dtype=np.bool_)
        for p, q in self._listed:
            for first, second in ((one, other), (other, one)):
                listed |= ((abs(first - p) <= SAME_EXTENT * p).all(axis=1)
                           & (abs(second - q) <= SAME_EXTENT * q).all(axis=1))
        if shared:
            self._looked_up = (key, listed)
        return listed
