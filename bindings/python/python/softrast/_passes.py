"""Functions of arrays with their derivatives, for frameworks that keep no state between the passes.

A function has `count` inputs, and `axes`, how many each has; `views` states that all inputs have the views first and may be concatenated;
`keeps` is the number of arrays that the value leaves to the derivatives. `shapes(*inputs)` are those of the value and of what is kept,
`forward(inputs)` is the value and what is kept. `vjp(inputs, kept, upstream, wanted)` are gradients, and `vjp_of_vjp(inputs, kept, upstream,
directions, wanted)` gradients of `sum(direction * vjp)` to the inputs and the upstream: where they are wanted, else None. A direction may be
None.
"""

from __future__ import annotations

import itertools
import threading
import weakref
from collections import deque

import numpy as np

from . import _native, _shapes

# Functions by the names under which ops of torch know them.
_NAMED: weakref.WeakValueDictionary = weakref.WeakValueDictionary()
_numbers = itertools.count()


def named(function):
    """The function, under a name that no other has."""
    function.handle = f"{function.name}-{next(_numbers)}"
    _NAMED[function.handle] = function
    return function


def function(name):
    """The function of this name."""
    found = _NAMED.get(name)
    if found is None:
        raise ValueError(f"there is no function {name}: its renderer is gone, keep it as long as its images")
    return found


# Calls whose findings are kept for the passes back: 20 bytes a face and view for silhouettes, 20 a pixel more for colours.
_RECENT = 8


class Recent:
    """Ops of the latest calls, each with what it found out about its inputs: the passes back of a call need not find it again.

    A call is recognised by the numbers of its inputs, so that nothing but time depends on what is kept.
    """

    def __init__(self):
        self._calls, self._lock = deque(maxlen=_RECENT), threading.Lock()

    def op(self, of, arrays):
        """The op of the call of `of` with these arrays: an earlier one, or a new one."""
        bits = [array.reshape(-1).view(f"i{array.itemsize}") for array in arrays]
        shapes = [(array.shape, array.dtype) for array in arrays]
        with self._lock:
            calls = list(self._calls)
        for owner, known, stored, op in reversed(calls):
            if owner is of and known == shapes and all(map(np.array_equal, bits, stored)):
                return op
        op = of.keeping()
        with self._lock:
            # Copies: callers may write to their arrays.
            self._calls.append((of, shapes, [part.copy() for part in bits], op))
        return op


def _spread(flat, arrays, wanted):
    """The parts of a flat array at the places that are wanted, shaped as the arrays there."""
    found, start = [], 0
    for array, want in zip(arrays, wanted):
        found.append(flat[start:start + array.size].reshape(array.shape) if want else None)
        start += array.size if want else 0
    return found


def _vjp(op, inputs, upstream, wanted):
    return _spread(op.vjp(inputs, upstream, wanted), inputs, wanted)


def _vjp_of_vjp(op, inputs, upstream, directions, wanted):
    along = [direction is not None for direction in directions]
    every = [*inputs, upstream]
    if not any(along):
        return [np.zeros_like(array) if want else None for array, want in zip(every, wanted)]
    given = [direction for direction in directions if direction is not None]
    return _spread(op.vjp_of_vjp(inputs, upstream, given, along, wanted), every, wanted)


def _sum(a, b):
    return a if b is None else b if a is None else a + b


class Elementary:
    """A function that is one op."""

    keeps = 0

    def __init__(self, name, op, axes, shape, views=False):
        self.name, self.op, self.axes, self.shape, self.views, self.count = name, op, axes, shape, views, len(axes)

    def shapes(self, *inputs):
        return [self.shape(*inputs)]

    def forward(self, inputs):
        return [self.op.forward(inputs)]

    def vjp(self, inputs, kept, upstream, wanted):
        return _vjp(self.op, inputs, upstream, wanted)

    def vjp_of_vjp(self, inputs, kept, upstream, directions, wanted):
        return _vjp_of_vjp(self.op, inputs, upstream, directions, wanted)


ORBIT_MATRIX = named(Elementary("orbit_matrix", _native.orbit_matrix(), (2,), lambda orbits: [orbits[0], 3, 4], views=True))
PERSPECTIVE = named(Elementary("project", _native.perspective(), (3, 3), lambda points, matrices: [matrices[0], 3, points[1]]))
MSE_LOSS = named(Elementary("mse_loss", _native.mse_loss(), (3, 3), lambda image, target: [image[0]]))
IOU_LOSS = named(Elementary("iou_loss", _native.iou_loss(), (3, 3), lambda image, target: [image[0]]))


class _Tabled:
    """An op of which one input, at `place`, is a table of φ: as a function that has φ there."""

    def __init__(self, op, place, tables, table, phi):
        self.op, self.place, self.tables, self.table, self.phi = op, place, tables, table, phi

    def _scene(self, inputs):
        return [*inputs[:self.place], self.table, *inputs[self.place + 1:]]

    def vjp(self, inputs, upstream, wanted):
        if not any(wanted):
            return [None] * len(inputs)
        found = _vjp(self.op, self._scene(inputs), upstream, wanted)
        if wanted[self.place]:
            to_table = found[self.place].astype(np.float64)
            found[self.place] = self.tables.vjp([self.phi], to_table, [True])
        return found

    def vjp_of_vjp(self, inputs, upstream, directions, wanted):
        scene, place, to_phi = self._scene(inputs), self.place, None
        if directions[place] is not None:
            only = [k == place for k in range(len(inputs))]
            to_table = _vjp(self.op, scene, upstream, only)[place].astype(np.float64)
            direction = directions[place].astype(np.float64)
            to_phi, along = _vjp_of_vjp(self.tables, [self.phi], to_table, [direction], [True, True])
            directions = [*directions[:place], along.astype(self.table.dtype), *directions[place + 1:]]
        found = _vjp_of_vjp(self.op, scene, upstream, directions, wanted)
        if wanted[place]:
            by_table = found[place].astype(np.float64)
            found[place] = _sum(self.tables.vjp([self.phi], by_table, [True]), to_phi)
        return found


