# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Weights files: what is shipped is what its card says, and anything damaged is refused."""
from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors import SafetensorError, safe_open
from safetensors.numpy import load, load_file, save_file

from box_contact_ros import ContactSolver
from box_contact_ros.evidence.contestants.paper import _networks
from box_contact_ros.evidence.reports.paper import paper_tables
from box_contact_ros.resources import resource_path
from box_contact_ros.solver.weights_file import (
    CARD_FIELDS,
    FILE_LIMIT,
    WeightsError,
    load_weights,
    read_tensors,
    save_weights,
    tensors_digest,
)
from box_contact_ros.evidence.training.paper_recipe import dataset
from box_contact_ros.evidence.training.paper_recipe.errors import (
    errors_of,
    figures,
    figures_by_part,
    predict,
    wrapped,
)

WIDTHS = (6, 5, 3, 4)
SHIPPED = ('paper', 'paper-continuous', 'paper-12.192x2.438x2.591')


def layers(seed: int = 0) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(seed)
    return [(rng.normal(size=(b, a)).astype(np.float32), rng.normal(size=b).astype(np.float32))
            for a, b in zip(WIDTHS, WIDTHS[1:])]


def card(**changes: object) -> dict[str, object]:
    return {**dict.fromkeys(CARD_FIELDS, 'x'), 'inputs': {}, 'sizes': [],
            'architecture': list(WIDTHS), **changes}


def tensors() -> dict[str, np.ndarray]:
    return {f'n.{i}.{what}': array for i, pair in enumerate(layers())
            for what, array in zip(('weight', 'bias'), pair)}


def write(path: Path, content: dict[str, np.ndarray], **changes: object) -> Path:
    """Return a weights file whose checksum is right, whatever is in it."""
    text = json.dumps(card(sha256=tensors_digest(content), **changes))
    save_file(content, path, metadata={'card': text})
    return path


@pytest.fixture
def good(tmp_path: Path) -> Path:
    path = tmp_path / 'folder' / 'good.safetensors'
    save_weights(path, {'n': layers()}, card())
    return path


def test_what_was_saved_is_loaded(good: Path) -> None:
    """Weights per layer, then its biases, outputs × inputs row by row."""
    weights = load_weights(good)
    network = weights.networks['n']
    assert network.widths == WIDTHS
    np.testing.assert_array_equal(
        network.packed, np.concatenate([part.ravel() for pair in layers() for part in pair]))
    assert weights.card['sha256'] == tensors_digest(tensors())


def test_saved_weights_are_readable_to_all(good: Path) -> None:
    """As the umask says: installed by root, they are read by everybody."""
    (good.parent / 'plain').write_bytes(b'')
    assert good.stat().st_mode == (good.parent / 'plain').stat().st_mode


def test_forward_is_the_formula(good: Path) -> None:
    """Against float64 NumPy, to the accuracy of float32."""
    network = load_weights(good).networks['n']
    inputs = np.random.default_rng(1).normal(size=(200, 6))
    value = inputs
    for number, (weight, bias) in enumerate(layers()):
        value = value @ weight.T.astype(np.float64) + bias
        if number < 2:
            value = np.tanh(value)
    np.testing.assert_allclose(predict(network, inputs), value, rtol=0, atol=1e-5)
    one = _networks.forward(network.packed, np.array(WIDTHS), inputs[:1].astype(np.float32))
    np.testing.assert_allclose(one[0], value[0], rtol=0, atol=1e-5)


@pytest.mark.parametrize('widths', [[], [6], [6, 5, 4], [6, 5, 3, 5], [6, 0, 4], [6, -5, 3, 4],
                                    [2**62, 4, 1], [5, 6, 3, 4]])
def test_widths_that_do_not_fit(good: Path, widths: list[int]) -> None:
    """No number beyond the parameters is read."""
    network = load_weights(good).networks['n']
    with pytest.raises(ValueError, match='do not fit|wrong shape'):
        _networks.forward(network.packed, np.array(widths, dtype=np.int64),
                          np.zeros((1, 6), dtype=np.float32))


@pytest.mark.parametrize('share', [0.0, 0.02, 0.5, 0.999])
def test_truncated(good: Path, share: float) -> None:
    content = good.read_bytes()
    good.write_bytes(content[:int(share * len(content))])
    with pytest.raises(WeightsError, match='cannot be read'):
        load_weights(good)


