"""Function transforms of torch, both modes of differentiation, compilation, and the checks that torch has for ops."""

import time

import numpy as np
import pytest

import softrast

torch = pytest.importorskip("torch", minversion="2.6")
import softrast.torch as st  # noqa: E402
from softrast import _ops  # noqa: E402

FACES = [[0, 1, 2], [1, 3, 2]]
CORNERS = [[-0.6, -0.5, 0.1], [0.5, -0.6, -0.2], [0.05, 0.55, 0.0], [0.8, 0.4, 0.3]]
F64 = dict(dtype=torch.float64)


def renderer(**settings):
    softness = settings.pop("softness", softrast.Softness("logistic", 0.1))
    return softrast.Renderer(FACES, (4, 5), softness, **settings)


def colours(**settings):
    return softrast.ColourRenderer(FACES, (4, 3), softrast.Softness("logistic", 0.2), [1.5, 3.5], depth_scale=0.3, **settings)


def scene():
    """World vertices `[4, 3]` and cameras of two views."""
    return torch.tensor(CORNERS, **F64), torch.from_numpy(softrast.orbit(2.5, 10.0, [20.0, 70.0]))


def image(draw, *phi):
    return lambda corners, cameras: st.silhouette(draw, st.project(corners, cameras), *phi)


def tensors(draw=None):
    """A function of each kind, its name among the ops, and inputs that suit it."""
    corners, cameras = scene()
    draw, paint = renderer(), colours()
    seen = st.project(corners, cameras).transpose(1, 2).contiguous()
    pixels = torch.rand(2, 4, 5, generator=torch.Generator().manual_seed(0), **F64)
    values = torch.rand(1, 4, 2, generator=torch.Generator().manual_seed(1), **F64)
    both = torch.cat([torch.from_numpy(x) for x in (paint.phi, paint.phi_depth)])
    inputs = {
        "orbit_matrix": (st._ORBIT_MATRIX, [cameras]),
        "project": (st._PERSPECTIVE, [corners[None], torch.rand(2, 3, 4, **F64) + 1.0]),
        "silhouette": (draw._by_phi_name, [seen, torch.from_numpy(draw.phi)]),
        "silhouette_loss": (draw._loss_names["iou"], [seen, pixels[:1]]),
        "blend": (paint._plain_name, [seen, values, both, torch.tensor([0.2, 0.8, -4.0], **F64)]),
        "mse_loss": (st._LOSSES["mse"][1], [pixels, 1.0 - pixels[:1]]),
        "iou_loss": (st._LOSSES["iou"][1], [pixels, 1.0 - pixels[:1]]),
    }
    return {kind: (name, [x.detach() for x in found]) for kind, (name, found) in inputs.items()}, (draw, paint)


@pytest.mark.parametrize("kind", _ops._NAMES)
def test_ops_pass_the_checks_of_torch(kind):
    functions, kept_alive = tensors()
    name, inputs = functions[kind]
    ops = torch.ops.softrast
    leaves = [x.clone().requires_grad_() for x in inputs]
    value, *kept = getattr(ops, kind)(leaves, name, "", "")
    kept, upstream = [x.detach() for x in kept], torch.rand_like(value).requires_grad_()
    directions, every = [torch.rand_like(x) for x in inputs], "1" * len(inputs)
    torch.library.opcheck(getattr(ops, kind).default, (leaves, name, "", ""))
    torch.library.opcheck(getattr(ops, kind + "_vjp").default, ([*leaves, *kept, upstream], name, "", every))
    moving = [direction.clone().requires_grad_() for direction in directions]
    torch.library.opcheck(getattr(ops, kind + "_jvp").default, ([*leaves, *kept, *moving], name, every, ""))
    # No third derivative, so inputs that ask for none.
    still = [*inputs, *kept, upstream.detach(), *directions]
    torch.library.opcheck(getattr(ops, kind + "_vjp_of_vjp").default, (still, name, every, every + "1"))
    assert kept_alive


@pytest.mark.parametrize("kind", _ops._NAMES)
def test_derivatives_of_both_orders_and_modes_are_those_of_differences(kind):
    functions, kept_alive = tensors()
    name, inputs = functions[kind]
    leaves = [x.clone().requires_grad_() for x in inputs]
    of = lambda *inputs: _ops.value(kind, name, list(inputs))[0]
    assert torch.autograd.gradcheck(of, leaves, check_forward_ad=True)
    torch.manual_seed(0)
    assert torch.autograd.gradgradcheck(of, leaves, check_fwd_over_rev=True, check_rev_over_rev=True)
    assert kept_alive


