# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the moving picture shows, read from its pixels, and the figures in sentences."""
from __future__ import annotations

import re
import runpy
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from box_contact_ros.view.style import CONTACT

ROOT = Path(__file__).resolve().parents[2]
TILT = ROOT / 'docs' / 'figures' / 'tilt.gif'
RADIUS = 5  # of the contact's disc, and more than half the width of what else has its colour [px]


def discs() -> list[tuple[float, float] | None]:
    """Return where the disc is in each picture [px], as the middle of what is as round as it."""
    with pytest.importorskip('PIL.Image').open(TILT) as image:
        pictures = []
        for number in range(image.n_frames):
            image.seek(number)
            pictures.append(np.asarray(image.convert('RGB'))[:320].astype(int))  # the side view
    found: list[tuple[float, float] | None] = []
    for scene in pictures:
        alike = np.abs(scene - CONTACT).max(axis=2) < 20
        # A pixel stays if all those up to RADIUS beside, above and below it are alike.
        inside = alike.copy()
        for shift, axis in product(range(1, RADIUS + 1), (0, 1)):
            inside &= np.roll(alike, shift, axis) & np.roll(alike, -shift, axis)
        rows, columns = np.nonzero(inside)
        found.append((columns.mean(), rows.mean()) if len(rows) else None)
    return found


def test_an_eye_can_follow_the_point() -> None:
    """From picture to picture the disc moves less than 40 px, and it crosses the stack."""
    seen = [disc for disc in discs() if disc]
    places = np.array(seen)
    assert len(seen) > 30 and np.ptp(places[:, 0]) > 250
    assert np.abs(np.diff(places[:, 0])).max() < 40
    assert np.ptp(places[:, 1]) < 3  # all are discs on the stack


WRITTEN = re.compile(r'```.*?```|`[^`]*`|<!-- table .*?<!-- end of table -->|'
                     r'<!--figure:.*?<!--end-->|(?<=\])\([^)]*\)|^\|.*?$|\{[^{}]*\}',
                     re.DOTALL | re.MULTILINE)
"""What is no prose, or what a program fills in: code, tables, figures, links, fields."""
NAMES = re.compile(
    r'ROS 2|C\+\+17|Python \S+ to [\d.]+|Apache-2\.0|MuJoCo 4\.0\.0|Pentium IV of 1\.5 GHz|'
    r'(?i:tables?|figures?|section|part|\[issue) \d+(?: (?:and|to) \d+)?|'
    r', \d{4}\)|\d+-\d+-\d+-\d+|^#* ?\d+\. ', re.MULTILINE)
"""Names with digits: of versions, machines, tables, years, networks."""
NUMBER = re.compile(r'(?<![\w.])\d(?:[\w.,/⁰-⁹⁻-]*[\w⁰-⁹])?'
                    r'(?:\s?(?:[%°]|(?:[kmµn]?m/s|rad/s|[kµm]?m|rad|[µmn]?s|Hz|[MG]B|t|bits|minutes)'
                    r'\b))?')
