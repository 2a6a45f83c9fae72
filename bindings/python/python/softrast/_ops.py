"""Functions of arrays as ops of torch, with derivatives of both orders in both modes.

Each function has four ops: its value, `_vjp`, `_jvp` and `_vjp_of_vjp`. They exist twice. Autograd functions run in eager mode and under
`torch.func`: they alone can have a forward mode. Ops of `torch.library` are what `torch.compile` and `torch.export` see. Both call `_computed`,
and share the formulas of their derivatives.
"""

from __future__ import annotations

import functools
import sys

import torch

from . import _passes

# The names of the functions.
_NAMES = ("orbit_matrix", "project", "silhouette", "silhouette_loss", "blend", "mse_loss", "iou_loss")
# Tensors and the name of a function; which inputs have a direction, and which gradients are wanted, "1" or "0" for each in the order of the
# tensors. Lists of flags would not do: torch takes an empty one for a list of tensors.
_SCHEMA = "(Tensor[] tensors, str function, str along, str wanted) -> Tensor[]"
# Older versions draw and differentiate in eager mode, without torch.func and torch.compile.
_COMPILES = hasattr(torch.library, "register_vmap")
try:
    from torch._C import _are_functorch_transforms_active as _transformed
    from torch._functorch.utils import unwrap_dead_wrappers as _unwrapped
except ImportError:
    _transformed, _unwrapped = (lambda: True), None


def value(kind, name, inputs):
    """The value and what is kept, of the function `name` of a kind such as "silhouette"."""
    if _COMPILES and torch.compiler.is_compiling():
        return getattr(torch.ops.softrast, kind)(inputs, name, "", "")
    return _eager("", name, inputs, [], [])


def value_alone(kind, name, inputs):
    """The value: nothing is kept where nothing is recorded."""
    if _COMPILES and torch.compiler.is_compiling():
        return value(kind, name, inputs)[0]
    return _eager("_image", name, inputs, [], [])[0]


def jvp(kind, name, inputs, kept, directions):
    """The derivative of the value along directions, None for an input that stays."""
    along = [direction is not None for direction in directions]
    tensors = [*inputs, *kept, *(direction for direction in directions if direction is not None)]
    if _COMPILES and torch.compiler.is_compiling():
        return getattr(torch.ops.softrast, kind + "_jvp")(tensors, name, _flags(along), "")[0]
    return _eager("_jvp", name, tensors, along, [])[0]


def vjp(kind, name, inputs, kept, upstream, wanted):
    """The gradients of `sum(upstream * value)` to the inputs that are wanted."""
    tensors = [*inputs, *kept, upstream]
    if _COMPILES and torch.compiler.is_compiling():
        return getattr(torch.ops.softrast, kind + "_vjp")(tensors, name, "", _flags(wanted))
    return _eager("_vjp", name, tensors, [], wanted)


def vjp_of_vjp(kind, name, inputs, kept, upstream, directions, wanted):
    """The gradients of `sum(direction * vjp)` to the inputs and the upstream that are wanted."""
    along = [direction is not None for direction in directions]
    tensors = [*inputs, *kept, upstream, *(direction for direction in directions if direction is not None)]
    if _COMPILES and torch.compiler.is_compiling():
        return getattr(torch.ops.softrast, kind + "_vjp_of_vjp")(tensors, name, _flags(along), _flags(wanted))
    return _eager("_vjp_of_vjp", name, tensors, along, wanted)


def _flags(which):
    return "".join("1" if one else "0" for one in which)


def _which(flags):
    return [flag == "1" for flag in flags]


def _spread(parts, wanted):
    """The parts at the places that are wanted, None elsewhere."""
    parts = iter(parts)
    return [next(parts) if want else None for want in wanted]


def _apart(of, tensors):
    """Inputs, what is kept, and the rest."""
    ends = of.count, of.count + of.keeps
    return tensors[:ends[0]], tensors[ends[0]:ends[1]], tensors[ends[1]:]


def _computed(order, name, tensors, along, wanted):
    """The results of an op, computed where its tensors lie."""
    if tensors[0].is_cuda:
        return _on_device(order, name, tensors, along, wanted)
    arrays = [tensor.detach().contiguous().numpy() for tensor in tensors]
    return [torch.from_numpy(part) for part in _passes.function(name).call(order[1:] or "value", arrays, list(along), list(wanted))]