@pytest.mark.parametrize("softness", [softrast.Softness("logistic", 0.1), softrast.Softness("gauss", 0.02, squared=True)], ids=repr)
def test_silhouettes_pass_gradcheck_with_its_defaults_in_vertices_cameras_and_phi(softness):
    draw = renderer(softness=softness)
    corners, cameras = scene()
    leaves = [x.requires_grad_() for x in (corners, cameras, torch.from_numpy(draw.phi))]
    of = lambda corners, cameras, phi: image(draw, phi)(corners, cameras)
    assert torch.autograd.gradcheck(of, leaves)
    assert torch.autograd.gradgradcheck(of, leaves)


def test_colours_pass_gradcheck_with_its_defaults():
    paint = colours()
    corners, cameras = scene()
    values = torch.rand(4, 2, generator=torch.Generator().manual_seed(1), **F64)
    given = (corners, values, torch.tensor([0.2, 0.8], **F64), torch.tensor([-4.0], **F64), torch.from_numpy(paint.phi),
             torch.from_numpy(paint.phi_depth))
    of = lambda corners, values, background, log_weight, phi, phi_depth: st.blend(
        paint, st.project(corners, cameras), values, background, log_weight=log_weight, phi=phi, phi_depth=phi_depth)
    leaves = [x.requires_grad_() for x in given]
    assert torch.autograd.gradcheck(of, leaves)
    assert torch.autograd.gradgradcheck(of, leaves)


def test_focal_lengths_and_poses_pass_gradcheck_with_its_defaults():
    draw = renderer()
    corners, _ = scene()
    K = torch.tensor([[4.0, 0.1, 2.2], [0.0, 4.2, 1.4], [0.0, 0.0, 1.0]], **F64)
    R, t = torch.eye(3, **F64) + 0.1, torch.tensor([0.05, -0.1, 2.5], **F64)
    of = lambda K, R, t: st.silhouette(draw, st.project(corners, st.pinhole(K, R, t, (4, 5))))
    leaves = [x.requires_grad_() for x in (K, R, t)]
    assert torch.autograd.gradcheck(of, leaves)
    assert torch.autograd.gradgradcheck(of, leaves)


@pytest.mark.parametrize("with_phi", [False, True])
def test_function_transforms_agree_with_autograd(with_phi):
    draw = renderer()
    corners, cameras = scene()
    phi = [torch.from_numpy(draw.phi)] if with_phi else []
    of = image(draw, *phi)
    loss = lambda corners, cameras: of(corners, cameras).pow(2).sum()
    leaf = corners.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(loss(leaf, cameras), leaf, create_graph=True)
    rows = [torch.autograd.grad(part, leaf, retain_graph=True)[0] for part in gradient.reshape(-1)]
    hessian = torch.stack(rows).reshape(4, 3, 4, 3)
    gradient = gradient.detach()

    close = lambda a, b: torch.testing.assert_close(a, b, rtol=1e-9, atol=1e-11)
    close(torch.func.grad(loss)(corners, cameras), gradient)
    jacobian = torch.func.jacrev(of)(corners, cameras)
    close(torch.einsum("vyx,vyxab->ab", 2.0 * of(corners, cameras), jacobian), gradient)
    close(torch.func.jacfwd(of)(corners, cameras), jacobian)
    close(torch.func.hessian(loss)(corners, cameras), hessian)
    close(torch.func.jacrev(torch.func.jacrev(loss))(corners, cameras), hessian)
    close(torch.func.jacrev(torch.func.jacfwd(loss))(corners, cameras), hessian)
    direction = torch.rand(4, 3, generator=torch.Generator().manual_seed(0), **F64)
    _, change = torch.func.jvp(lambda corners: of(corners, cameras), (corners,), (direction,))
    close(change, torch.einsum("vyxab,ab->vyx", jacobian, direction))
    # A camera at a time.
    each = torch.func.vmap(lambda camera: of(corners, camera[None])[0])(cameras)
    close(each, of(corners, cameras))
    many = torch.func.vmap(torch.func.grad(loss), (None, 0))(corners, cameras[:, None])
    close(many.sum(0), gradient)


def test_a_gradient_outside_of_its_transform_has_a_gradient():
    corners, cameras = scene()
    draw = image(renderer())
    weights = torch.rand(2, 4, 5, generator=torch.Generator().manual_seed(2), **F64)
    of_transform, of_autograd = (corners.clone().requires_grad_() for _ in range(2))
    _, back = torch.func.vjp(lambda corners: draw(corners, cameras), of_transform)
    (gradient,) = back(weights)
    (expected,) = torch.autograd.grad((draw(of_autograd, cameras) * weights).sum(), of_autograd, create_graph=True)
    for corners, gradient in ((of_transform, gradient), (of_autograd, expected)):
        (gradient.pow(2).sum() + corners.pow(2).sum()).backward()
    assert torch.equal(gradient, expected) and torch.allclose(of_transform.grad, of_autograd.grad, rtol=1e-12)