def test_every_edited_byte_of_the_tensors(good: Path) -> None:
    """One bit, anywhere in the tensors."""
    content = good.read_bytes()
    begin = 8 + int.from_bytes(content[:8], 'little')
    for place in range(begin, len(content)):
        edited = bytearray(content)
        edited[place] ^= 1 << place % 8
        good.write_bytes(bytes(edited))
        with pytest.raises(WeightsError, match='checksum|not finite'):
            load_weights(good)


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf, 1e5])
def test_values_no_training_gives(tmp_path: Path, value: float) -> None:
    content = tensors()
    content['n.1.weight'][2, 1] = value
    with pytest.raises(WeightsError, match=r'n\.1\.weight holds values that are not finite'):
        load_weights(write(tmp_path / 'x', content))


@pytest.mark.parametrize(('change', 'message'), [
    ({'n.1.weight': np.zeros((3, 4), dtype=np.float32)}, r'n\.1 does not fit its neighbours'),
    ({'n.1.weight': np.zeros(15, dtype=np.float32)}, r'n\.1 does not fit its neighbours'),
    ({'n.2.bias': np.zeros(5, dtype=np.float32)}, r'n\.2 does not fit its neighbours'),
    ({'n.1.bias': None}, r'n\.1 does not fit its neighbours'),
    ({'n.1.weight': None, 'n.1.bias': None}, 'belong to no layer'),
    ({'n.4.bias': np.zeros(4, dtype=np.float32)}, 'belong to no layer'),
    ({'odd': np.zeros(0, dtype=np.float32)}, 'belong to no layer'),
    ({'n.0.bias': np.zeros(5)}, 'is F64, not F32'),
])
def test_shapes_that_are_no_network(tmp_path: Path, change: dict, message: str) -> None:
    content = {**tensors(), **change}
    content = {name: array for name, array in content.items() if array is not None}
    with pytest.raises(WeightsError, match=message):
        load_weights(write(tmp_path / 'x', content))


@pytest.mark.parametrize('architecture', [[6, 5, 4], [6, 5, 3, 3], 5, None])
def test_architecture_of_the_card(tmp_path: Path, architecture: object) -> None:
    with pytest.raises(WeightsError, match='the model card says'):
        load_weights(write(tmp_path / 'x', tensors(), architecture=architecture))


@pytest.mark.parametrize('inputs', [[], 'x', None])
def test_inputs_of_another_kind(tmp_path: Path, inputs: object) -> None:
    with pytest.raises(WeightsError, match='inputs of the model card is no object'):
        load_weights(write(tmp_path / 'x', tensors(), inputs=inputs))


@pytest.mark.parametrize('sizes', [[], {}, None, 5, [5], [None], [[2, 2]], [[2, 2, -1]], ['abc']])
def test_sizes_that_are_none(tmp_path: Path, sizes: object) -> None:
    """The paper's networks are for the boxes of their card."""
    shipped = resource_path('weights', 'paper.safetensors')
    card = {**load_weights(shipped).card, 'sizes': sizes}
    save_file(load_file(shipped), tmp_path / 'x', metadata={'card': json.dumps(card)})
    with pytest.raises(WeightsError, match='no list of three extents'):
        ContactSolver((2, 2, 2), (2, 2, 2), model='paper', weights=str(tmp_path / 'x'))


@pytest.mark.parametrize('text', [None, '', '{', '3', '"name"', json.dumps(CARD_FIELDS), '[]',
                                  '[["name", "a pair"]]', '[' * 200_000])
def test_no_card(tmp_path: Path, text: str | None) -> None:
    metadata = {} if text is None else {'card': text}
    save_file(tensors(), tmp_path / 'x', metadata=metadata)
    with pytest.raises(WeightsError, match='no readable model card'):
        load_weights(tmp_path / 'x')


def test_incomplete_card(tmp_path: Path) -> None:
    """Neither written nor read."""
    short = {name: value for name, value in card().items() if name not in ('seed', 'metrics')}
    with pytest.raises(ValueError, match='lacks seed, metrics'):
        save_weights(tmp_path / 'x', {'n': layers()}, short)
    save_file(tensors(), tmp_path / 'x', metadata={'card': json.dumps(short)})
    with pytest.raises(WeightsError, match='lacks seed, metrics'):
        load_weights(tmp_path / 'x')


def test_number_types_that_numpy_lacks(good: Path) -> None:
    """Such as bfloat16."""
    content = good.read_bytes()
    end = 8 + int.from_bytes(content[:8], 'little')
    header = json.loads(content[8:end])
    header['n.0.bias'].update(dtype='BF16', shape=[10])
    text = json.dumps(header).encode()
    good.write_bytes(len(text).to_bytes(8, 'little') + text + content[end:])
    with pytest.raises(WeightsError, match='cannot be read'):
        load_weights(good)


# --- the reader beside the library ----------------------------------------------------------------


