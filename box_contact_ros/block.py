"""How a block of pairs lies in memory.

Kernels work on blocks of LANES pairs, stored as a structure of arrays in one flat float64 array:
value `NAME` of pair `i` of the block is `work[NAME + i]`, and `NAME` of several components has one
row each, `work[NAME + k * LANES + i]`. One array with constant strides is what lets the compiler
see that rows do not overlap, and turn loops over `i` to vector instructions.

The stages of a block, and the rows they write, in order: `pose.load_block`, `sat.query_block`,
then a builder of the point: `overlap.centroid`, pair by pair; `outline`, `mlp`; or `paper`.
Each stage exists twice, compiled for LANES pairs and for one: with a variable number of pairs,
loops took five times as long. A block that is not full is filled up with boxes far apart. A single
pair is copied to SINGLE lanes, so that what is done four times for a pair is done once for four.
"""
from __future__ import annotations

import numpy as np

LANES = 96
"""Pairs per block: a multiple of every vector width. With 64 the network takes a fifth longer, with
128 the outline does (its rows no longer fit the first cache)."""

SINGLE = 4
"""Lanes that hold a single pair: the four edges of a box that are parallel to each other."""

_row = 0


def _rows(count: int) -> int:
    global _row
    first = _row * LANES
    _row += count
    return first


# pose.load_block. Axes are counted x, y, z; R is row-major: R[i, j] = a_i · b_j.
HALF_A = _rows(3)      # half extents of A [m]
HALF_B = _rows(3)      # half extents of B [m]
ORIGIN_A = _rows(3)    # position of A, common frame [m]
ORIGIN_B = _rows(3)    # position of B, common frame [m]
TURN_A = _rows(4)      # quaternions xyzw
TURN_B = _rows(4)
FAULT = _rows(1)       # 0, or why the pair cannot be evaluated (BAD_…)
AXES_A = _rows(9)      # rotation of A, common frame, row-major (columns are A's axes)
OFFSET_A = _rows(3)    # B − A in A's frame [m]
OFFSET_B = _rows(3)    # B − A in B's frame [m]
ROTATION = _rows(9)    # R, orientation of B in A's frame
SIZE = _rows(1)        # largest full extent of the pair [m]
TOUCH = _rows(1)       # separation up to which the boxes touch [m]: see pose.CONTACT_ULPS
A_FIRST = _rows(1)     # 1.0 where A comes first in the order used for edge axes (see sat)

# sat.query_block.
SEPARATION = _rows(1)  # signed separation [m]
AXIS = _rows(1)        # winning axis: 0–2 faces of A, 3–5 faces of B, 6 + 3 i + j for a_i × b_j
GRAZING = _rows(1)     # 1.0 where rounding of an edge axis may matter: see `grazing`
FACE = _rows(1)        # best face axis, 0–5, whatever wins
NORMAL = _rows(3)      # winning axis, unit, from A to B, in A's frame

# outline.outline_block. "Half extents" below are those of the bounding box chosen.
INVERSE = _rows(9)     # 1 / R
CENTRE_A = _rows(3)    # A's centre in B's frame [m]
CENTRE_B = _rows(3)    # B's centre in A's frame [m]
LOW_A = _rows(3)       # bounding box of A∩B in A's frame [m]
HIGH_A = _rows(3)
LOW_B = _rows(3)       # and in B's, from B's centre
HIGH_B = _rows(3)
# Sums over what is left of the four edges along each axis of a box: lengths [m], lengths times
# twice the middle along the axis [m²], and lengths with the signs of the other two axes.
SUMS_A = _rows(12)
SUMS_B = _rows(12)
IN_B = _rows(1)        # 1.0 where the frame chosen is B's
MIDDLE = _rows(3)      # middle of the bounding box, in its frame [m]
HALF = _rows(3)        # its half extents [m]
INSIDE = _rows(3)      # a point inside A∩B, in that frame [m]

# sites.describe_block and centroid_block, then mlp.
NORMALS = _rows(9)     # the other box's axis f in the frame chosen: 3 f + component
OFFSETS = _rows(3)     # middle of the bounding box along axis f, from the other box's centre [m]
OTHER = _rows(3)       # the other box's half extents [m]
CENTROID = _rows(3)    # the network's answer, from the cube's middle
IN_RANGE = _rows(1)    # 1.0 where the network may be asked
POINT = _rows(3)       # contact point in A's frame [m]
WORLD_NORMAL = _rows(3)  # both in the common frame
WORLD_POINT = _rows(3)

# Signs, written once by `new_work`: of lane i, where lanes are pairs and where they are edges.
MINUS = _rows(1)
PLUS = _rows(1)
EVEN_ODD = _rows(1)    # −, +, −, +
HALVES = _rows(1)      # −, −, +, +

# overlap.centroid, one pair at a time: 8 corners, two polygons to clip from one to the other, each
# with room for a quadrilateral clipped by six planes, and a triangle; all as u, v, w.
CORNERS = _row * LANES
_POLYGON = 3 * 12
POLYGONS = (CORNERS + 3 * 8, CORNERS + 3 * 8 + _POLYGON)
TRIANGLE = CORNERS + 3 * 8 + 2 * _POLYGON

EXACT_ANSWERS = TRIANGLE + 3 * 3  # mlp: single calls outside the range so far

WORK_SIZE = EXACT_ANSWERS + 1


CACHE_LINE = 64
"""Bytes. Rows that begin with one let each vector be loaded from one: a batch takes 4 % less."""


def aligned(values: np.ndarray) -> np.ndarray:
    """A copy whose memory begins with a cache line."""
    room = np.zeros(values.nbytes + CACHE_LINE, dtype=np.uint8)
    first = -room.ctypes.data % CACHE_LINE
    copy = room[first:first + values.nbytes].view(values.dtype)
    copy[:] = values
    return copy


def new_work() -> np.ndarray:
    """Scratch memory for one block."""
    work = aligned(np.zeros(WORK_SIZE))
    work[MINUS:MINUS + LANES] = -1.0
    work[PLUS:PLUS + LANES] = 1.0
    work[EVEN_ODD:EVEN_ODD + SINGLE] = (-1.0, 1.0, -1.0, 1.0)
    work[HALVES:HALVES + SINGLE] = (-1.0, -1.0, 1.0, 1.0)
    return work


OK, BAD_POSE_A, BAD_POSE_B, BAD_SIZE_A, BAD_SIZE_B = range(5)
"""Values of FAULT, in the order in which they are looked for."""
