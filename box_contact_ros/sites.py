"""The MLP: what it sees of an overlap, and what it says.

Scaled to its bounding box, A∩B is the cube [−1, 1]³ cut by the six faces of the other box. Two
opposite faces f share their unit normal in these coordinates (unit in the sum of the absolute
components: SLANTS), and cut into the cube by so much (CUTS); the difference pushes the centroid
along the normal (PUSHES). Sizes, units and the depth have gone: one network serves every pair of
boxes.

The cube has 48 symmetries, faces may be counted in any order, and each couple from either side.
The answer has all of these symmetries exactly, so nothing needs to be chosen first, and no answer
steps where a choice would change. The network is asked at nine sites: for each couple of faces f,
each axis q of the cube. Its inputs there are magnitudes and products, which symmetries only take to
another site; its three outputs are multiplied with the components q of three vectors, which turn
along:

1. the push of the faces f, along their normal;
2. the push of the other faces as far as it goes along the faces f, times their cut;
3. what the normals of the other faces have of the push of the faces f, times their cuts.

The sum over all f is the offset of the centroid along q. Where an overlap is its own mirror image
through the middle, or no face is slanted along q, all three are zero along q, and the answer is the
middle, whatever the weights. (Vectors times a network of invariants: Villar et al.,
Scalars are universal, 2021.)

There is one layer of hidden units. What they sum over inputs that sites share is computed once for
all of these.
"""
from __future__ import annotations

import numpy as np

from .block import (
    CENTROID,
    HALF,
    HALF_A,
    HALF_B,
    IN_B,
    LANES,
    MIDDLE,
    NORMALS,
    OFFSET_A,
    OFFSET_B,
    OFFSETS,
    OTHER,
    ROTATION,
    SIZE,
    aligned,
)
from .jit import fused_inlined, fused_kernel, inlined, kernel
from .network import Network, unpacked
from .outline import FLUSH

SITES = 9
"""For each of the other box's axes, and so couple of faces f, each axis q of the cube: 3 f + q."""
INPUTS, OUTPUTS = 12, 3
NAMES = (
    'slant · cut', '|slant · push|', 'slant · push of these faces · of the others',
    'larger slant along another axis · cut',
    'cut of these faces', '|push of these faces|', 'their push · of the others along it',
    'cut of all faces',
    'slant · cut of all faces along this axis', '|push of all faces| along it',
    'larger slant · cut of all faces along another', '|push of all faces| along all axes')
"""Inputs at a site: four of its own, four that all sites of its faces have, four of its axis."""
DESCRIPTION = 'cuts of the unit cube, at nine sites'
"""What the inputs and outputs mean; weights made for another meaning are refused."""
ACTIVATION = 'relu'
"""Of the hidden units; weights made for another one are refused."""
UNITS_MAX = 64
"""Most hidden units: as far as the search for their number goes."""
NARROW = 16
"""Lanes that hold a single pair's sites: a multiple of every vector width."""

_next = 0


def _rows(count: int) -> int:
    global _next
    first = _next
    _next += count
    return first


# Rows of `site_numbers`, LANES float32 each; then the weights. Rows are counted here, not numbers.
# Of the couple of faces f at NAME + f; with components at NAME + 3 f + component.
SLANTS = _rows(9)      # unit normal in the cube, |x| + |y| + |z| = 1
CUTS = _rows(3)        # how far the two faces cut into the cube, together
PUSHES = _rows(3)      # how much further the lower of them does than the upper
STRENGTHS = _rows(3)   # |push|
AGREED = _rows(3)      # push · push of the others along these faces' normal
PULLED = _rows(3)      # cut · push of the others along these faces' normal
PASSED = _rows(9)      # what the others' normals have of this push, times their cuts
# Along the axis q of the cube, over all faces: at NAME + q.
SLANTED = _rows(3)     # slant · cut
SHIFT = _rows(3)       # push
SHIFTS = _rows(3)      # |push|
LARGER = _rows(3)      # slant · cut along that other axis where it is larger
WHOLE = _rows(2)       # cut of all faces; |push of all| along all axes
SITE = _rows(36)       # inputs that a site has for itself: at SITE + 4 · site + input
# Of the four hidden units under way: what they sum over inputs that sites share.
OF_FACES = _rows(12)   # of the couple of faces f at OF_FACES + 4 f + unit
OF_AXES = _rows(12)    # of the axis q
ANSWERS = _rows(27)    # of a site at ANSWERS + 3 · site + output
ONE = _rows(INPUTS)    # inputs of a single pair, whose sites lie side by side
ROWS = _next