def _on_device(order, name, tensors, along, wanted):
    """The results of an op whose tensors are float32 on one device; φ, if there is one, is float64 on the CPU."""
    found = _fake(order, tensors, name, along, _flags(wanted))
    with torch.cuda.device_of(tensors[0]):
        inputs, outputs = ([_lent(tensor) for tensor in of] for of in (tensors, found))
        _passes.function(name).call_dlpack(order[1:] or "value", inputs, outputs, list(along), list(wanted))
    return found


def _lent(tensor):
    """A capsule of DLPack. What runs on the current stream of CUDA then comes before what runs on the legacy default stream, 1."""
    tensor = tensor.detach().contiguous()
    return tensor.__dlpack__(stream=1) if tensor.is_cuda else tensor.__dlpack__()


# The derivatives of the ops, by other ops: `call(order, name, tensors, along, wanted)`.


def _value_back(call, name, saved, needed, upstream):
    return _spread(call("_vjp", name, [*saved, upstream], [], needed), needed)


def _vjp_back(call, name, saved, needed, wanted, directions):
    of = _passes.function(name)
    along = [direction is not None for direction in directions]
    tensors = [*saved, *(direction for direction in directions if direction is not None)]
    *to_inputs, to_upstream = _spread(call("_vjp_of_vjp", name, tensors, _spread(along, wanted), needed), needed)
    return [*to_inputs, *[None] * of.keeps, to_upstream]


def _jvp_back(call, name, saved, needed, along, upstream):
    of = _passes.function(name)
    inputs, kept, directions = _apart(of, saved)
    to_inputs, to_directions = needed[:of.count], [False] * of.count
    places = [place for place, moves in enumerate(along) if moves]
    for place, need in zip(places, needed[of.count + of.keeps:]):
        to_directions[place] = need
    first = [None] * of.count
    if any(to_inputs):
        tensors = [*inputs, *kept, upstream, *directions]
        first = _spread(call("_vjp_of_vjp", name, tensors, along, [*to_inputs, False]), to_inputs)
    second = [None] * of.count
    if any(to_directions):
        second = _spread(call("_vjp", name, [*inputs, *kept, upstream], [], to_directions), to_directions)
    return [*first, *[None] * of.keeps, *(second[place] for place in places)]


def _eager(order, name, tensors, along, wanted):
    along, transformed = [bool(moves) for moves in along], _transformed()
    tracing = sys.modules.get("torch.fx.experimental.proxy_tensor")
    if tracing is not None and tracing.get_proxy_mode() is not None:
        raise RuntimeError("softrast's ops cannot be traced by torch.fx (make_fx, torch.func.linearize): take torch.func.jvp, or torch.compile")
    if not transformed:
        # Tensors of a transform of `torch.func` that has ended.
        tensors = _unwrapped(tuple(tensors))
    # An autograd function takes a quarter of a millisecond, even where nothing is recorded: as a rule on the way back, and for cameras.
    recorded = torch.is_grad_enabled() and any(tensor.requires_grad for tensor in tensors)
    if not (transformed or recorded or torch.autograd.forward_ad._current_level >= 0 or torch.jit.is_tracing()):
        return _computed(order, name, tensors, along, wanted)
    kind = {"": _Value, "_image": _Value, "_vjp": _Vjp, "_jvp": _Jvp, "_vjp_of_vjp": _VjpOfVjp}[order]
    flags = {"": (), "_image": (), "_vjp": (wanted,), "_jvp": (along,), "_vjp_of_vjp": (along, wanted)}[order]
    # Beside what is done above `Function.apply` binds default values, by a signature that it makes anew at every call.
    apply = kind.apply if transformed else super(torch.autograd.Function, kind).apply
    return apply(name, *flags, *tensors)


def _recorded(order, name, tensors, along, wanted):
    kind = name.split("-")[0]
    return getattr(torch.ops.softrast, kind + order)(tensors, name, _flags(along), _flags(wanted))


def _save(ctx, tensors):
    ctx.save_for_backward(*tensors)
    ctx.save_for_forward(*tensors)
    ctx.set_materialize_grads(False)