class Silhouette:
    """Vertices `[views, 3, V]` and, unless it is the renderer's own, φ `[P]` to coverage `[views, height, width]`; kept are the sums.

    Where the softness has a surrogate, the derivatives are those of sums that move as the surrogate's do, and φ has none.
    """

    keeps, name = 1, "silhouette"

    def __init__(self, renderer, own):
        self.renderer, self.own, self.views = renderer, own, own
        self.axes = (3,) if own else (3, 1)
        self.count = len(self.axes)

    def shapes(self, vertices, *phi):
        return [[vertices[0], *self.renderer.size]] * 2

    def _phi(self, inputs):
        return self.renderer.phi if self.own else inputs[1]

    def forward(self, inputs):
        vertices = inputs[0]
        drawn = self.renderer._drawing(self._phi(inputs))
        sums = self.renderer._recent.op(drawn.op, [vertices]).forward([vertices, drawn.table(vertices.dtype)])
        return [drawn.coverage.forward([sums]), sums]

    def _differentiated(self, inputs):
        """The op of the sums as they are differentiated, coverage of the sums, and whether φ has gradients."""
        vertices, drawn = inputs[0], self.renderer._drawing(self._phi(inputs))
        of = self.renderer.surrogate or drawn
        op = self.renderer._recent.op(of.op, [vertices])
        return _Tabled(op, 1, of.tables, of.table(vertices.dtype), of.phi), drawn.coverage, not self.own and of is drawn

    def vjp(self, inputs, kept, upstream, wanted):
        sums, coverage, learns = self._differentiated(inputs)
        (to_sums,) = _vjp(coverage, kept, upstream, [True])
        found = sums.vjp([inputs[0], None], to_sums, [wanted[0], learns and wanted[1]])
        return self._found(inputs, found, wanted)

    def vjp_of_vjp(self, inputs, kept, upstream, directions, wanted):
        sums, coverage, learns = self._differentiated(inputs)
        scene, wants = [inputs[0], None], [wanted[0], learns and wanted[1]]
        (to_sums,) = _vjp(coverage, kept, upstream, [True])
        along = [directions[0], directions[1] if learns else None]
        *first, moved = sums.vjp_of_vjp(scene, to_sums, along, [*wants, True])
        # The gradient changes with the image as well: by how the sums become coverage.
        by_sums, to_upstream = _vjp_of_vjp(coverage, kept, upstream, [moved], [True, True])
        again = sums.vjp(scene, by_sums, wants) if any(wants) else first
        found = [a + b if want else None for a, b, want in zip(first, again, wants)]
        return [*self._found(inputs, found, wanted), to_upstream if wanted[-1] else None]

    def _found(self, inputs, found, wanted):
        """Gradients in the types of the inputs, 0 for a φ that has none."""
        found = [np.zeros_like(array) if part is None and want else part for array, part, want in zip(inputs, found, wanted)]
        return [part if part is None else part.astype(array.dtype, copy=False) for array, part in zip(inputs, found)]


class Blend:
    """Vertices `[views, 3, V]`, attributes `[1 or views, entries, numbers]`, both φ in a row `[P + Q]`, a background with the logarithm of its
    weight `[channels + 1]` and, if there is one, a texture `[texels, 4]` to an image `[views, channels + 1, height, width]`.
    """

    keeps, name, views = 0, "blend", False

    def __init__(self, renderer, corners, texture):
        self.renderer, self.corners, self.texture = renderer, corners, texture
        self.axes = (3, 3, 1, 1) if texture is None else (3, 3, 1, 1, 2)
        self.count = len(self.axes)

    def shapes(self, vertices, attributes, phi, behind, *texture):
        return [[vertices[0], behind[0], *self.renderer.size]]

    def _op(self, inputs):
        vertices, phi, behind = inputs[0], inputs[2], inputs[3]
        drawn = self.renderer._drawing(phi, float(behind[-1]), self)
        table = drawn.table(vertices.dtype)
        op = self.renderer._recent.op(drawn.op, [*inputs[:2], table, *inputs[3:]])
        return _Tabled(op, 2, drawn.tables, table, drawn.phi)

    def forward(self, inputs):
        for array, name in zip([inputs[1], inputs[3][:-1], *inputs[4:]], ("attributes", "background", "texture")):
            _shapes.finite(bool(np.isfinite(array).all()), name)
        of = self._op(inputs)
        return [of.op.forward(of._scene(inputs))]

    def vjp(self, inputs, kept, upstream, wanted):
        return self._found(inputs, self._op(inputs).vjp(inputs, upstream, wanted))

    def vjp_of_vjp(self, inputs, kept, upstream, directions, wanted):
        *found, to_upstream = self._op(inputs).vjp_of_vjp(inputs, upstream, directions, wanted)
        return [*self._found(inputs, found), to_upstream]

    def _found(self, inputs, found):
        return [part if part is None else part.astype(array.dtype, copy=False) for array, part in zip(inputs, found)]