@pytest.mark.parametrize('path', sorted(resource_path('weights').iterdir()), ids=lambda p: p.stem)
def test_the_reader_reads_what_the_library_reads(path: Path) -> None:
    """Every shipped file: names, shapes, bits and metadata."""
    found, metadata = read_tensors(path.read_bytes())
    want = load_file(path)
    assert set(found) == set(want)
    for name, array in want.items():
        assert found[name].dtype == array.dtype and found[name].shape == array.shape
        assert found[name].tobytes() == array.tobytes()
    with safe_open(path, framework='numpy') as file:
        assert metadata == file.metadata()


def with_header(content: bytes, change: Callable[[dict[str, Any]], object] | str) -> bytes:
    """Return a file whose header is changed, or is this text."""
    end = 8 + int.from_bytes(content[:8], 'little')
    if isinstance(change, str):
        text = change.encode()
    else:
        header = json.loads(content[8:end])
        change(header)
        text = json.dumps(header).encode()
    return len(text).to_bytes(8, 'little') + text + content[end:]


BAD_HEADERS = {
    'no JSON': '{"n.0.bias"', 'no object': '[1, 2]', 'a number': '3', 'nothing': '',
    'nested deeply': '[' * 100_000,
    'no field': lambda header: header['n.0.bias'].pop('shape'),
    'no entry': lambda header: header.update({'n.0.bias': 4}),
    'overlap': lambda header: header['n.0.bias'].update(data_offsets=[4, 24]),
    'a hole': lambda header: header.pop('n.0.bias'),
    'reversed': lambda header: header['n.0.bias'].update(data_offsets=[20, 0]),
    'negative': lambda header: header['n.0.bias'].update(data_offsets=[-20, 0]),
    'negative shape': lambda header: header['n.0.bias'].update(shape=[-5]),
    'two negative ones': lambda header: header['n.0.weight'].update(shape=[-5, -6]),
    'fractions': lambda header: header['n.0.bias'].update(shape=[5.0]),
    'truth': lambda header: header['n.0.bias'].update(shape=[5, True]),
    'beyond 64 bits': lambda header: header['n.0.bias'].update(shape=[0, 2**70]),
    'another size': lambda header: header['n.0.bias'].update(shape=[6]),
    'two thousand dimensions': lambda header: header['n.0.bias'].update(shape=[2**40] * 2000 + [0]),
    'three offsets': lambda header: header['n.0.bias'].update(data_offsets=[0, 20, 40]),
    'another kind': lambda header: header['n.0.bias'].update(dtype='F64'),
    'beyond the end': lambda header: header.update(
        {'z': {'dtype': 'F32', 'shape': [1], 'data_offsets': [276, 280]}}),
}


@pytest.mark.parametrize('change', BAD_HEADERS.values(), ids=BAD_HEADERS)
def test_bad_headers(good: Path, change: Callable[[dict[str, Any]], object] | str) -> None:
    """The library refuses them, too."""
    good.write_bytes(with_header(good.read_bytes(), change))
    with pytest.raises(WeightsError, match='cannot be read'):
        load_weights(good)
    with pytest.raises(SafetensorError):
        load_file(good)


@pytest.mark.parametrize('tail', [b'x', b'four'])
def test_nothing_stands_after_the_tensors(good: Path, tail: bytes) -> None:
    good.write_bytes(good.read_bytes() + tail)
    with pytest.raises(WeightsError, match='does not end with the last tensor'):
        load_weights(good)


def test_a_file_of_any_size_is_not_read(good: Path) -> None:
    """Sparse, so that the test is quick."""
    with good.open('ab') as file:
        file.truncate(FILE_LIMIT + 1)
    with pytest.raises(WeightsError, match='larger than'):
        load_weights(good)


def test_every_edited_byte_of_the_header(good: Path) -> None:
    """What is still read is what the library reads."""
    content = good.read_bytes()
    read = 0
    for place in range(8 + int.from_bytes(content[:8], 'little')):
        edited = bytearray(content)
        edited[place] ^= 1 << place % 7
        try:
            found, _ = read_tensors(bytes(edited))
        except (ValueError, TypeError, LookupError, AttributeError):
            continue
        want = load(bytes(edited))
        assert {name: array.tobytes() for name, array in found.items()} == {
            name: array.tobytes() for name, array in want.items()}
        read += 1
    assert read > 100  # a letter of the card or of a name


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(WeightsError, match='does not exist'):
        load_weights(tmp_path / 'x')
    with pytest.raises(WeightsError, match='cannot be read'):
        load_weights(tmp_path)
    save_file({}, tmp_path / 'y', metadata={'card': json.dumps(card(sha256=tensors_digest({})))})
    with pytest.raises(WeightsError, match='holds no network'):
        load_weights(tmp_path / 'y')


# --- errors ---------------------------------------------------------------------------------------