def _mapped(apply, of, info, dims, tensors):
    """The op over a further axis: views of all scenes in one call where they are apart, else scene by scene."""
    count = info.batch_size
    tensors = [tensor if dim is None else tensor.movedim(dim, 0) for tensor, dim in zip(tensors, dims)]
    if of.views:
        spread = [tensor.expand(count, *tensor.shape) if dim is None else tensor for tensor, dim in zip(tensors, dims)]
        found = [part.unflatten(0, (count, -1)) for part in apply([tensor.flatten(0, 1) for tensor in spread])]
    else:
        each = [apply([tensor if dim is None else tensor[k] for tensor, dim in zip(tensors, dims)]) for k in range(count)]
        found = [torch.stack(parts) for parts in zip(*each)]
    return tuple(found), (0,) * len(found)


def _old(kind):
    """The autograd function for versions of torch that know no `setup_context`."""
    if not hasattr(torch.autograd.Function, "setup_context"):
        new = kind.forward

        def forward(ctx, *inputs):
            outputs = new(*inputs)
            kind.setup_context(ctx, inputs, outputs)
            return outputs

        kind.forward = staticmethod(forward)
    return kind


@_old
class _Value(torch.autograd.Function):
    @staticmethod
    def forward(name, *inputs):
        return tuple(_computed("", name, inputs, [], []))

    @staticmethod
    def setup_context(ctx, inputs, outputs):
        ctx.name, ctx.of = inputs[0], _passes.function(inputs[0])
        ctx.mark_non_differentiable(*outputs[1:])
        _save(ctx, [*inputs[1:], *outputs[1:]])

    @staticmethod
    def backward(ctx, upstream, *_):
        needed = list(ctx.needs_input_grad[1:])
        if upstream is None:
            return (None,) * (1 + len(needed))
        return (None, *_value_back(_eager, ctx.name, ctx.saved_tensors, needed, upstream))

    @staticmethod
    def jvp(ctx, _, *directions):
        inputs, kept, _ = _apart(ctx.of, ctx.saved_tensors)
        along = [direction is not None for direction in directions]
        given = [direction for direction in directions if direction is not None]
        return (_Jvp.apply(ctx.name, along, *inputs, *kept, *given)[0], *[None] * len(kept))

    @staticmethod
    def vmap(info, dims, name, *inputs):
        return _mapped(lambda inputs: _Value.apply(name, *inputs), _passes.function(name), info, dims[1:], inputs)


@_old
class _Vjp(torch.autograd.Function):
    @staticmethod
    def forward(name, wanted, *tensors):
        return tuple(_computed("_vjp", name, tensors, [], wanted))

    @staticmethod
    def setup_context(ctx, inputs, outputs):
        ctx.name, ctx.wanted, ctx.of = inputs[0], inputs[1], _passes.function(inputs[0])
        _save(ctx, inputs[2:])

    @staticmethod
    def backward(ctx, *directions):
        needs = ctx.needs_input_grad[2:]
        needed = [*needs[:ctx.of.count], needs[-1]]
        return (None, None, *_vjp_back(_eager, ctx.name, ctx.saved_tensors, needed, ctx.wanted, directions))

    @staticmethod
    def jvp(ctx, _name, _wanted, *directions):
        inputs, kept, (upstream,) = _apart(ctx.of, ctx.saved_tensors)
        along, (direction,) = directions[:ctx.of.count], directions[-1:]
        found = [None] * sum(ctx.wanted)
        if any(part is not None for part in along):
            # A second derivative is symmetric: the gradient of the gradient along a direction is its change along it.
            given = [part for part in along if part is not None]
            moves = [part is not None for part in along]
            found = _VjpOfVjp.apply(ctx.name, moves, [*ctx.wanted, False], *inputs, *kept, upstream, *given)
        if direction is not None:
            parts = _Vjp.apply(ctx.name, ctx.wanted, *inputs, *kept, direction)
            found = [part if moved is None else moved + part for moved, part in zip(found, parts)]
        return tuple(found)

    @staticmethod
    def vmap(info, dims, name, wanted, *tensors):
        return _mapped(lambda tensors: _Vjp.apply(name, wanted, *tensors), _passes.function(name), info, dims[2:], tensors)


