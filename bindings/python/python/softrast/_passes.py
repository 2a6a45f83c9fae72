"""Functions of arrays with both passes back, for frameworks that keep no state between them.

Each has `forward(*inputs)`, which returns the value and what the passes back want kept, `vjp(inputs, kept, upstream)` with a gradient for
each input, and `vjp_of_vjp(inputs, kept, upstream, directions)` with one for each input and for the upstream. `axes` are the numbers of axes
of the inputs, `views` says that all have the views first and may be put behind each other, and `keeps` how many arrays are kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import _native


def _split(flat, arrays):
    ends = np.cumsum([array.size for array in arrays])[:-1]
    return [part.reshape(array.shape) for part, array in zip(np.split(flat, ends), arrays)]


def _vjp(op, inputs, upstream):
    return _split(op.vjp(inputs, upstream, [True] * len(inputs)), inputs)


def _vjp_of_vjp(op, inputs, upstream, directions):
    along, wanted = [True] * len(inputs), [True] * (len(inputs) + 1)
    return _split(op.vjp_of_vjp(inputs, upstream, directions, along, wanted), [*inputs, upstream])


@dataclass(frozen=True)
class Elementary:
    """A function that is one op."""

    op: _native.Op
    axes: tuple
    views: bool = False
    keeps = 0

    def forward(self, *inputs):
        return self.op.forward(list(inputs)), ()

    def vjp(self, inputs, kept, upstream):
        return _vjp(self.op, list(inputs), upstream)

    def vjp_of_vjp(self, inputs, kept, upstream, directions):
        return _vjp_of_vjp(self.op, list(inputs), upstream, list(directions))


ORBIT_MATRIX = Elementary(_native.orbit_matrix(), (2,), views=True)
PERSPECTIVE = Elementary(_native.perspective(), (3, 3))


@dataclass(frozen=True)
class Silhouette:
    """Vertices `[views, 3, V]`, and unless it is the renderer's own φ `[P]`, to coverage `[views, height, width]`; kept are the sums."""

    renderer: object
    own: bool
    keeps = 1

    @property
    def axes(self):
        return (3,) if self.own else (3, 1)

    @property
    def views(self):
        return self.own

    def _drawing(self, vertices, phi):
        """What draws and what is felt, each with its table, and φ as the op of tables takes it."""
        renderer, dtype = self.renderer, vertices.dtype
        if self.own:
            prepared, table = renderer._own(dtype)
        else:
            phi = phi[0].astype(np.float64)
            prepared = renderer.prepared(phi)
            table = prepared.table().forward([phi]).astype(dtype)
        felt, felt_table = renderer._felt(dtype) or (prepared, table)
        return prepared, table, felt, felt_table, phi

    def forward(self, vertices, *phi):
        prepared, table, *_ = self._drawing(vertices, phi)
        sums = prepared.sum().forward([vertices, table])
        return prepared.coverage().forward([sums]), (sums,)

    def vjp(self, inputs, kept, upstream):
        vertices, *given = inputs
        prepared, _, felt, table, phi = self._drawing(vertices, given)
        to_sums = prepared.coverage().vjp(list(kept), upstream, [True]).reshape(upstream.shape)
        learns = self._learns(prepared, felt)
        flat = felt.sum().vjp([vertices, table], to_sums, [True, learns])
        if not learns:
            return [flat.reshape(vertices.shape), *map(np.zeros_like, given)]
        to_vertices, to_table = _split(flat, [vertices, table])
        return [to_vertices, prepared.table().vjp([phi], to_table.astype(np.float64), [True]).astype(given[0].dtype)]

    def vjp_of_vjp(self, inputs, kept, upstream, directions):
        vertices, *given = inputs
        prepared, _, felt, table, phi = self._drawing(vertices, given)
        coverage, sums, scene = prepared.coverage(), felt.sum(), [vertices, table]
        to_sums = coverage.vjp(list(kept), upstream, [True]).reshape(upstream.shape)
        learns, along = self._learns(prepared, felt), [directions[0]]
        if learns:
            to_table = _split(sums.vjp(scene, to_sums, [False, True]), [table])[0].astype(np.float64)
            direction = directions[1].astype(np.float64)
            to_phi, along_table = _vjp_of_vjp(prepared.table(), [phi], to_table, [direction])
            along.append(along_table.astype(table.dtype))
        flat = sums.vjp_of_vjp(scene, to_sums, along, [True, learns], [True, learns, True])
        parts = _split(flat, [*scene[:1 + learns], to_sums])
        # The gradient changes with the image as well: through what the coverage makes of the sums.
        by_sums, to_upstream = _vjp_of_vjp(coverage, list(kept), upstream, [parts[-1]])
        # Where there is a surrogate, sums move as its own do.
        again = _split(sums.vjp(scene, by_sums, [True, learns]), scene[:1 + learns])
        to_vertices = parts[0] + again[0]
        if not learns:
            return [to_vertices, *map(np.zeros_like, given), to_upstream]
        by_table = (parts[1] + again[1]).astype(np.float64)
        to_phi = to_phi + prepared.table().vjp([phi], by_table, [True])
        return [to_vertices, to_phi.astype(given[0].dtype), to_upstream]

    def _learns(self, prepared, felt):
        return not self.own and felt is prepared