def test_errors_are_wrapped() -> None:
    """−π and π are one direction; the sign of a small error stays."""
    errors = wrapped(np.array([0.0, 2 * np.pi, -2 * np.pi, np.pi, -np.pi, 3.0 - -3.0, -0.1, 0.1]))
    np.testing.assert_allclose(
        errors, [0, 0, 0, -np.pi, -np.pi, 6.0 - 2 * np.pi, -0.1, 0.1], atol=1e-15)
    assert figures(np.array([[3.0, -4.0], [0.0, 0.0]])) == {'ME': -0.25, 'MAE': 1.75, 'RMSE': 2.5}


# --- what is shipped ------------------------------------------------------------------------------


@pytest.mark.parametrize('name', SHIPPED)
def test_shipped_weights_are_what_their_card_says(name: str) -> None:
    """All sets made again from the seed give the card's figures; inputs lie in its ranges."""
    weights = load_weights(resource_path('weights', f'{name}.safetensors'))
    assert weights.card['name'] == name
    made = dataset.of_card(weights.card)
    assert set(made) == set(weights.networks) == set(weights.card['metrics'])
    for network, sets in made.items():
        assert set(sets) == set(dataset.SETS)
        for set_name, patterns in sets.items():
            errors = errors_of(weights.networks[network], patterns.inputs, patterns.outputs)
            want = weights.card['metrics'][network][set_name]
            for part, found in figures_by_part(errors).items():
                assert found == pytest.approx(want[part], abs=1e-6)
            for k, entry in enumerate(weights.card['inputs'][network]):
                assert entry['min'] - 1e-9 <= patterns.inputs[:, k].min()
                assert patterns.inputs[:, k].max() <= entry['max'] + 1e-9


def test_shipped_errors_meet_their_bounds() -> None:
    """External validation, Tables 1 and 2: the bounds, and lower without discontinuities."""
    def external(name: str) -> dict[str, dict[str, float]]:
        metrics = load_weights(resource_path('weights', f'{name}.safetensors')).card['metrics']
        return {network: sets['external']['all'] for network, sets in metrics.items()}

    jumps = external('paper')['contact']
    assert jumps['MAE'] <= 0.30 and jumps['RMSE'] <= 0.56
    smooth = external('paper-continuous')
    assert set(smooth) == set(dataset.SUBSETS)
    for errors in smooth.values():
        assert errors['MAE'] < 0.1 * jumps['MAE'] and errors['RMSE'] < 0.1 * jumps['RMSE']
    boxes = external('paper-12.192x2.438x2.591')['contact']
    assert boxes['MAE'] <= 0.30 and boxes['RMSE'] <= 0.56


def test_shipped_sets_have_the_papers_sizes() -> None:
    counts = {name: load_weights(resource_path('weights', f'{name}.safetensors'))
              .card['data']['counts'] for name in SHIPPED}
    assert list(counts['paper'].values()) == [8000, 5000, 75000]
    assert list(counts['paper-continuous'].values()) == [10000, 6000, 50000]
    assert counts['paper-12.192x2.438x2.591'] == counts['paper']


# --- the tables -----------------------------------------------------------------------------------


def cells(page: str) -> list[str]:
    """All cells of the page's tables."""
    return [cell.strip(' *') for line in page.splitlines() if line.startswith('|')
            for cell in line.split('|')]


@pytest.mark.slow
def test_tables_in_the_docs_are_the_shipped_weights(tmp_path: Path) -> None:
    """The first tables of docs/results/paper_tables.md, 1 and 2, are the shipped weights'.

    Figures may differ by their rounding. (The other tables hold times: see test_paper_tables.)
    """
    docs = Path(__file__).parents[2] / 'docs' / 'results' / 'paper_tables.md'
    assert paper_tables.main(['--table', '1', '--table', '2',
                              '--out', str(tmp_path / 'new' / 'page.md')]) == 0
    old, new = cells(docs.read_text()), cells((tmp_path / 'new' / 'page.md').read_text())
    assert len(old) > len(new) > 100
    for before, after in zip(old, new):
        for one, other in zip(before.split(' ± '), after.split(' ± '), strict=True):
            try:
                last = 10.0**-len(one.partition('.')[2])
                assert abs(float(one) - float(other)) < 1.5 * last
            except ValueError:
                assert one == other


def test_paper_program(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
                       tmp_path: Path) -> None:
    """Quick: the paper's figures, a tenth of the patterns, said so. Without weights: one line."""
    assert paper_tables.main(['--quick', '--table', '1', '--table', '2']) == 0
    page = capsys.readouterr().out
    assert '0.5624' in page and '0.4523' in page and '7,500' in page and 'every 10th' in page
    monkeypatch.setattr(paper_tables, 'resource_path', lambda *parts: tmp_path.joinpath(*parts))
    assert paper_tables.main([]) == 1
    assert 'does not exist' in capsys.readouterr().err