@pytest.mark.filterwarnings("ignore")
def test_traces_follow_their_inputs_or_are_refused():
    corners, cameras = scene()
    draw = image(renderer())
    traced = torch.jit.trace(draw, (corners, cameras), check_trace=False)
    assert torch.equal(traced(0.8 * corners, cameras), draw(0.8 * corners, cameras))
    with pytest.raises(RuntimeError, match="torch.func.jvp"):
        torch.func.linearize(lambda corners: draw(corners, cameras), corners)


def test_the_curvature_of_a_surrogate_is_the_same_in_both_modes():
    draw = renderer(softness=softrast.Softness.learned("shape3d-surrogate"))
    corners, cameras = scene()
    loss = lambda corners: image(draw)(corners, cameras).pow(2).sum()
    hessian = torch.func.hessian(loss)(corners)
    assert hessian.abs().max() > 1e-3
    torch.testing.assert_close(hessian, torch.func.jacrev(torch.func.jacrev(loss))(corners), rtol=1e-9, atol=1e-11)


def test_a_further_derivative_is_refused():
    draw, (corners, cameras) = renderer(), scene()
    loss = lambda corners: image(draw)(corners, cameras).sum()
    with pytest.raises(RuntimeError, match="not a third time"):
        torch.func.jacrev(torch.func.jacrev(torch.func.jacrev(loss)))(corners)
    with pytest.raises(RuntimeError, match="no forward mode over forward mode"):
        torch.func.jacfwd(torch.func.jacfwd(loss))(corners)