GROUP = 64
"""Weights of four hidden units: 4 biases; 16 each, units first, for the inputs of faces, of axes,
of sites; 12 to the outputs, outputs first. Before the first: the number of units, 3 biases of the
outputs."""
INPUTS_OF = np.array([[*range(SITE + 4 * (3 * f + q), SITE + 4 * (3 * f + q + 1)),
                       CUTS + f, STRENGTHS + f, AGREED + f, WHOLE,
                       SLANTED + q, SHIFTS + q, LARGER + q, WHOLE + 1]
                      for f in range(3) for q in range(3)])
"""(SITES, INPUTS) rows of each site's inputs."""


def site_numbers(network: Network) -> np.ndarray:
    """A network and the memory that it works in, float32.

    All is in one array, because every array that is passed costs a single call 50 ns.
    """
    (first, bias), (last, last_bias) = unpacked(network)
    units = -(-len(bias) // 4) * 4
    wide = np.zeros((units, INPUTS), dtype=np.float32)
    wide_bias, wide_last = np.zeros(units, dtype=np.float32), np.zeros((OUTPUTS, units),
                                                                       dtype=np.float32)
    wide[:len(bias)], wide_bias[:len(bias)], wide_last[:, :len(bias)] = first, bias, last
    groups = [np.concatenate([
        wide_bias[four], wide[four, 4:8].ravel(), wide[four, 8:12].ravel(), wide[four, :4].ravel(),
        wide_last[:, four].ravel()]) for four in (slice(k, k + 4) for k in range(0, units, 4))]
    return aligned(np.concatenate(
        [np.zeros(ROWS * LANES), [units], last_bias, *groups]).astype(np.float32))


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
def _face_cuts(lanes, work, numbers, f):
    """How far the two faces across axis f cut into the cube, and at which slant."""
    for i in range(lanes):
        offset = work[OFFSETS + f * LANES + i]
        # As wide as the outline took it: a face in one plane with the cube's cuts nothing.
        half = work[OTHER + f * LANES + i] + FLUSH * work[SIZE + i]
        x = work[NORMALS + 3 * f * LANES + i] * work[HALF + i]
        y = work[NORMALS + (3 * f + 1) * LANES + i] * work[HALF + LANES + i]
        z = work[NORMALS + (3 * f + 2) * LANES + i] * work[HALF + 2 * LANES + i]
        inverse = 1.0 / ((abs(x) + abs(y)) + abs(z))
        # 1: the face goes through the cube's middle; 0: it just misses the cube; 2: nothing left.
        upper = min(2.0, max(0.0, 1.0 - (half - offset) * inverse))
        lower = min(2.0, max(0.0, 1.0 - (half + offset) * inverse))
        numbers[(SLANTS + 3 * f) * LANES + i] = x * inverse
        numbers[(SLANTS + 3 * f + 1) * LANES + i] = y * inverse
        numbers[(SLANTS + 3 * f + 2) * LANES + i] = z * inverse
        numbers[(CUTS + f) * LANES + i] = upper + lower
        numbers[(PUSHES + f) * LANES + i] = lower - upper


@inlined
def _pass_on(numbers, f, i, cx, cy, cz):
    """What the other faces pass on of the push of the faces f; c is where they do."""
    push = numbers[(PUSHES + f) * LANES + i]
    numbers[(PASSED + 3 * f) * LANES + i] = push * cx
    numbers[(PASSED + 3 * f + 1) * LANES + i] = push * cy
    numbers[(PASSED + 3 * f + 2) * LANES + i] = push * cz


@inlined
def _faces_together(numbers, f, i, cut, push, along):
    """What the network sees of the faces f; along: the others' push along their normal."""
    numbers[(STRENGTHS + f) * LANES + i] = abs(push)
    numbers[(AGREED + f) * LANES + i] = push * along
    numbers[(PULLED + f) * LANES + i] = cut * along


@kernel
def describe_block(work, numbers):
    """All inputs of a block of pairs."""
    _describe(LANES, work, numbers)
    _sites_along(numbers, 0, 1, 2)
    _sites_along(numbers, 1, 2, 0)
    _sites_along(numbers, 2, 0, 1)


@inlined
def _describe(lanes, work, numbers):
    _frame_axis(lanes, work, 0)
    _frame_axis(lanes, work, LANES)
    _frame_axis(lanes, work, 2 * LANES)
    _face_cuts(lanes, work, numbers, 0)
    _face_cuts(lanes, work, numbers, 1)
    _face_cuts(lanes, work, numbers, 2)
    _couple(lanes, numbers)


@inlined
def _couple(lanes, numbers):
    """What the three couples of faces, a, b and c, have to do with each other."""
    for i in range(lanes):
        ax, ay, az = (numbers[SLANTS * LANES + i], numbers[(SLANTS + 1) * LANES + i],
                      numbers[(SLANTS + 2) * LANES + i])
        bx, by, bz = (numbers[(SLANTS + 3) * LANES + i], numbers[(SLANTS + 4) * LANES + i],
                      numbers[(SLANTS + 5) * LANES + i])
        cx, cy, cz = (numbers[(SLANTS + 6) * LANES + i], numbers[(SLANTS + 7) * LANES + i],
                      numbers[(SLANTS + 8) * LANES + i])
        ka, kb, kc = (numbers[CUTS * LANES + i], numbers[(CUTS + 1) * LANES + i],
                      numbers[(CUTS + 2) * LANES + i])
        a, b, c = (numbers[PUSHES * LANES + i], numbers[(PUSHES + 1) * LANES + i],
                   numbers[(PUSHES + 2) * LANES + i])
        ab = (ax * bx + ay * by) + az * bz
        ac = (ax * cx + ay * cy) + az * cz
        bc = (bx * cx + by * cy) + bz * cz
        _faces_together(numbers, 0, i, ka, a, ab * b + ac * c)
        _faces_together(numbers, 1, i, kb, b, ab * a + bc * c)
        _faces_together(numbers, 2, i, kc, c, ac * a + bc * b)
        aka, akb, bkb = ab * ka, ab * kb, bc * kb
        aca, acc, bcc = ac * ka, ac * kc, bc * kc
        _pass_on(numbers, 0, i, bx * akb + cx * acc, by * akb + cy * acc, bz * akb + cz * acc)
        _pass_on(numbers, 1, i, ax * aka + cx * bcc, ay * aka + cy * bcc, az * aka + cz * bcc)
        _pass_on(numbers, 2, i, ax * aca + bx * bkb, ay * aca + by * bkb, az * aca + bz * bkb)
        x = (ax * a + bx * b) + cx * c
        y = (ay * a + by * b) + cy * c
        z = (az * a + bz * b) + cz * c
        numbers[SHIFT * LANES + i] = x
        numbers[(SHIFT + 1) * LANES + i] = y
        numbers[(SHIFT + 2) * LANES + i] = z
        x, y, z = abs(x), abs(y), abs(z)
        numbers[SHIFTS * LANES + i] = x
        numbers[(SHIFTS + 1) * LANES + i] = y
        numbers[(SHIFTS + 2) * LANES + i] = z
        numbers[WHOLE * LANES + i] = (ka + kb) + kc
        numbers[(WHOLE + 1) * LANES + i] = (x + y) + z
        x = (abs(ax) * ka + abs(bx) * kb) + abs(cx) * kc
        y = (abs(ay) * ka + abs(by) * kb) + abs(cy) * kc
        z = (abs(az) * ka + abs(bz) * kb) + abs(cz) * kc
        numbers[SLANTED * LANES + i] = x
        numbers[(SLANTED + 1) * LANES + i] = y
        numbers[(SLANTED + 2) * LANES + i] = z
        numbers[LARGER * LANES + i] = max(y, z)
        numbers[(LARGER + 1) * LANES + i] = max(x, z)
        numbers[(LARGER + 2) * LANES + i] = max(x, y)


@inlined
def _site_inputs(numbers, f, q, r, s, i):
    """The four inputs that only the site of faces f and axis q has; r, s are the other axes."""
    cut = numbers[(CUTS + f) * LANES + i]
    slant = numbers[(SLANTS + 3 * f + q) * LANES + i]
    push = slant * numbers[(PUSHES + f) * LANES + i]
    return (abs(slant) * cut, abs(push), push * (numbers[(SHIFT + q) * LANES + i] - push),
            max(abs(numbers[(SLANTS + 3 * f + r) * LANES + i]),
                abs(numbers[(SLANTS + 3 * f + s) * LANES + i])) * cut)


@inlined
def _site(numbers, f, q, r, s):
    row = SITE + 4 * (3 * f + q)
    for i in range(LANES):
        slanted, push, agreed, larger = _site_inputs(numbers, f, q, r, s, i)
        numbers[row * LANES + i] = slanted
        numbers[(row + 1) * LANES + i] = push
        numbers[(row + 2) * LANES + i] = agreed
        numbers[(row + 3) * LANES + i] = larger


@inlined
def _sites_along(numbers, q, r, s):
    _site(numbers, 0, q, r, s)
    _site(numbers, 1, q, r, s)
    _site(numbers, 2, q, r, s)


@inlined
def site_vectors(numbers, f, q, i):
    """What the network's three outputs at a site are multiplied with."""
    slant = numbers[(SLANTS + 3 * f + q) * LANES + i]
    return (slant * numbers[(PUSHES + f) * LANES + i], slant * numbers[(PULLED + f) * LANES + i],
            numbers[(PASSED + 3 * f + q) * LANES + i])


@fused_inlined
def relu(x):
    """The activation: one instruction, and continuous as the answer has to be.

    With as many units errors are a tenth smaller than with x / (1 + |x|).
    """
    return max(x, np.float32(0.0))


# Of `numbers` as one flat array with rows at constant places the compiler knows that no two rows
# overlap. With rows that follow from the unit under way it tested that, before every loop: half of
# the network's time.

@fused_inlined
def _shared(lanes, numbers, r0, r1, r2, r3, biases, weights, to):
    """Four hidden units' sums over four inputs, rows r0 to r3, to four rows from `to` on."""
    b0, b1, b2, b3 = biases
    p0, p1, p2, p3 = weights[0], weights[1], weights[2], weights[3]
    q0, q1, q2, q3 = weights[4], weights[5], weights[6], weights[7]
    s0, s1, s2, s3 = weights[8], weights[9], weights[10], weights[11]
    t0, t1, t2, t3 = weights[12], weights[13], weights[14], weights[15]
    for i in range(lanes):
        x0, x1 = numbers[r0 * LANES + i], numbers[r1 * LANES + i]
        x2, x3 = numbers[r2 * LANES + i], numbers[r3 * LANES + i]
        numbers[to * LANES + i] = (((b0 + p0 * x0) + p1 * x1) + p2 * x2) + p3 * x3
        numbers[(to + 1) * LANES + i] = (((b1 + q0 * x0) + q1 * x1) + q2 * x2) + q3 * x3
        numbers[(to + 2) * LANES + i] = (((b2 + s0 * x0) + s1 * x1) + s2 * x2) + s3 * x3
        numbers[(to + 3) * LANES + i] = (((b3 + t0 * x0) + t1 * x1) + t2 * x2) + t3 * x3


_NO_BIASES = (np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0))


