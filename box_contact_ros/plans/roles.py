# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which column of a table has which role: words and suffixes as data, and what is open.

Three of a kind are taken together, from one line of LINES, and are never mixed. What two columns
may mean, or none, is asked by one message with options that can be typed.
"""
from __future__ import annotations

import math
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import NamedTuple

from ..solver.checks import short_repr
from .table import Table

UNITS = {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3, 'in': 0.0254, 'ft': 0.3048}
MASS_UNITS = {'kg': 1.0, 'g': 1e-3, 't': 1e3, 'lb': 0.45359237}
TURNS = {'degrees': math.pi / 180.0, 'radians': 1.0}
SUFFIXES = {**{unit: unit for unit in (*UNITS, *MASS_UNITS)}, 'lbs': 'lb', 'inch': 'in',
            'inches': 'in', 'feet': 'ft', 'deg': 'degrees', 'degree': 'degrees',
            'degrees': 'degrees', 'rad': 'radians', 'radian': 'radians', 'radians': 'radians'}
"""The last word of a column's name that is a unit."""
ORIGINS, FRAMES, UPS = ('centre', 'corner'), ('own', 'one'), ('x', 'y', 'z')
SIZE, PLACE = ('length', 'width', 'height'), ('x', 'y', 'z')
LEAST, GREATEST = ('x_min', 'y_min', 'z_min'), ('x_max', 'y_max', 'z_max')
QUATERNION, ANGLES = ('qx', 'qy', 'qz', 'qw'), ('roll', 'pitch', 'yaw')


class Line(NamedTuple):
    """Columns that are taken together, by their words."""

    kind: str
    """Of a size: along the axes of the `plan` or of the `file`. Of a place: `centre`, `corner`,
    `corners`, or '' where that is asked."""
    words: tuple[str, ...]


def _lines(kind: str, formats: str, *lines: Sequence[str]) -> list[Line]:
    """Return a line for each format and each three words; `{}1+{}2` are six words."""
    return [Line(kind, tuple(one.format(word) for one in form.split('+') for word in line))
            for line in lines for form in formats.split()]


AXES, PLACES_OF_A_LIST = ('x', 'y', 'z'), ('0', '1', '2')
SIDES = [line.split() for line in (
    'length width height', 'l w h', 'width depth height', 'w d h', 'length depth height', 'l d h',
    'length width depth', 'l w d', 'länge breite höhe', 'laenge breite hoehe',
    'longueur largeur hauteur', 'largo ancho alto')]
"""Along x, y and up: where there is no height, depth is up."""
LINES = {
    'size': [
        *_lines('plan', '{} dim{} dimension{} dimensions{} size{} extent{} extents{}', *SIDES),
        *_lines('file', 'l{} d{} s{} size{} {}size dim{} {}dim dimension{} dimensions{} extent{} '
                        'extents{} length{} {}length', AXES),
        *_lines('file', 'size{} dim{} dims{} dimension{} dimensions{} extent{} extents{} lwh{}',
                PLACES_OF_A_LIST)],
    'place': [
        *_lines('centre', '{} c{} centre{} {}centre center{} {}center', AXES),
        *_lines('centre', 'centre{} center{}', PLACES_OF_A_LIST),
        *_lines('corner', '{}min min{} corner{} {}corner leastcorner{} lowercorner{}', AXES),
        *_lines('corner', 'min{} corner{}', PLACES_OF_A_LIST),
        *_lines('corners', '{}min+{}max min{}+max{} {}1+{}2 {}start+{}end start{}+end{} '
                           '{}from+{}to', AXES),
        *_lines('corners', 'min{}+max{}', PLACES_OF_A_LIST),
        *_lines('', 'pos{} {}pos position{} {}position coord{} {}coord coords{} coordinate{} '
                    '{}coordinate coordinates{} loc{} location{} at{} place{} placement{} '
                    'origin{} {}origin pose{} poseposition{} offset{} {}offset', AXES),
        *_lines('', 'pos{} position{} coord{} coords{} coordinate{} coordinates{} loc{} location{} '
                    'at{} place{} placement{} origin{} offset{} xyz{}', PLACES_OF_A_LIST)],
    'turn': _lines('', 'q{} quat{} quaternion{} orientation{} rotation{} poseorientation{}',
                   'xyzw'),
}
HOLDERS = ('container', 'pallet', 'bin', 'truck', 'trailer', 'vehicle', 'uld', 'lorry', 'wagon')
ROOMS = ('container', 'containers', 'bin', 'bins')
"""What has an inner size, where it has a size: that of a pallet is its own."""
WORDS = {
    'name': 'name label id sku item box carton article artikel code partno ean barcode reference '
            'ref',
    'mass': 'mass weight gross grossweight grossmass weightgross kg gewicht masse poids peso',
    'limit': 'limit maxload loadlimit maxloadontop maxontop stackinglimit stacklimit maxstackload '
             'maxstackweight maxstackingload maxtopload toploadlimit',
    'friction': 'friction mu μ µ cof frictioncoefficient coefficientoffriction',
    'order': 'order sequence seq step loadorder loadingorder loadsequence loadingsequence '
             'packorder packingorder packingsequence placementorder',
    'container': ' '.join(holder + end for holder in HOLDERS for end in (
        '', 'id', 'no', 'nr', 'name', 'number', 'index', 'code')),
    'fixed': 'fixed static isfixed isstatic',
    'count': 'count quantity qty copies pieces pcs amount',
    **{role: f'{role} {role}angle rotation{role} orientation{role}' for role in ANGLES},
}
RIVALS = {'mass': 'net netweight netmass weightnet tare'}
"""What may have a role as well, so that it is asked."""
NEUTRAL = {'item', 'items', 'box', 'boxes', 'carton', 'cartons', 'goods', 'package', 'parcel',
           'piece', 'product', 'article', 'sku', 'stackable', 'bbox', 'aabb', 'bounds'}
