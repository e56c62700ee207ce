"""Model `committee`: SAT decides and gives normal and depth exactly; a network gives the point.

Stages of a block of pairs, each a loop without branches over structures of arrays:

1. `load_block`, `query_block`: verdict, separation, axis (`pose`, `sat`).
2. `press`: pairs shallower than DEPTH_FLOOR are pressed in, as the point's definition says.
3. `outline_block`: the exact bounding box of A∩B, in the frame of one of the boxes, and a point
   inside (`outline`).
4. `describe_block`: what the network sees. Scaled to its bounding box, A∩B is the cube [−1, 1]³ cut
   by the six faces of the other box. A face is described by its unit normal in these coordinates
   (unit in the sum of the absolute components), times how far it cuts into the cube; a face that
   cuts nothing off is zero and comes in smoothly. Sizes, units and the depth have gone: one network
   serves every pair of boxes. The cube's 48 symmetries are used up: along every axis the faces push
   the centroid to the positive side (PUSH), and axes are sorted by how much the faces are slanted
   along them (SLOPE). Both change over only where the overlap is nearly its own mirror image, so
   that the network's error does not jump as boxes move.
5. `network.forward_block`: the offset of the centroid from the cube's middle, in float32; scaled
   down where A∩B is almost symmetric about its middle (SYMMETRIC), and along an axis along which no
   face is slanted (STRAIGHT).
6. `place_block`: the offset is cut to where a centroid can be (that of a convex body lies in the
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
    CUTS,
    EXACT_ANSWERS,
    FEATURES,
    HALF,
    HALF_A,
    HALF_B,
    IN_B,
    IN_RANGE,
    INSIDE,
    LANES,
    LESS,
    MIDDLE,
    MIRRORED,
    MORE,
    NORMALS,
    OFFSET_A,
    OFFSET_B,
    OFFSETS,
    OTHER,
    POINT,
    PUSH,
    RANKS,
    REACH,
    ROTATION,
    SEPARATION,
    SIZE,
    SLANT,
    SLOPE,
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
from .network import (
    Weights,
    WeightsError,
    block_numbers,
    forward_block,
    forward_one,
    load_weights,
    network_values,
)
from .outline import (
    outline_block,
)
from .overlap import DEPTH_FLOOR, centroid, press, press_on, repeat_pressed
from .pose import load_block, load_one, load_sizes
from .resources import resource_path
from .sat import query_block

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

SYMMETRIC = 0.05
"""Asymmetry of A∩B in its bounding box below which the network's answer is scaled down, to nothing
where there is none: an overlap that is its own mirror image through its middle, as that of any two
containers squarely stacked, has its centroid there. Without it, a container at rest had its point
jump by the network's error whenever a rounding chose another of the cube's mirror images."""

STRAIGHT = 0.02
"""Slant of the cutting faces along an axis below which the point is drawn to the middle of that
axis: an overlap whose faces all run along an axis is as long everywhere across it, as that of a
container which lies on its stack with one long edge, and its centroid is in the middle."""

TIE = 1e-6
"""Difference, of numbers about 1, that makes no difference: a corner pressed into a face is slanted
alike along all three axes, and rounding must not choose between their orders; the longer side of
the bounding box comes first then."""

CENTROID_REACH = 0.5
"""Farthest a centroid can be from the middle of its bounding box, in half extents."""

INPUTS, OUTPUTS = 18, 3
DESCRIPTION = 'cuts of the unit cube, mirrored by push, sorted by slope'
"""What the inputs and outputs mean; weights made for another meaning are refused."""
WIDE_INPUTS = 20
"""Inputs as the kernels have them, in groups of four; the last two are zero."""


@inlined
def _pick(k0, k1, x0, x1, x2):
    """x0, x1 or x2: the one whose rank is asked for."""
    return x0 if k0 else (x1 if k1 else x2)


@inlined
def _frame_axis(lanes, work, f):
    """The other box's axis f (a row offset) in the frame chosen."""
    for i in range(lanes):
        in_b = work[IN_B + i] > 0.5
        x = work[ROTATION + 3 * f + i] if in_b else work[ROTATION + f + i]
        y = work[ROTATION + 3 * f + LANES + i] if in_b else work[ROTATION + 3 * LANES + f + i]
        z = work[ROTATION + 3 * f + 2 * LANES + i] if in_b else work[ROTATION + 6 * LANES + f + i]
        work[NORMALS + 3 * f + i] = x
        work[NORMALS + 3 * f + LANES + i] = y
        work[NORMALS + 3 * f + 2 * LANES + i] = z
        # Along its own axis the other box's centre is at n·c: in A's frame B's centre is at t, and
        # n·t is t's component in B's frame; in B's frame A's centre is at −t, likewise.
        centre = -work[OFFSET_A + f + i] if in_b else work[OFFSET_B + f + i]
        work[OFFSETS + f + i] = ((x * work[MIDDLE + i] + y * work[MIDDLE + LANES + i])
                                 + z * work[MIDDLE + 2 * LANES + i]) - centre
        work[OTHER + f + i] = work[HALF_A + f + i] if in_b else work[HALF_B + f + i]