@fused_inlined
def _of_faces(lanes, numbers, r0, r1, r2, r3, group, to):
    _shared(lanes, numbers, r0, r1, r2, r3, (group[0], group[1], group[2], group[3]), group[4:20],
            to)


@fused_inlined
def _of_axes(lanes, numbers, r0, r1, r2, r3, group, to):
    _shared(lanes, numbers, r0, r1, r2, r3, _NO_BIASES, group[20:36], to)


@fused_inlined
def _four_units(lanes, numbers, x, of_faces, of_axes, answers, group):
    """Add to three rows from `answers` on what four hidden units say of inputs in four from x on.

    of_faces, of_axes: first rows of what these units have summed before.
    """
    p0, p1, p2, p3 = group[36], group[37], group[38], group[39]
    q0, q1, q2, q3 = group[40], group[41], group[42], group[43]
    s0, s1, s2, s3 = group[44], group[45], group[46], group[47]
    t0, t1, t2, t3 = group[48], group[49], group[50], group[51]
    u0, u1, u2, u3 = group[52], group[53], group[54], group[55]
    v0, v1, v2, v3 = group[56], group[57], group[58], group[59]
    w0, w1, w2, w3 = group[60], group[61], group[62], group[63]
    for i in range(lanes):
        x0, x1 = numbers[x * LANES + i], numbers[(x + 1) * LANES + i]
        x2, x3 = numbers[(x + 2) * LANES + i], numbers[(x + 3) * LANES + i]
        h0 = relu(((((numbers[of_faces * LANES + i] + numbers[of_axes * LANES + i])
                     + p0 * x0) + p1 * x1) + p2 * x2) + p3 * x3)
        h1 = relu(((((numbers[(of_faces + 1) * LANES + i] + numbers[(of_axes + 1) * LANES + i])
                     + q0 * x0) + q1 * x1) + q2 * x2) + q3 * x3)
        h2 = relu(((((numbers[(of_faces + 2) * LANES + i] + numbers[(of_axes + 2) * LANES + i])
                     + s0 * x0) + s1 * x1) + s2 * x2) + s3 * x3)
        h3 = relu(((((numbers[(of_faces + 3) * LANES + i] + numbers[(of_axes + 3) * LANES + i])
                     + t0 * x0) + t1 * x1) + t2 * x2) + t3 * x3)
        numbers[answers * LANES + i] = (((
            numbers[answers * LANES + i] + u0 * h0) + u1 * h1) + u2 * h2) + u3 * h3
        numbers[(answers + 1) * LANES + i] = (((
            numbers[(answers + 1) * LANES + i] + v0 * h0) + v1 * h1) + v2 * h2) + v3 * h3
        numbers[(answers + 2) * LANES + i] = (((
            numbers[(answers + 2) * LANES + i] + w0 * h0) + w1 * h1) + w2 * h2) + w3 * h3