"""Words in front that all rows have in common."""
HARMLESS = {*WORDS['name'].split(), *(
    'group customer customerid client consignee supplier vendor brand orderid orderno colour color '
    'price cost currency note notes comment comments remark remarks description text title '
    'date time timestamp created url image photo country city address invoice volume version seed '
    'sscc layer '
    'runtime duration score objective fitness utilization utilisation fillrate row index gtin upc '
    'author').split()}
"""Columns that decide on nothing here."""
ROLE_OF = {word: role for role, words in WORDS.items() for word in words.split()}
GROUPS = {'size': (SIZE, ('lx', 'ly', 'lz')), 'place': (PLACE, LEAST, LEAST + GREATEST),
          'turn': (QUATERNION,)}
ROLES = tuple(dict.fromkeys([*WORDS, *(
    role for ways in GROUPS.values() for way in ways for role in way)]))
"""What --column gives a column, as in `mass=gross`."""
UNIT_WORDS = ('unit', 'units', 'lengthunit', 'lengthunits', 'dimensionunit', 'uom')
MINE = {*SIZE, 'lx', 'ly', 'lz', 'dx', 'dy', 'dz', *PLACE, *LEAST, *GREATEST}
"""With these names, and one that is `name`, lengths are metres unless told otherwise."""
LONG = 20.0  # half of the boxes are longer only where their unit is not the metre [m]


class Given(NamedTuple):
    """What the caller tells of a table, where the file does not."""

    origin: str | None = None  # one of ORIGINS: what `x y z` are
    unit: str | None = None  # one of UNITS, of all lengths
    container: Sequence[float] | None = None  # (3,) inner size, in the unit of the file
    columns: Mapping[str, str] = {}  # which column has a role of ROLES, by role
    ignore: Sequence[str] = ()  # columns, or the first words of dotted ones, that decide on nothing
    up: str | None = None  # one of UPS: the axis of the file that is up
    turns: str | None = None  # one of TURNS
    frames: str | None = None  # one of FRAMES: whether each container has a frame of its own

    def check(self) -> None:
        """Raise ValueError for what is none of the words."""
        for name, words in (('origin', ORIGINS), ('unit', UNITS), ('up', UPS), ('turns', TURNS),
                            ('frames', FRAMES)):
            value = getattr(self, name)
            if value is not None and value not in words:
                raise ValueError(f'{name} must be one of {", ".join(words)}, not '
                                 f'{short_repr(value)}')
        for role in self.columns:
            if role not in ROLES:
                raise ValueError(f'columns: {short_repr(role)} is none of {", ".join(ROLES)}')


NOTHING = Given()


