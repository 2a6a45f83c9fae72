"""Functions of arrays with their derivatives, for frameworks that keep no state between the passes.

A function has `count` inputs, and `axes`, how many each has; `views` states that all inputs have the views first and may be concatenated;
`keeps` is the number of arrays that the value leaves to the derivatives. `shapes(*inputs)` are those of the value and of what is kept.
`call(order, arrays, along, wanted)` and `call_dlpack` compute it or a derivative, see `_native.Function`.
"""

from __future__ import annotations

import itertools
import weakref

from . import _native

# Functions by the names under which ops of torch know them.
_NAMED: weakref.WeakValueDictionary = weakref.WeakValueDictionary()
_numbers = itertools.count()


class Function:
    """A compiled function, and what frameworks need to know of it; `handle` is a name that no other has."""

    def __init__(self, kind, native, shapes):
        self.handle, self.shapes = f"{kind}-{next(_numbers)}", shapes
        self.id, self.axes, self.keeps, self.views = native.id, native.axes, native.keeps, native.views
        self.call, self.call_dlpack = native.call, native.call_dlpack
        self.count = len(self.axes)
        _NAMED[self.handle] = self


def function(handle):
    """The function of this name."""
    found = _NAMED.get(handle)
    if found is None:
        raise ValueError(f"there is no function {handle}: its renderer is gone, keep it as long as its images")
    return found


ORBIT_MATRIX = Function("orbit_matrix", _native.orbit_matrix(), lambda orbits: [[orbits[0], 3, 4]])
PERSPECTIVE = Function("project", _native.perspective(), lambda points, matrices: [[matrices[0], 3, points[1]]])
MSE_LOSS = Function("mse_loss", _native.mse_loss(), lambda image, target: [[image[0]]])
IOU_LOSS = Function("iou_loss", _native.iou_loss(), lambda image, target: [[image[0]]])


def silhouette(native, own):
    """Vertices `[views, 3, V]` and, unless it is the renderer's own, φ `[P]` to coverage `[views, height, width]`; kept are the sums."""
    size = native.size
    return Function("silhouette", native.silhouette(own), lambda vertices, *phi: [[vertices[0], *size]] * 2)


def silhouette_losses(native):
    """By their names the losses `[views]` of vertices `[views, 3, V]` against targets `[1 or views, height, width]`, as far as the renderer has
    them; kept are the gradients to the vertices.
    """
    shapes = lambda vertices, target: [[vertices[0]], [*vertices]]
    found = {name: native.loss(name) for name in ("mse", "iou")}
    return {name: Function("silhouette_loss", of, shapes) for name, of in found.items() if of is not None}


def blend(native, corners, texture):
    """Vertices `[views, 3, V]`, attributes `[1 or views, entries, numbers]`, both φ in a row `[P + Q]`, a background with the logarithm of its
    weight `[channels + 1]` and, if there is one, a texture `[texels, 4]` to an image `[views, channels + 1, height, width]`.
    """
    size = native.size
    shapes = lambda vertices, attributes, phi, behind, *texture: [[vertices[0], behind[0], *size]]
    return Function("blend", native.blend(corners, texture), shapes)