"""A number with its unit."""
KNOWN = {
    'README.md': {'downloads, which no report measures': '560 MB, 1 GB'},
    'docs/results/README.md': {'a rate': '1,000 Hz'},
    'pages/accuracy.md': {'definitions': '99th, 99 %, 1e-6 %, 6°, 0.1 %, 70 %'},
    'pages/distance.md': {'definitions': '1, 64 bits, 2⁻⁵³, 1e10 m'},
    'pages/frontier.md': {'two readings of a clock, which no CSV holds': '0.05 µs',
                          'what is compared': '24-24, 19, 768',
                          'statistics': '1,000, 4th, 17th, 95, 100'},
    'pages/landing.md': {
        'the landings': '1.25°, 3°, 0.6 m, 2 ms, 40, 20 t, 36, 0.5, 0, 1°, 0.47°, 0.5 ms',
        'limits': '15 s, 10 mm/s, 3 s, 10 s, 5 s, 0.3 mm/s, 1e-6, 0.06°, 1 %, 20 mm',
        'targets': '1e-4 mm/s, 1e-5 mm/s, 0.3 %, 50 Hz, 0.01°, 200 Hz, 0.003°, 1000 Hz, 2026',
        'an example of a limit': '12 mm, 0.48 m/s, 5 ms, 7.8 mm'},
    'pages/motion.md': {'definitions': '0, 1, 1e-6 m, 64 bits, 1 mm, 1e-3',
                        'constants of Box3D and FCL': '5 mm, 1e-4'},
    'pages/named_failures.md': {'tolerances of the verdict': '60, 1e-6, 6 %, 1e-12'},
    'pages/native.md': {'statistics': '98 %', 'set-up': '0, 20, 1 m'},
    'pages/scenes.md': {'the walls': '1 m, 0.1 mm'},
    'pages/searched.md': {'the search': '20,000, 500, 60, 1e-12'},
    'pages/speed.md': {'the step': '1/60 s'},
    'pages/stability.md': {'limits of a wrong answer': '60, 16, 1e-12, 1e-10, 1e-9, 1e-6',
                           'the poses': '1e-16, 1e-3, 1,000, 100,000,000'},
    'pages/stacks.md': {'limits of at rest, fallen and stays': '1 mm/s, 45°, 5 mm, 0.5°, 1 mm',
                        'steps': '1 ms, 16.7 ms, 0.1 ms, 1/60 s, 4, 2 s',
                        'the scenes': '150, 220 rad/s, 2.5 km',
                        'of a sub-step that no CSV holds': '1.6 mm/s'},
    'pages/committee.md': {'the patterns': '2,000 mm, 0.02 rad'},
    'pages/figure_10.md': {'the depth': '1 mm'},
    'pages/search.md': {'ranges that are searched': '2,000, 6, 24, 0.003, 1, 0, 0.97, 0.1, 3',
                        'the limit of the picture': '1.5 rad'},
    'pages/soup_errors.md': {'the patterns': '2,000 mm, 1 mm', "the paper's": '12'},
    'pages/table_1.md': {'a whole turn': '2π'},
    'pages/table_3.md': {'the patterns': '2, 1 mm, 1e-6, 1e-3 rad, 6'},
}
"""Numbers in sentences that are not measured, or have no CSV, with the reason."""
SENTENCES = [page for page in (
    ROOT / 'README.md', *sorted((ROOT / 'docs' / 'results').glob('*.md')),
    *sorted((ROOT / 'benchmarks').rglob('pages/*.md')))
    if not re.search('^Made by `python -m|^- machine: ', page.read_text('utf-8'), re.MULTILINE)]
"""The pages that no program writes, and the templates of the others."""


def numbers_of(text: str) -> set[str]:
    """Return the numbers in sentences that somebody typed, with their units."""
    prose = NAMES.sub(' ', WRITTEN.sub(' ', text))
    return {' '.join(number.split()) for number in NUMBER.findall(prose)}


@pytest.mark.parametrize('page', SENTENCES, ids=lambda page: page.name)
def test_measured_figures_are_filled_in(page: Path) -> None:
    """No measured figure is typed into a sentence: `docs/tables.py` or the report fills it in."""
    name = page.relative_to(ROOT).as_posix()
    known = KNOWN.get(name, KNOWN.get(f'pages/{page.name}', {}))
    allowed = {number for numbers in known.values() for number in numbers.split(', ')}
    assert numbers_of(page.read_text('utf-8')) == allowed, 'put it into a marker of docs/tables.py'


def test_a_typed_figure_is_found() -> None:
    text = '<!--figure:late-->16 of 54<!--end--> in `7 s`, [page](8.md): 1.2 ms, 3,000 or 45 %.'
    assert numbers_of(text) == {'1.2 ms', '3,000', '45 %'}


def test_a_void_run_of_the_bench_is_shown_as_void(tmp_path: Path, monkeypatch) -> None:
    bench = runpy.run_path(str(ROOT / 'docs' / 'tables.py'))['bench']
    page = (ROOT / 'docs' / 'results' / 'bench_exact.md').read_text('utf-8')
    (tmp_path / 'bench_exact.md').write_text(page.replace('\n\nquiet:', '\n\nvoid: late\n\nquiet:'))
    monkeypatch.setitem(bench.__globals__, 'RESULTS', tmp_path)
    assert bench().endswith(' is void: late.')


def test_no_figure_begins_a_line() -> None:
    """A comment there begins a block of HTML, which would end the paragraph."""
    pages = [ROOT / 'README.md', *(ROOT / 'docs').rglob('*.md')]
    marked = [page for page in pages if '<!--figure:' in page.read_text('utf-8')]
    assert len(marked) > 2
    assert not any(re.search(r'^\s*<!--figure:', page.read_text('utf-8'), re.MULTILINE)
                   for page in marked)