class Word(NamedTuple):
    """A column's name: what is in front of it, its words as one, and its unit."""

    front: str
    key: str
    unit: str | None


def word_of(name: str) -> Word:
    """Return the parts of a column's name: of `item.posX (mm)` item, posx, mm."""
    spaced = re.sub(r'(?<=[a-z0-9])(?=[A-Z])', ' ', name).replace('°', ' deg ')
    words = re.findall(r'[^\W_]+', spaced.lower())
    unit = SUFFIXES.get(words[-1]) if len(words) > 1 else None
    words = words[:-1] if unit else words
    front = 0
    while front < len(words) - 1 and words[front] in NEUTRAL:
        front += 1
    return Word(' '.join(words[:front]), ''.join(words[front:]), unit)


@dataclass(frozen=True)
class Taken:
    """Which columns have which role, and how their numbers are read."""

    size: tuple[str, ...] = ()
    is_along_file: bool = True  # whether sizes are along the file's axes; else along x, y and up
    place: tuple[str, ...] = ()  # three columns, or six of two corners
    is_corner: bool = False
    turn: tuple[str, ...] = ()  # four columns of a quaternion
    single: Mapping[str, str] = field(default_factory=dict)  # the columns of other roles
    room: tuple[str, ...] = ()
    is_room_along_file: bool = True
    unit: str = 'm'
    mass_unit: str = 'kg'
    turns: str = 'degrees'
    up: str = 'z'
    quiet: frozenset[str] = frozenset()  # other columns that decide on nothing

    @property
    def columns(self) -> tuple[str, ...]:
        """All columns that have a role."""
        return (*self.size, *self.place, *self.turn, *self.single.values(), *self.room)

    def text(self, origin: str = '') -> str:
        """Return a line on what was taken."""
        kind = 'two corners' if len(self.place) > 3 else (
            'least corners' if self.is_corner else 'centres')
        way = LEAST + GREATEST if len(self.place) > 3 else PLACE
        parts = [f'{_from(way, self.place)} [{self.unit}], {kind}']
        parts += [_from(SIZE, self.size)] if self.size else []
        parts += [f'up is {self.up}', *([_from(QUATERNION, self.turn)] if self.turn else [])]
        for role, column in self.single.items():
            unit = f' [{self.mass_unit}]' if role in ('mass', 'limit') else (
                f' [{self.turns}]' if role in ANGLES else '')
            parts.append(_from((role,), (column,)) + unit)
        parts += [f'container from {" ".join(self.room)}'] if self.room else []
        return f'read{origin}: {"; ".join(parts)}'


def _from(roles: Sequence[str], columns: Sequence[str]) -> str:
    same = [word_of(name).key for name in columns] == [word_of(role).key for role in roles]
    return ' '.join(columns) if same else f'{" ".join(roles)} from {" ".join(columns)}'


def words_of(option: str, values: Iterable[str]) -> list[str]:
    """Return an option with each of its values, as they are typed."""
    return [word for value in values for word in (option, value)]


