"""The pairs of sizes of a scene file, which is all of it that a training needs."""
from __future__ import annotations

from pathlib import Path

from ..scene.scene_file import read_scene
from .samples import SizePair


def size_pairs(path: Path) -> list[SizePair]:
    """The distinct pairs of sizes [m] of the pairs listed, in the order of their first mention.

    A pair and the same with its boxes swapped count once, and so do boxes that differ only in
    which of their axes is called x, y, z: extents are sorted, longest first. Raises SceneError for
    a file that is no scene.
    """
    scene = read_scene(path)
    sizes = {name: _longest_first(box.size) for name, box in scene.boxes.items()}
    return list(dict.fromkeys(
        (max(sizes[pair.a], sizes[pair.b]), min(sizes[pair.a], sizes[pair.b]))
        for pair in scene.pairs))


def _longest_first(size: tuple[float, ...]) -> tuple[float, float, float]:
    x, y, z = sorted(size, reverse=True)
    return x, y, z