@inlined
def _face_cuts(lanes, work, f):
    """How far the two faces across axis f cut in, and whereto they push the centroid."""
    for i in range(lanes):
        offset = work[OFFSETS + f + i]
        half = work[OTHER + f + i]
        x = work[NORMALS + 3 * f + i] * work[HALF + i]
        y = work[NORMALS + 3 * f + LANES + i] * work[HALF + LANES + i]
        z = work[NORMALS + 3 * f + 2 * LANES + i] * work[HALF + 2 * LANES + i]
        inverse = 1.0 / ((abs(x) + abs(y)) + abs(z))
        # 1: the face goes through the cube's middle; 0: it just misses the cube; 2: nothing left.
        upper = min(2.0, max(0.0, 1.0 - (half - offset) * inverse))
        lower = min(2.0, max(0.0, 1.0 - (half + offset) * inverse))
        flip = upper < lower
        more = (-lower if flip else upper) * inverse
        less = (-upper if flip else lower) * inverse
        work[CUTS + f + i] = upper + lower
        work[REACH + i] = max(work[REACH + i], abs(upper - lower))
        work[MORE + f + i] = more
        work[LESS + f + i] = less
        push = less - more
        work[PUSH + i] += x * push
        work[PUSH + LANES + i] += y * push
        work[PUSH + 2 * LANES + i] += z * push
        both = abs(more) + abs(less)
        work[SLOPE + i] += abs(x) * both
        work[SLOPE + LANES + i] += abs(y) * both
        work[SLOPE + 2 * LANES + i] += abs(z) * both
        more = abs(more)
        work[SLANT + i] = max(work[SLANT + i], abs(x) * more)
        work[SLANT + LANES + i] = max(work[SLANT + LANES + i], abs(y) * more)
        work[SLANT + 2 * LANES + i] = max(work[SLANT + 2 * LANES + i], abs(z) * more)


@inlined
def _face_inputs(lanes, work, f, row):
    """The two faces across axis f as inputs, from `row` on: the one that cuts more first."""
    for i in range(lanes):
        k0 = work[RANKS + i]
        k1 = work[RANKS + LANES + i]
        x = work[NORMALS + 3 * f + i] * work[MIRRORED + i]
        y = work[NORMALS + 3 * f + LANES + i] * work[MIRRORED + LANES + i]
        z = work[NORMALS + 3 * f + 2 * LANES + i] * work[MIRRORED + 2 * LANES + i]
        p0 = _pick(k0 == 0.0, k1 == 0.0, x, y, z)
        p1 = _pick(k0 == 1.0, k1 == 1.0, x, y, z)
        p2 = _pick(k0 == 2.0, k1 == 2.0, x, y, z)
        more = work[MORE + f + i]
        less = work[LESS + f + i]
        work[row + i] = p0 * more
        work[row + LANES + i] = p1 * more
        work[row + 2 * LANES + i] = p2 * more
        work[row + 3 * LANES + i] = p0 * less
        work[row + 4 * LANES + i] = p1 * less
        work[row + 5 * LANES + i] = p2 * less


@inlined
def _exchange(work, one, two, swap):
    p, q = work[one], work[two]
    work[one] = q if swap else p
    work[two] = p if swap else q