class Finder:
    """The roles of a table's columns, and what is open about them."""

    def __init__(self, table: Table, given: Given) -> None:
        """Find them. Raises ValueError for what contradicts the file."""
        self.table, self.given = table, given
        self.questions: list[str] = []
        self.options: list[str] = []
        told = {column: role for role, column in given.columns.items()}
        for column in told:
            if column not in table.columns:
                raise ValueError(f'no column is called {short_repr(column)}')
        self.words = {name: word_of(name) for name in table.columns
                      if name in told or not is_named(name, given.ignore)}
        for name, role in told.items():
            self.words[name] = Word('', role.replace('_', ''), self.words[name].unit)
        self.taken = self._taken()

    def _taken(self) -> Taken:
        given = self.given
        size, place, turn = (self._one(group) for group in GROUPS)
        single = self._singles()
        if place and place.kind == 'corners' and size:
            self.ask(f'which tells the size, {" ".join(size.words)} or two corners?',
                     *words_of('--ignore', size.words))
            size = None
        kind = place.kind if place else ''
        if place and given.origin and kind in ('corner', 'corners') and given.origin != 'corner':
            raise ValueError(f"origin must not be 'centre': {' '.join(place.words)} are corners")
        room = self._room()
        taken = Taken(
            size=size.words if size else (), is_along_file=not size or size.kind == 'file',
            place=place.words if place else (), turn=turn.words if turn else (), single=single,
            is_corner=(given.origin or kind) in ('corner', 'corners'), up=given.up or 'z',
            room=room.words if room else (), is_room_along_file=not room or room.kind == 'file',
            mass_unit=self._unit(MASS_UNITS, filter(None, map(single.get, ('mass', 'limit'))),
                                 'kg', None))
        self._ask_missing(size or kind == 'corners', place, taken)
        angles = [single[role] for role in ANGLES if role in single]
        if turn and angles:
            self.ask(f'which is the turn, {" ".join(turn.words)} or {" ".join(angles)}?',
                     *words_of('--ignore', angles))
        taken = replace(taken, unit=self._length_unit(taken), turns=self._angle_unit(angles))
        is_low = kind == 'centre' and self.questions and place and min(
            self.table.numbers(place.words['xyz'.index(taken.up)]), default=1.0) <= 0.0
        if place and not given.origin and (not kind or is_low):
            self.ask_origin(place.words)
        return taken

    def ask(self, question: str, *options: str) -> None:
        """Add a question, with options as they are typed."""
        self.questions.append(question)
        self.options += options

    def check(self) -> None:
        """Raise ValueError with all that is open, and options that answer it."""
        if self.questions:
            hint = f'; if it is so, add {shlex.join(self.options)}' if self.options else ''
            raise ValueError(f'{"; ".join(self.questions)}{hint}')

    def ask_origin(self, place: Sequence[str]) -> None:
        """Ask what the columns of a place are."""
        self.ask(f'are {" ".join(place)} centres or least corners?', '--origin', 'corner')

    def _lines(self, group: str) -> list[Line]:
        """Return the lines of a group whose columns are all there, with these; '' is another."""
        by_word: dict[str, dict[str, list[str]]] = {}
        units = UNITS if group != 'turn' else ()
        for name, word in self.words.items():
            if name not in self.table.above and (word.unit is None or word.unit in units):
                by_word.setdefault(word.front, {}).setdefault(word.key, []).append(name)
        return [Line(line.kind, tuple(columns)) for line in LINES[group]
                for words in by_word.values() if all(word in words for word in line.words)
                for columns in product(*(words[word][:2] for word in line.words))]

    def _one(self, group: str) -> Line | None:
        """Return the one line of a group; ask if there are several."""
        found = self._lines(group)
        told = {name for name, role in zip(self.given.columns.values(), self.given.columns)
                if any(role in way for way in GROUPS[group])}
        if told:
            found = [line for line in found if told <= {*line.words}]
        found = [line for line in found
                 if not any({*line.words} < {*other.words} for other in found)]
        if len(found) > 1:
            ways = ' or '.join(' '.join(line.words) for line in found)
            others = {name for line in found[1:] for name in line.words} - {*found[0].words}
            self.ask(f'which is the {group}, {ways}?', *words_of('--ignore', sorted(others)))
        return found[0] if found else None

    def _singles(self) -> dict[str, str]:
        """Return the column of each role that one column has; ask if there are several."""
        found: dict[str, list[str]] = {}
        for name, word in self.words.items():
            role = ROLE_OF.get(word.key)
            units = (MASS_UNITS if role in ('mass', 'limit') else
                     TURNS if role in ANGLES else ())
            if role and name not in self.table.above and (
                    word.unit is None or word.unit in units):
                found.setdefault(role, []).append(name)
        for role, columns in found.items():
            if told := self.given.columns.get(role):
                columns[:] = [told]
        if names := found.get('name'):  # which of them decides on nothing
            known = WORDS['name'].split()
            names[:] = sorted(names, key=lambda name: known.index(self.words[name].key))[:1]
        for role, words in RIVALS.items():
            rivals = [name for name, word in self.words.items() if word.key in words.split()]
            if rivals and role not in found:
                self.ask(f'is {rivals[0]} the {role}?', *words_of(
                    '--column', [f'{role}={rivals[0]}']), *words_of('--ignore', rivals[1:]))
            elif rivals and role not in self.given.columns:
                found[role] += rivals
        for role, columns in found.items():
            if len(columns) > 1:
                self.ask(f'which is the {role}, {" or ".join(columns)}?',
                         *words_of('--ignore', columns[1:]))
        return {role: columns[0] for role, columns in found.items()}

    def _room(self) -> Line | None:
        """Return the columns of a container's inner size."""
        by_word = {}
        for name in self.words:
            path, key = self.table.above.get(name, ('', name))
            by_word[word_of(f'{path.rpartition(".")[2]}.{key}').key] = name
        lists = _lines('file', '{}', PLACES_OF_A_LIST)
        return next((Line(line.kind, tuple(by_word[room + word] for word in line.words))
                     for room in ROOMS for line in (*LINES['size'], *lists)
                     if all(room + word in by_word for word in line.words)), None)

    def _unit(self, units: Mapping[str, float], columns: Iterable[str], default: str,
              told: str | None) -> str:
        """Return the one unit of columns; ask if it is not one."""
        columns = [*columns]
        found = sorted({unit for name in columns if (unit := self.words[name].unit)})
        if len(found) > 1 or (told and found and found != [told]) or (
                units is MASS_UNITS and found not in ([], ['kg'])
                and not all(self.words[name].unit for name in columns)):
            raise ValueError(f'{" ".join(columns)} do not have one unit')
        return told or (found[0] if found else default)

    def _length_unit(self, taken: Taken) -> str:
        columns = (*taken.size, *taken.place, *taken.room)
        unit = self._unit(UNITS, columns, '', self.given.unit)
        for name, word in self.words.items():  # such as "units": "mm"
            values = {*map(str, self.table.values(name))} if word.key in UNIT_WORDS else set()
            unit = unit or next((SUFFIXES.get(value, '') for value in values if len(values) == 1),
                                '')
        if unit in UNITS:
            return unit
        names = {name.lower() for name in self.table.columns}
        sizes = [self.table.numbers(name) for name in taken.size or taken.place[-3:]]
        longest = sorted(max(row) for row in zip(*sizes) if not any(map(math.isnan, row)))
        middle = longest[len(longest) // 2] if longest else 0.0
        if 'name' in names and {name.lower() for name in (*taken.size, *taken.place)} <= MINE and (
                middle <= LONG):
            return 'm'
        self.ask('in which unit are lengths (m, cm, mm, in, ft)?', '--unit',
                 'mm' if middle > 100.0 else 'cm' if middle > LONG / 4.0 else 'm')
        return 'm'

    def _angle_unit(self, columns: Sequence[str]) -> str:
        unit = self._unit(TURNS, columns, '', self.given.turns)
        values = [value for name in columns for value in self.table.numbers(name)]
        if unit or not any(values):
            return unit or 'degrees'
        if any(abs(value) > 2.0 * math.pi for value in values):
            return 'degrees'
        self.ask(f'is {" ".join(columns)} in degrees or radians?', '--turns', 'radians')
        return 'degrees'

    def _ask_missing(self, size: object, place: object, taken: Taken) -> None:
        """Ask for the columns of a size or place that none has, with three that may have it."""
        threes: dict[tuple[str, ...], list[str]] = {}
        for name in self.words:
            if name not in self.table.above and name not in taken.columns and not any(
                    map(math.isnan, self.table.numbers(name))):
                threes.setdefault(tuple(re.findall(r'[^\W_]+', name)[:-1]), []).append(name)
        whole = [names for names in threes.values() if len(names) == 3]
        rest = [name for names in threes.values() for name in names]
        whole = whole or [rest] * (len(rest) == 3)
        hint = f' (numbers are in {", ".join(rest)})' if rest else ''
        for there, what, roles, is_size in (
                (size, 'the size', SIZE, True),
                (place, 'the least corner, or x y z of the centre', LEAST, False)):
            if not there:
                some = [names for names in whole if size or place or is_size == all(
                    value > 0.0 for name in names for value in self.table.numbers(name))][:1]
                self.ask(f'which columns are {what} ({" ".join(roles)})?{hint}', *(
                    word for names in some for word in words_of(
                        '--column', map('='.join, zip(roles, names)))))


def is_named(name: str, some: Iterable[str]) -> bool:
    """Return whether a column has one of some names, or begins with one and a dot."""
    return any(name == other or name.startswith(f'{other}.') for other in some)


def is_harmless(name: str, *, is_above: bool) -> bool:
    """Return whether a column of this name decides on nothing; above a list it may be its name."""
    key = word_of(name).key
    return key in HARMLESS or is_above and ROLE_OF.get(key) == 'container'
