"""Functions of arrays as primitives of JAX, with derivatives of both orders in both modes.

A value has a derivative along directions (`jvp`), which is linear in them and has gradients (`vjp`) as its transpose; the changes of both are second
derivatives. Arrays may have further axes in front, all of them the same, as `jax.vmap` makes them.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

from . import _native

_CPU = "softrast draws on the CPU"
_THIRD = "softrast can be differentiated twice, not a third time"

# The handler of compiled functions, and the names of the derivatives that it computes, in its order.
_TARGET = "softrast"
_ORDERS = "value", "image", "jvp", "vjp", "vjp_of_vjp"
jax.ffi.register_ffi_target(_TARGET, _native.xla_handler(), platform="cpu")


def _apart(of, arrays):
    """Inputs, what is kept, and the rest."""
    ends = of.count, of.count + of.keeps
    return arrays[:ends[0]], arrays[ends[0]:ends[1]], arrays[ends[1]:]


def _spread(parts, wanted):
    parts = iter(parts)
    return [next(parts) if want else None for want in wanted]


def _lead(of, array):
    """The axes in front of those of the first input."""
    return array.shape[:array.ndim - of.axes[0]]


def _on_cpu(array):
    """An array of NumPy with the same numbers."""
    if isinstance(array, jax.Array) and any(device.platform != "cpu" for device in array.devices()):
        raise ValueError(f"{_CPU}, found an array on {', '.join(map(str, array.devices()))}: move it with jax.device_put")
    return np.ascontiguousarray(array)


def _shapes(order, of, along, wanted, arrays):
    inputs, _, rest = _apart(of, arrays)
    lead = _lead(of, inputs[0])
    if order in ("vjp", "vjp_of_vjp"):
        return [(array.shape, array.dtype) for array, want in zip(inputs, wanted) if want]
    found = of.shapes(*(array.shape[len(lead):] for array in inputs))
    return [((*lead, *shape), inputs[0].dtype) for shape in (found if order == "value" else found[:1])]


def _bits(flags):
    """Flags as a number, the first as the lowest bit."""
    return sum(1 << place for place, flag in enumerate(flags) if flag)


def _primitive(order):
    primitive = Primitive(f"softrast_{order}")
    primitive.multiple_results = True

    def compute(*arrays, of, along=(), wanted=()):
        if order == "bent":
            raise ValueError("softrast has no forward mode over forward mode: take jax.hessian, or jax.grad of a jvp")
        # No gradients to the upstream.
        wanted = [*wanted, False] if order == "vjp_of_vjp" else wanted
        return [jnp.asarray(part) for part in of.call(order, [_on_cpu(array) for array in arrays], along, wanted)]

    def lower(ctx, *arrays, of, along=(), wanted=()):
        if order == "bent":
            compute(*arrays, of=of)
        # Compiled code knows the function by its number.
        ctx.module_context.add_keepalive(of)
        # An array and no attributes: XLA before JAX 0.7.2 ends the process where it compiles for several threads and a call has some.
        # Of int32, as int64 may be off.
        settings = np.array([of.id, _ORDERS.index(order), _bits(along), _bits(wanted)], np.int64).view(np.int32)
        ctx = ctx.replace(avals_in=[jax.core.ShapedArray(settings.shape, settings.dtype), *ctx.avals_in])
        return jax.ffi.ffi_lowering(_TARGET)(ctx, mlir.ir_constant(settings), *arrays)

    def refuse(ctx, *_, **__):
        raise ValueError(f"{_CPU}, found a function that is compiled for {', '.join(ctx.module_context.platforms)}: use jax.jit on the CPU")

    def mapped(arrays, dims, **settings):
        (count,) = {array.shape[dim] for array, dim in zip(arrays, dims) if dim is not None}
        spread = [
            jnp.broadcast_to(array, (count, *array.shape)) if dim is None else jnp.moveaxis(array, dim, 0)
            for array, dim in zip(arrays, dims)
        ]
        found = primitive.bind(*spread, **settings)
        return found, [0] * len(found)

    primitive.def_impl(compute)
    primitive.def_abstract_eval(lambda *arrays, of, along=(), wanted=(): [
        jax.core.ShapedArray(*one) for one in _shapes(order, of, along, wanted, arrays)
    ])
    mlir.register_lowering(primitive, refuse)
    mlir.register_lowering(primitive, lower, platform="cpu")
    batching.primitive_batchers[primitive] = mapped
    return primitive


# Values; derivatives along directions; gradients; gradients of gradients along directions, which are their changes too; and the change of a
# derivative along directions, which is not computed: it exists to be transposed.
_VALUE, _JVP, _VJP, _CURVED, _BENT = map(_primitive, ("value", "jvp", "vjp", "vjp_of_vjp", "bent"))


def value(of, inputs):
    """The value of a function."""
    return _VALUE.bind(*inputs, of=of)[0]


def _moves(directions):
    return tuple(type(direction) is not ad.Zero for direction in directions)


def _given(directions):
    return [direction for direction in directions if type(direction) is not ad.Zero]


def _still(arrays):
    return [jnp.zeros_like(array) for array in arrays]


def _sum(a, b):
    return b if a is None else a if b is None else [x + y for x, y in zip(a, b)]


def _value_jvp(inputs, directions, *, of):
    found = _VALUE.bind(*inputs, of=of)
    if not any(_moves(directions)):
        return found, _still(found)
    moved = _JVP.bind(*inputs, *found[1:], *_given(directions), of=of, along=_moves(directions))
    # A cached value is a function of the inputs, so they get its share of the gradient.
    return found, [*moved, *_still(found[1:])]


def _jvp_jvp(arrays, directions, *, of, along):
    inputs, kept, given = _apart(of, arrays)
    by_inputs, _, by_given = _apart(of, directions)
    found = _JVP.bind(*arrays, of=of, along=along)
    moved = None
    if any(_moves(by_given)):
        places = _spread(by_given, along)
        moves = tuple(part is not None and type(part) is not ad.Zero for part in places)
        moved = _JVP.bind(*inputs, *kept, *_given(by_given), of=of, along=moves)
    if any(_moves(by_inputs)):
        bent = _BENT.bind(*inputs, *kept, *given, *_given(by_inputs), of=of, along=along, wanted=_moves(by_inputs))
        moved = _sum(moved, bent)
    return found, _still(found) if moved is None else moved


def _jvp_transpose(upstream, *arrays, of, along):
    inputs, kept, _ = _apart(of, arrays)
    found = [None] * sum(along)
    if type(upstream[0]) is not ad.Zero:
        linear = [ad.is_undefined_primal(array) for array in arrays[of.count + of.keeps:]]
        wanted = tuple(bool(moves) for moves in _spread(linear, along))
        found = _spread(_VJP.bind(*inputs, *kept, upstream[0], of=of, wanted=wanted), linear)
    return [*[None] * (of.count + of.keeps), *found]


def _vjp_jvp(arrays, directions, *, of, wanted):
    inputs, kept, (upstream,) = _apart(of, arrays)
    by_inputs, _, (by_upstream,) = _apart(of, directions)
    found = _VJP.bind(*arrays, of=of, wanted=wanted)
    moved = None
    if type(by_upstream) is not ad.Zero:
        moved = _VJP.bind(*inputs, *kept, by_upstream, of=of, wanted=wanted)
    if any(_moves(by_inputs)):
        # A second derivative is symmetric: the gradient of the gradient along a direction is its change along it.
        curved = _CURVED.bind(*inputs, *kept, upstream, *_given(by_inputs), of=of, along=_moves(by_inputs), wanted=wanted)
        moved = _sum(moved, curved)
    return found, _still(found) if moved is None else moved


def _vjp_transpose(directions, *arrays, of, wanted):
    inputs, kept, _ = _apart(of, arrays)
    along = tuple(part is not None and type(part) is not ad.Zero for part in _spread(directions, wanted))
    found = _JVP.bind(*inputs, *kept, *_given(directions), of=of, along=along)[0] if any(along) else None
    return [*[None] * (of.count + of.keeps), found]


def _curved_jvp(arrays, directions, *, of, along, wanted):
    by_inputs, _, (by_upstream, *by_given) = _apart(of, directions)
    if any(_moves([*by_inputs, by_upstream])):
        raise ValueError(_THIRD)
    inputs, kept, (upstream, *_) = _apart(of, arrays)
    found = _CURVED.bind(*arrays, of=of, along=along, wanted=wanted)
    moves = tuple(part is not None and type(part) is not ad.Zero for part in _spread(by_given, along))
    if not any(moves):
        return found, _still(found)
    return found, _CURVED.bind(*inputs, *kept, upstream, *_given(by_given), of=of, along=moves, wanted=wanted)


def _curved_transpose(directions, *arrays, of, along, wanted):
    inputs, kept, (upstream, *given) = _apart(of, arrays)
    if ad.is_undefined_primal(upstream):
        raise ValueError(_THIRD)
    linear = [ad.is_undefined_primal(array) for array in given]
    back = tuple(part is not None and type(part) is not ad.Zero for part in _spread(directions, wanted))
    found = [None] * len(given)
    if any(back):
        to = tuple(bool(moves) for moves in _spread(linear, along))
        parts = _CURVED.bind(*inputs, *kept, upstream, *_given(directions), of=of, along=back, wanted=to)
        found = _spread(parts, linear)
    return [*[None] * (of.count + of.keeps + 1), *found]


def _bent_transpose(upstream, *arrays, of, along, wanted):
    inputs, kept, rest = _apart(of, arrays)
    given, moved = rest[:sum(along)], rest[sum(along):]
    # Linear in both: in how the inputs move, or in the directions.
    first = ad.is_undefined_primal(moved[0])
    known, unknown, of_known, of_unknown = (given, moved, along, wanted) if first else (moved, given, wanted, along)
    found = [None] * len(unknown)
    if type(upstream[0]) is not ad.Zero:
        found = _CURVED.bind(*inputs, *kept, upstream[0], *known, of=of, along=of_known, wanted=of_unknown)
    back = [*[None] * len(known), *found] if first else [*found, *[None] * len(known)]
    return [*[None] * (of.count + of.keeps), *back]


def _refused(*_, **__):
    raise ValueError(_THIRD)


ad.primitive_jvps.update({_VALUE: _value_jvp, _JVP: _jvp_jvp, _VJP: _vjp_jvp, _CURVED: _curved_jvp, _BENT: _refused})
ad.primitive_transposes.update({_JVP: _jvp_transpose, _VJP: _vjp_transpose, _CURVED: _curved_transpose, _BENT: _bent_transpose})