@_old
class _Jvp(torch.autograd.Function):
    @staticmethod
    def forward(name, along, *tensors):
        return tuple(_computed("_jvp", name, tensors, along, []))

    @staticmethod
    def setup_context(ctx, inputs, outputs):
        ctx.name, ctx.along, ctx.of = inputs[0], inputs[1], _passes.function(inputs[0])
        _save(ctx, inputs[2:])

    @staticmethod
    def backward(ctx, upstream):
        needed = list(ctx.needs_input_grad[2:])
        return (None, None, *_jvp_back(_eager, ctx.name, ctx.saved_tensors, needed, ctx.along, upstream))

    @staticmethod
    def jvp(ctx, *_):
        raise RuntimeError("softrast has no forward mode over forward mode: take jacfwd of jacrev, or jacrev of jacfwd")

    @staticmethod
    def vmap(info, dims, name, along, *tensors):
        return _mapped(lambda tensors: _Jvp.apply(name, along, *tensors), _passes.function(name), info, dims[2:], tensors)


@_old
class _VjpOfVjp(torch.autograd.Function):
    @staticmethod
    def forward(name, along, wanted, *tensors):
        return tuple(_computed("_vjp_of_vjp", name, tensors, along, wanted))

    @staticmethod
    def setup_context(ctx, inputs, outputs):
        pass

    @staticmethod
    def backward(ctx, *_):
        raise RuntimeError("softrast can be differentiated twice, not a third time")

    jvp = backward

    @staticmethod
    def vmap(info, dims, name, along, wanted, *tensors):
        return _mapped(lambda tensors: _VjpOfVjp.apply(name, along, wanted, *tensors), _passes.function(name), info, dims[3:], tensors)


def _fake(order, tensors, function, along, wanted):
    """Empty tensors of the shapes of an op's results."""
    of = _passes.function(function)
    inputs, _, rest = _apart(of, tensors)
    if order in ("", "_image", "_jvp"):
        shapes = of.shapes(*(tensor.shape for tensor in inputs))
        return [inputs[0].new_empty(shape) for shape in (shapes if order == "" else shapes[:1])]
    return [tensor.new_empty(tensor.shape) for tensor, want in zip([*inputs, *rest[:1]], _which(wanted)) if want]


def _setup(ctx, inputs, output):
    tensors, ctx.name, along, wanted = inputs
    ctx.along, ctx.wanted = _which(along), _which(wanted)
    ctx.needs = [tensor.requires_grad for tensor in tensors]
    of = _passes.function(ctx.name)
    ctx.save_for_backward(*tensors, *(output[1:] if len(tensors) == of.count else []))


def _back_of(order):
    def back(ctx, found):
        saved, needs, of = ctx.saved_tensors, ctx.needs, _passes.function(ctx.name)
        if order == "":
            gradients = _value_back(_recorded, ctx.name, saved, needs, found[0])
        elif order == "_vjp":
            directions = _spread(found, ctx.wanted)
            needed = [*needs[:of.count], needs[-1]]
            gradients = _vjp_back(_recorded, ctx.name, saved, needed, ctx.wanted, directions)
        elif order == "_jvp":
            gradients = _jvp_back(_recorded, ctx.name, saved, needs, ctx.along, found[0])
        else:
            raise RuntimeError("softrast can be differentiated twice, not a third time")
        return gradients, None, None, None

    return back


def _register(kind, order):
    name = kind + order
    _LIBRARY.define(name + _SCHEMA)
    compute = lambda tensors, function, along, wanted: _computed(order, function, tensors, _which(along), _which(wanted))
    for device in ("CPU", "CUDA"):
        _LIBRARY.impl(name, compute, device)
    full = f"softrast::{name}"
    torch.library.register_fake(full, functools.partial(_fake, order), lib=_LIBRARY)
    torch.library.register_autograd(full, _back_of(order), setup_context=_setup, lib=_LIBRARY)
    op = getattr(torch.ops.softrast, name)

    def mapped(info, dims, tensors, function, along, wanted):
        found, dims = _mapped(lambda tensors: op(tensors, function, along, wanted), _passes.function(function), info, dims[0], tensors)
        return list(found), list(dims)

    torch.library.register_vmap(full, mapped, lib=_LIBRARY)


if _COMPILES:
    # Not `custom_op`: its checks of every call take as long as a small image.
    _LIBRARY = torch.library.Library("softrast", "DEF")
    for _kind in _NAMES:
        for _order in ("", "_vjp", "_jvp", "_vjp_of_vjp"):
            _register(_kind, _order)