@inlined
def _in_order(lanes, work, f, g, row_f, row_g):
    """Order two axes' inputs: the one whose faces cut more first."""
    for i in range(lanes):
        cut_f, cut_g = work[CUTS + f + i], work[CUTS + g + i]
        swap = cut_f < (1.0 - TIE) * cut_g
        work[CUTS + f + i] = cut_g if swap else cut_f
        work[CUTS + g + i] = cut_f if swap else cut_g
        _exchange(work, row_f + i, row_g + i, swap)
        _exchange(work, row_f + LANES + i, row_g + LANES + i, swap)
        _exchange(work, row_f + 2 * LANES + i, row_g + 2 * LANES + i, swap)
        _exchange(work, row_f + 3 * LANES + i, row_g + 3 * LANES + i, swap)
        _exchange(work, row_f + 4 * LANES + i, row_g + 4 * LANES + i, swap)
        _exchange(work, row_f + 5 * LANES + i, row_g + 5 * LANES + i, swap)


@kernel
def describe_block(count, work, inputs):
    """The network's inputs of a block of `count` pairs: INPUTS rows of LANES float32."""
    if count == 1:
        _describe(1, work)
        for k in range(0, INPUTS * LANES, LANES):
            inputs[k] = work[FEATURES + k]
    else:
        _describe(LANES, work)
        for k in range(INPUTS * LANES):
            inputs[k] = work[FEATURES + k]


@inlined
def _describe(lanes, work):
    for i in range(lanes):
        work[REACH + i] = 0.0
    for k in range(0, 3 * LANES, LANES):
        for i in range(lanes):
            work[PUSH + k + i] = 0.0
            work[SLOPE + k + i] = 0.0
            work[SLANT + k + i] = 0.0
    _frame_axis(lanes, work, 0)
    _frame_axis(lanes, work, LANES)
    _frame_axis(lanes, work, 2 * LANES)
    _face_cuts(lanes, work, 0)
    _face_cuts(lanes, work, LANES)
    _face_cuts(lanes, work, 2 * LANES)
    for i in range(lanes):
        x, y, z = work[PUSH + i], work[PUSH + LANES + i], work[PUSH + 2 * LANES + i]
        hx, hy, hz = work[HALF + i], work[HALF + LANES + i], work[HALF + 2 * LANES + i]
        work[MIRRORED + i] = hx if x >= -TIE else -hx
        work[MIRRORED + LANES + i] = hy if y >= -TIE else -hy
        work[MIRRORED + 2 * LANES + i] = hz if z >= -TIE else -hz
        size = work[SIZE + i]
        x = work[SLOPE + i] * (size + TIE * hx)
        y = work[SLOPE + LANES + i] * (size + TIE * hy)
        z = work[SLOPE + 2 * LANES + i] * (size + TIE * hz)
        k0 = (1.0 if y > x else 0.0) + (1.0 if z > x else 0.0)
        k1 = (1.0 if x >= y else 0.0) + (1.0 if z > y else 0.0)
        work[RANKS + i] = k0
        work[RANKS + LANES + i] = k1
        work[RANKS + 2 * LANES + i] = 3.0 - (k0 + k1)
        work[REACH + i] = min(1.0, work[REACH + i] * (1.0 / SYMMETRIC))
        work[SLANT + i] = min(1.0, work[SLANT + i] * (1.0 / STRAIGHT))
        work[SLANT + LANES + i] = min(1.0, work[SLANT + LANES + i] * (1.0 / STRAIGHT))
        work[SLANT + 2 * LANES + i] = min(1.0, work[SLANT + 2 * LANES + i] * (1.0 / STRAIGHT))
    _face_inputs(lanes, work, 0, FEATURES)
    _face_inputs(lanes, work, LANES, FEATURES + 6 * LANES)
    _face_inputs(lanes, work, 2 * LANES, FEATURES + 12 * LANES)
    _in_order(lanes, work, 0, LANES, FEATURES, FEATURES + 6 * LANES)
    _in_order(lanes, work, LANES, 2 * LANES, FEATURES + 6 * LANES, FEATURES + 12 * LANES)
    _in_order(lanes, work, 0, LANES, FEATURES, FEATURES + 6 * LANES)