@pytest.mark.parametrize("loss", ["mse", "iou"])
def test_losses_gradients_and_hessian_products_are_those_of_autograd(loss):
    draw = renderer()
    seen = st.project(*scene()).contiguous().requires_grad_()
    target, direction = torch.zeros(1, 4, 5, **F64), torch.rand(2, 4, 3, generator=torch.Generator().manual_seed(0), **F64)
    target[0, 1:3, 1:4] = 1.0
    alpha = st.silhouette(draw, seen)
    if loss == "mse":
        expected = (alpha - target).pow(2).mean((1, 2))
    else:
        overlap = (alpha * target).sum((1, 2))
        expected = 1.0 - overlap / ((alpha + target).sum((1, 2)) - overlap + 1e-6)
    (gradient,) = torch.autograd.grad(expected.sum(), seen, create_graph=True)
    (product,) = torch.autograd.grad((gradient * direction).sum(), seen)
    losses, found, moved = st.hvp(draw, seen, target, direction, loss)
    for a, b in ((losses, expected), (found, gradient), (moved, product)):
        torch.testing.assert_close(a, b, rtol=1e-9, atol=1e-12)
    # The gradient of a gradient, without a backward pass of a backward pass.
    losses, found = st.value_and_grad(draw, seen, target, loss)
    (again,) = torch.autograd.grad((found * direction).sum(), seen)
    torch.testing.assert_close(again, product, rtol=1e-9, atol=1e-12)
    value, change = st.jvp(draw, seen, direction)
    (along,) = torch.autograd.grad((st.silhouette(draw, seen) * value.detach()).sum(), seen)
    torch.testing.assert_close((change * value).sum(), (along * direction).sum(), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("loss", ["mse", "iou"])
@pytest.mark.parametrize("settings", [
    {}, {"cull_back_faces": True}, {"t_conorm": "einstein"}, {"softness": softrast.Softness.learned("shape3d-surrogate")},
], ids=["own", "front", "t_conorm", "surrogate"])
def test_a_loss_in_one_op_is_that_of_two_with_derivatives_of_both_orders_and_modes(loss, settings):
    draw = renderer(**settings)
    seen = st.project(*scene()).detach().contiguous()
    target = torch.rand(1, 4, 5, generator=torch.Generator().manual_seed(0), **F64)
    two = {"mse": st.mse_loss, "iou": st.iou_loss}[loss]
    weights = torch.tensor([0.3, 0.9], **F64)
    # Nonlinear in the losses, so that the upstream has a derivative too.
    of = lambda seen, target: (weights * st.silhouette_loss(draw, seen, target, loss).pow(2)).sum()
    other = lambda seen, target: (weights * two(st.silhouette(draw, seen), target).pow(2)).sum()
    found, expected = ([], [])
    for results, function in ((found, of), (expected, other)):
        for view in (seen, seen.float()):
            results.append(function(view, target).double())
        if settings.keys() & {"softness"}:
            # The gradient of a surrogate is not that of the image: no second derivatives.
            results.append(torch.func.grad(function)(seen, target))
            continue
        results.extend(torch.func.grad(function, (0, 1))(seen, target))
        results.extend(part for row in torch.func.hessian(function, (0, 1))(seen, target) for part in row)
        results.append(torch.func.vmap(torch.func.grad(function), (None, 0))(seen, torch.stack([target, 1.0 - target])))
    for a, b in zip(found, expected, strict=True):
        torch.testing.assert_close(a, b, rtol=1e-6 if a.dim() == 0 else 1e-9, atol=1e-12)
    with torch.no_grad():
        torch.testing.assert_close(of(seen, target), other(seen, target), rtol=1e-9, atol=1e-12)
    target = target.expand(2, 4, 5)
    torch.testing.assert_close(of(seen, target), other(seen, target), rtol=1e-9, atol=1e-12)


def test_a_compiled_step_with_a_loss_in_one_op_has_the_results_of_eager_mode():
    draw = renderer()
    corners, cameras = scene()
    target = torch.full((1, 4, 5), 0.3, **F64)
    loss = lambda corners: st.silhouette_loss(draw, st.project(corners, cameras), target, "iou").sum()
    torch.compiler.reset()
    found = []
    for of in (torch.compile(loss, fullgraph=True), loss):
        leaf = corners.clone().requires_grad_()
        value = of(leaf)
        value.backward()
        found.append((value.detach(), leaf.grad))
    for a, b in zip(*found):
        torch.testing.assert_close(a, b, rtol=1e-12, atol=1e-14)


def test_a_compiled_step_is_one_graph_with_the_results_of_eager_mode():
    draw, paint = renderer(), colours()
    corners, cameras = scene()
    values = torch.rand(4, 2, generator=torch.Generator().manual_seed(1), **F64)
    target = torch.full((1, 4, 5), 0.3, **F64)

    def loss(corners, phi):
        seen = st.project(corners, cameras)
        alpha = st.silhouette(draw, seen, phi)
        return st.iou_loss(alpha, target).sum() + (st.silhouette(draw, seen) - alpha.detach() + 0.1).pow(2).sum() \
            + st.blend(paint, seen, values).pow(2).mean()

    def step(of):
        leaves = corners.clone().requires_grad_(), torch.from_numpy(draw.phi).requires_grad_()
        value = of(*leaves)
        value.backward()
        return value.detach(), *(leaf.grad for leaf in leaves)

    torch.compiler.reset()
    start = time.perf_counter()
    found = step(torch.compile(loss, fullgraph=True))
    spent = time.perf_counter() - start
    for a, b in zip(found, step(loss)):
        torch.testing.assert_close(a, b, rtol=1e-9, atol=1e-12)
    # Fifteen seconds on an idle machine with two cores; the rest is for neighbours.
    assert spent < 60.0


def test_gradients_of_gradients_compile_by_functions_of_their_own():
    draw = renderer()
    seen, direction = st.project(*scene()).contiguous(), torch.rand(2, 4, 3, generator=torch.Generator().manual_seed(0), **F64)
    target = torch.full((1, 4, 5), 0.3, **F64)

    def of(seen):
        losses, gradient = st.value_and_grad(draw, seen, target)
        value, change = st.jvp(draw, seen, direction)
        return losses.sum() + gradient.pow(2).sum() + (change * value).sum()

    torch.compiler.reset()
    expected, found = (torch.func.grad_and_value(of)(seen), None)
    leaf = seen.clone().requires_grad_()
    value = torch.compile(of, fullgraph=True)(leaf)
    value.backward()
    torch.testing.assert_close(value.detach(), expected[1], rtol=1e-9, atol=1e-12)
    torch.testing.assert_close(leaf.grad, expected[0], rtol=1e-9, atol=1e-12)
    product = torch.compile(lambda seen: st.hvp(draw, seen, target, direction)[2], fullgraph=True)(seen)
    torch.testing.assert_close(product, st.hvp(draw, seen, target, direction)[2], rtol=1e-9, atol=1e-12)


def test_an_image_whose_renderer_is_gone_has_gradients():
    corners, cameras = scene()
    leaf = corners.clone().requires_grad_()
    image(renderer())(leaf, cameras).sum().backward()
    assert leaf.grad.isfinite().all() and leaf.grad.abs().max() > 0.0


def test_knots_stay_while_phi_moves_by_little():
    draw = renderer()
    seen = st.project(*scene()).numpy()
    drawn = [softrast.silhouette(draw, seen, draw.phi + by) for by in (0.0, 1e-5, -1e-5, 1e-3, 0.0)]
    fresh = [softrast.silhouette(renderer(), seen, draw.phi + by) for by in (0.0, 1e-5, -1e-5, 1e-3, 0.0)]
    apart = [np.abs(a - b).max() for a, b in zip(drawn, fresh)]
    # New knots are those of a new renderer to rounding; knots that stay are not.
    assert [difference > 1e-12 for difference in apart] == [False, True, True, False, False] and np.array_equal(drawn[0], drawn[4])
    # An image is within the tolerance whatever was drawn before.
    assert max(apart) < 1e-5