@inlined
def _begin_answers(lanes, numbers, answers, biases):
    b0, b1, b2 = biases[0], biases[1], biases[2]
    for i in range(lanes):
        numbers[answers * LANES + i] = b0
        numbers[(answers + 1) * LANES + i] = b1
        numbers[(answers + 2) * LANES + i] = b2


@inlined
def _begin_faces(numbers, f, biases):
    _begin_answers(LANES, numbers, ANSWERS + 9 * f, biases)
    _begin_answers(LANES, numbers, ANSWERS + 9 * f + 3, biases)
    _begin_answers(LANES, numbers, ANSWERS + 9 * f + 6, biases)


@fused_inlined
def _at_faces(numbers, f, group):
    """Add to the answers at the three sites of the faces f what four hidden units say."""
    _four_units(LANES, numbers, SITE + 12 * f, OF_FACES + 4 * f, OF_AXES, ANSWERS + 9 * f, group)
    _four_units(LANES, numbers, SITE + 12 * f + 4, OF_FACES + 4 * f, OF_AXES + 4,
                ANSWERS + 9 * f + 3, group)
    _four_units(LANES, numbers, SITE + 12 * f + 8, OF_FACES + 4 * f, OF_AXES + 8,
                ANSWERS + 9 * f + 6, group)