@inlined
def asked(work, offsets, q, i):
    """The network's answer along axis q [m], cut to where a centroid can be.

    It is from the middle of the bounding box. offsets: the network's outputs, 3 rows of LANES.
    """
    rank = work[RANKS + q + i]
    offset = _pick(rank == 0.0, rank == 1.0, np.float64(offsets[i]), np.float64(offsets[LANES + i]),
                   np.float64(offsets[2 * LANES + i]))
    offset *= work[REACH + i] * work[SLANT + q + i]
    offset = min(CENTROID_REACH, max(-CENTROID_REACH, offset))
    return work[MIRRORED + q + i] * offset


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
def place_block(count, work, offsets):
    """Points in A's frame [m], 3 rows of LANES, from the network's offsets, 3 rows of LANES."""
    if count == 1:
        _place(1, work, offsets)
    else:
        _place(LANES, work, offsets)


@inlined
def _place(lanes, work, offsets):
    for i in range(lanes):
        dx = (work[MIDDLE + i] + asked(work, offsets, 0, i)) - work[INSIDE + i]
        dy = (work[MIDDLE + LANES + i] + asked(work, offsets, LANES, i)) - work[INSIDE + LANES + i]
        dz = (work[MIDDLE + 2 * LANES + i] + asked(work, offsets, 2 * LANES, i)
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
def solve_committee(poses_a, poses_b, sizes_a, sizes_b, work, numbers, status, colliding,
                    separation, normal, point):
    """Model `committee` for all rows; returns the numbers of rows refused and answered exactly.

    numbers: see `network.block_numbers`.
    """
    bad = 0
    exact = 0
    rows = poses_a.shape[0]
    values = network_values(numbers)
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
            describe_block(LANES, work, values)
            values[INPUTS * LANES:WIDE_INPUTS * LANES] = 0.0
            forward_block(numbers)
            place_block(LANES, work, values)
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
def one_committee(work, numbers, pose_a, pose_b, normal, point):
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
    values = network_values(numbers)
    describe_block(1, work, values)
    for k in range(INPUTS, WIDE_INPUTS):
        values[k * LANES] = 0.0
    forward_one(numbers)
    place_block(1, work, values)
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


class Committee:
    """SAT and a network for the point, for any sizes or those that the weights' card lists.

    Sizes (2, 3) are those of single calls.
    """

    def __init__(self, sizes: np.ndarray, weights: str | None = None) -> None:
        try:
            path = weights or resource_path('weights', 'committee.safetensors')
        except FileNotFoundError as error:
            raise WeightsError(
                "model 'committee' has no weights: train them, name a file with `weights`, or use "
                "model 'exact', which needs none") from error
        self.weights = load_weights(path)
        network = self.weights.networks.get('point')
        if network is None or (network.widths[0], network.widths[-1]) != (INPUTS, OUTPUTS):
            raise WeightsError(
                f"weights file {path} has no network 'point' with {INPUTS} inputs and {OUTPUTS} "
                f"outputs, which model 'committee' needs")
        if max(network.widths) > LANES:
            raise WeightsError(f'weights file {path}: no layer may have more than {LANES} units')
        if self.weights.card['inputs'].get('description') != DESCRIPTION:
            raise WeightsError(f'weights file {path} is for other inputs than this version has')
        self._exact_answers = 0
        self._numbers = block_numbers(network)
        self._work = new_work()
        # A memory of its own, so that a single call finds its sizes in it.
        self.one_scratch = (new_work(), block_numbers(network))
        load_sizes(sizes, self.one_scratch[0])
        self._listed = _listed_sizes(self.weights)
        self._looked_up = (b'', np.zeros(1, dtype=np.bool_))
        # Single calls have no test of the sizes: a solver for boxes that are not listed has no
        # `one`, and all its calls end in `solve`.
        if self._in_card(sizes[:1], sizes[1:]).all():
            self.one = one_committee

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
        bad, exact = solve_committee(a, b, size_a, size_b, self._work, self._numbers, status,
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
                bad, exact = solve_committee(a[rows], b[rows], *sizes, self._work, self._numbers,
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