@fused_inlined
def _sums(numbers, k, group):
    """What four hidden units sum over the inputs of the faces k, and of the axis k."""
    _of_faces(LANES, numbers, CUTS + k, STRENGTHS + k, AGREED + k, WHOLE, group, OF_FACES + 4 * k)
    _of_axes(LANES, numbers, SLANTED + k, SHIFTS + k, LARGER + k, WHOLE + 1, group,
             OF_AXES + 4 * k)


@fused_kernel
def answers_block(numbers):
    """ANSWERS of a block, at all sites."""
    weights = numbers[ROWS * LANES:]
    _begin_faces(numbers, 0, weights[1:4])
    _begin_faces(numbers, 1, weights[1:4])
    _begin_faces(numbers, 2, weights[1:4])
    for unit in range(0, int(weights[0]), 4):
        group = weights[4 + unit // 4 * GROUP:]
        _sums(numbers, 0, group)
        _sums(numbers, 1, group)
        _sums(numbers, 2, group)
        _at_faces(numbers, 0, group)
        _at_faces(numbers, 1, group)
        _at_faces(numbers, 2, group)


@inlined
def _answer(numbers, f, q, i, answers, at):
    """What a site adds to the offset along q; its answers are three rows, in lane `at`."""
    pushed, pulled, passed = site_vectors(numbers, f, q, i)
    return (numbers[answers * LANES + at] * pushed
            + numbers[(answers + 1) * LANES + at] * pulled
            ) + numbers[(answers + 2) * LANES + at] * passed


@inlined
def _add_up(work, numbers, q):
    for i in range(LANES):
        # In float64, as a single pair's.
        work[CENTROID + q * LANES + i] = 0.0
        work[CENTROID + q * LANES + i] += _answer(numbers, 0, q, i, ANSWERS + 3 * q, i)
        work[CENTROID + q * LANES + i] += _answer(numbers, 1, q, i, ANSWERS + 9 + 3 * q, i)
        work[CENTROID + q * LANES + i] += _answer(numbers, 2, q, i, ANSWERS + 18 + 3 * q, i)


@kernel
def centroid_block(work, numbers):
    """CENTROID of a block: where the network says that it is, from the cube's middle."""
    describe_block(work, numbers)
    answers_block(numbers)
    _add_up(work, numbers, 0)
    _add_up(work, numbers, 1)
    _add_up(work, numbers, 2)


@fused_kernel
def answers_one(numbers):
    """ANSWERS at all sites of a single pair, side by side: the same sums in the same order."""
    weights = numbers[ROWS * LANES:]
    _begin_answers(NARROW, numbers, ANSWERS, weights[1:4])
    for unit in range(0, int(weights[0]), 4):
        group = weights[4 + unit // 4 * GROUP:]
        _of_faces(NARROW, numbers, ONE + 4, ONE + 5, ONE + 6, ONE + 7, group, OF_FACES)
        _of_axes(NARROW, numbers, ONE + 8, ONE + 9, ONE + 10, ONE + 11, group, OF_AXES)
        _four_units(NARROW, numbers, ONE, OF_FACES, OF_AXES, ANSWERS, group)


@inlined
def _lay_out(numbers, f, q, r, s):
    """A single pair's inputs at a site."""
    site = 3 * f + q
    slanted, push, agreed, larger = _site_inputs(numbers, f, q, r, s, 0)
    numbers[ONE * LANES + site] = slanted
    numbers[(ONE + 1) * LANES + site] = push
    numbers[(ONE + 2) * LANES + site] = agreed
    numbers[(ONE + 3) * LANES + site] = larger
    numbers[(ONE + 4) * LANES + site] = numbers[(CUTS + f) * LANES]
    numbers[(ONE + 5) * LANES + site] = numbers[(STRENGTHS + f) * LANES]
    numbers[(ONE + 6) * LANES + site] = numbers[(AGREED + f) * LANES]
    numbers[(ONE + 7) * LANES + site] = numbers[WHOLE * LANES]
    numbers[(ONE + 8) * LANES + site] = numbers[(SLANTED + q) * LANES]
    numbers[(ONE + 9) * LANES + site] = numbers[(SHIFTS + q) * LANES]
    numbers[(ONE + 10) * LANES + site] = numbers[(LARGER + q) * LANES]
    numbers[(ONE + 11) * LANES + site] = numbers[(WHOLE + 1) * LANES]


@inlined
def _lay_out_along(numbers, q, r, s):
    _lay_out(numbers, 0, q, r, s)
    _lay_out(numbers, 1, q, r, s)
    _lay_out(numbers, 2, q, r, s)


@inlined
def _add_up_one(work, numbers, q):
    work[CENTROID + q * LANES] = 0.0
    work[CENTROID + q * LANES] += _answer(numbers, 0, q, 0, ANSWERS, q)
    work[CENTROID + q * LANES] += _answer(numbers, 1, q, 0, ANSWERS, 3 + q)
    work[CENTROID + q * LANES] += _answer(numbers, 2, q, 0, ANSWERS, 6 + q)


@kernel
def centroid_one(work, numbers):
    """CENTROID of a single pair."""
    _describe(1, work, numbers)
    _lay_out_along(numbers, 0, 1, 2)
    _lay_out_along(numbers, 1, 2, 0)
    _lay_out_along(numbers, 2, 0, 1)
    answers_one(numbers)
    _add_up_one(work, numbers, 0)
    _add_up_one(work, numbers, 1)
    _add_up_one(work, numbers, 2)
