"""The functions for JAX: values, derivatives of both orders, jit and vmap."""

import gc
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import softrast

jax = pytest.importorskip("jax")
import jax.numpy as jnp  # noqa: E402
from jax.test_util import check_grads  # noqa: E402

import softrast.jax as sj  # noqa: E402
from softrast import _passes  # noqa: E402

FACES = [[0, 1, 2], [1, 3, 2]]
CORNERS = np.array([[-0.6, -0.5, 0.1], [0.5, -0.6, -0.2], [0.05, 0.55, 0.0], [0.8, 0.4, 0.3]])
CAMERAS = softrast.orbit(2.5, 10.0, [20.0, 70.0])


@pytest.fixture(autouse=True)
def wide():
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", False)


def renderer(**settings):
    softness = settings.pop("softness", softrast.Softness("logistic", 0.1))
    return softrast.Renderer(FACES, (6, 5), softness, tolerance=1e-9, **settings)


def image(draw, corners, cameras, *phi):
    return sj.silhouette(draw, sj.project(corners, cameras), *phi)


def test_jax_and_numpy_draw_the_same_bits_also_compiled():
    draw = renderer()
    expected = softrast.silhouette(draw, softrast.project(CORNERS, CAMERAS))
    of = lambda corners, cameras: image(draw, corners, cameras)
    for found in (of(CORNERS, CAMERAS), jax.jit(of)(CORNERS, CAMERAS)):
        assert found.shape == (2, 6, 5) and np.array_equal(found, expected)


@pytest.mark.parametrize("t_conorm", ["probabilistic", "yager:2"])
def test_gradients_of_both_orders_are_those_of_differences(t_conorm):
    draw = renderer(t_conorm=t_conorm)
    check_grads(lambda *x: image(draw, *x), (CORNERS, CAMERAS), order=2, modes=["rev"], eps=1e-5)
    check_grads(lambda *x: image(draw, *x), (CORNERS, CAMERAS, draw.phi), order=1, modes=["fwd"], eps=1e-5)


def test_both_modes_have_the_same_second_derivatives():
    draw = renderer()
    loss = lambda corners, phi: (image(draw, corners, CAMERAS, phi) ** 2).sum()
    for at in (0, 1):
        expected = jax.jacrev(jax.grad(loss, at), at)(CORNERS, draw.phi)
        hessian = jax.hessian(loss, at)
        for of in (hessian, jax.jit(hessian), jax.jacrev(jax.jacfwd(loss, at), at)):
            assert np.allclose(of(CORNERS, draw.phi), expected, rtol=1e-10, atol=1e-12)
    # All views in one call, and each by itself.
    one = lambda camera: jax.hessian(lambda corners: (image(draw, corners, camera[None]) ** 2).sum())(CORNERS)
    assert np.allclose(jax.vmap(one)(CAMERAS), np.stack([one(camera) for camera in CAMERAS]), rtol=1e-10, atol=1e-12)
    with pytest.raises(ValueError, match="no forward mode over forward mode"):
        jax.jacfwd(jax.jacfwd(loss))(CORNERS, draw.phi)


def test_losses_are_their_formulas_with_gradients_of_both():
    a, b = np.random.default_rng(0).random((2, 2, 6, 5))
    overlap = (a * b).sum((1, 2))
    assert np.allclose(sj.mse_loss(a, b), ((a - b) ** 2).mean((1, 2)))
    assert np.allclose(sj.iou_loss(a, b), 1 - overlap / (a.sum((1, 2)) + b.sum((1, 2)) - overlap + 1e-6))
    for loss in (sj.mse_loss, sj.iou_loss):
        check_grads(loss, (a, b), order=2, modes=["rev"], eps=1e-5)
        check_grads(loss, (a, b), order=1, modes=["fwd"], eps=1e-5)


@pytest.mark.parametrize("loss", ["mse", "iou"])
def test_a_loss_in_one_op_is_that_of_two_with_derivatives_of_both_orders(loss):
    draw, target = renderer(), jnp.asarray(np.random.default_rng(0).random((1, 6, 5)))
    seen, two = sj.project(CORNERS, CAMERAS), {"mse": sj.mse_loss, "iou": sj.iou_loss}[loss]
    of = lambda seen, target: (sj.silhouette_loss(draw, seen, target, loss) ** 2).sum()
    other = lambda seen, target: (two(sj.silhouette(draw, seen), target) ** 2).sum()
    for derivative in (lambda f: f, lambda f: jax.grad(f, (0, 1)), lambda f: jax.hessian(f, (0, 1)), lambda f: jax.jit(jax.grad(f))):
        found, expected = (jax.tree.leaves(derivative(f)(seen, target)) for f in (of, other))
        assert all(np.allclose(a, b, rtol=1e-9, atol=1e-12) for a, b in zip(found, expected))
    phi = jnp.asarray(draw.phi)
    assert np.allclose(sj.silhouette_loss(draw, seen, target, loss, phi), two(sj.silhouette(draw, seen), target))
    with pytest.raises(ValueError, match="loss must be one of mse, iou"):
        sj.silhouette_loss(draw, seen, target, "l1")


def test_colours_are_those_of_numpy_with_derivatives_of_both_orders():
    draw = softrast.ColourRenderer(FACES, (4, 3), softrast.Softness("logistic", 0.2), [1.5, 3.5], depth_scale=0.3, tolerance=1e-9)
    seen = softrast.project(CORNERS, CAMERAS)
    values, background = np.random.default_rng(0).random((4, 2)), np.array([0.2, 0.8])
    of = lambda seen, values, background, log_weight, phi, phi_depth: sj.blend(
        draw, seen, values, background, log_weight=log_weight, phi=phi, phi_depth=phi_depth)
    given = seen, values, background, np.array([-4.0]), draw.phi, draw.phi_depth
    assert np.array_equal(jax.jit(of)(*given), softrast.blend(draw, seen, values, background, log_weight=-4.0))
    check_grads(of, given, order=2, modes=["rev"], eps=1e-5)
    check_grads(of, given, order=1, modes=["fwd"], eps=1e-5)
    places, picture = np.array([[0.3, 0.3], [0.6, 0.35], [0.4, 0.6], [0.7, 0.7]]), np.random.default_rng(1).random((3, 2, 3))
    textured = lambda places, picture: sj.blend(draw, seen, places, 0.5, texture=picture, corners=FACES)
    assert np.array_equal(textured(places, picture), softrast.blend(draw, seen, places, 0.5, texture=picture, corners=FACES))
    check_grads(textured, (places, picture), order=1, modes=["fwd", "rev"], eps=1e-6)
    each = jax.vmap(lambda view: sj.blend(draw, view[None], values)[0])(seen)
    assert np.array_equal(each, softrast.blend(draw, seen, values))


def test_derivatives_of_colours_can_be_mapped_over():
    draw = softrast.ColourRenderer(FACES, (4, 3), softrast.Softness("logistic", 0.2), [1.5, 3.5], depth_scale=0.3)
    seen = jnp.asarray(softrast.project(CORNERS, CAMERAS))
    palettes = np.random.default_rng(0).random((3, 4, 2))
    loss = lambda values, view: (sj.blend(draw, view[None], values, 0.5) ** 2).sum()
    for of in (jax.grad(loss, (0, 1)), lambda *x: (jax.hessian(loss)(*x),), lambda values, view: (jax.jacfwd(loss, 1)(values, view),)):
        mapped = jax.jit(jax.vmap(jax.vmap(of, (None, 0)), (0, None)))(palettes, seen)
        each = [[of(values, view) for view in seen] for values in palettes]
        for k, found in enumerate(mapped):
            assert np.allclose(found, np.stack([np.stack([pair[k] for pair in row]) for row in each]), rtol=1e-10, atol=1e-12)


def test_gradients_of_phi_are_those_of_torch():
    torch = pytest.importorskip("torch")
    import softrast.torch as st

    draw = renderer()

    def loss(corners, phi):
        return (image(draw, corners, CAMERAS, phi) ** 2).sum()

    def second(corners, phi):
        by_corners, by_phi = jax.grad(loss, (0, 1))(corners, phi)
        return (by_corners ** 2).sum() + 3.0 * (by_phi ** 2).sum()

    corners, phi = (torch.from_numpy(x).requires_grad_() for x in (CORNERS.copy(), draw.phi))
    value = st.silhouette(draw, st.project(corners, torch.from_numpy(CAMERAS)), phi).pow(2).sum()
    first = torch.autograd.grad(value, (corners, phi), create_graph=True)
    expected = torch.autograd.grad(first[0].pow(2).sum() + 3.0 * first[1].pow(2).sum(), (corners, phi))
    for of in (lambda f: f, jax.jit):
        found = of(jax.grad(loss, (0, 1)))(CORNERS, draw.phi)
        assert all(np.allclose(a, b.detach(), rtol=1e-12, atol=1e-14) for a, b in zip(found, first))
        found = of(jax.grad(second, (0, 1)))(CORNERS, draw.phi)
        assert all(np.allclose(a, b, rtol=1e-12, atol=1e-12) for a, b in zip(found, expected))


def test_views_can_be_mapped_over():
    draw = renderer()
    one = lambda corners, camera: image(draw, corners, camera[None])[0]
    loss = lambda corners, camera: (one(corners, camera) ** 2).sum()
    expected = image(draw, CORNERS, CAMERAS)
    assert np.array_equal(jax.vmap(one, (None, 0))(CORNERS, CAMERAS), expected)
    # Gradients of each view by itself, of first and second order.
    first = jax.grad(loss, (0, 1))
    second = jax.grad(lambda *x: sum((part ** 2).sum() for part in first(*x)), (0, 1))
    for derivative in (first, second):
        mapped = jax.jit(jax.vmap(derivative, (None, 0)))(CORNERS, CAMERAS)
        each = [derivative(CORNERS, camera) for camera in CAMERAS]
        assert all(np.allclose(a, np.stack(b), rtol=1e-12, atol=1e-14) for a, b in zip(mapped, zip(*each)))


def test_softnesses_can_be_mapped_over():
    draw = renderer()
    phis = draw.phi + np.array([[0.0], [0.3], [-0.2]])
    loss = lambda phi: (image(draw, CORNERS, CAMERAS, phi) ** 2).sum()
    for of in (loss, jax.grad(loss), jax.grad(lambda phi: jax.grad(loss)(phi).sum())):
        assert np.allclose(jax.vmap(of)(phis), np.stack([of(phi) for phi in phis]), rtol=1e-12)


def test_the_gradient_of_a_surrogate_is_that_of_torch():
    torch = pytest.importorskip("torch")
    import softrast.torch as st

    draw = renderer(softness=softrast.Softness.learned("shape3d-surrogate"))
    corners = torch.from_numpy(CORNERS.copy()).requires_grad_()
    value = st.silhouette(draw, st.project(corners, torch.from_numpy(CAMERAS))).pow(2).sum()
    (first,) = torch.autograd.grad(value, corners, create_graph=True)
    (second,) = torch.autograd.grad(first.pow(2).sum(), corners)
    gradient = jax.grad(lambda corners: (image(draw, corners, CAMERAS) ** 2).sum())
    assert np.allclose(gradient(CORNERS), first.detach(), rtol=1e-12, atol=1e-14)
    assert np.allclose(jax.grad(lambda x: (gradient(x) ** 2).sum())(CORNERS), second, rtol=1e-12, atol=1e-12)


def test_floats_of_32_bits_stay_so():
    jax.config.update("jax_enable_x64", False)
    draw = renderer()
    corners, cameras = CORNERS.astype("f4"), CAMERAS.astype("f4")
    found = image(draw, jnp.asarray(corners), jnp.asarray(cameras))
    assert found.dtype == jnp.float32
    assert np.array_equal(found, softrast.silhouette(draw, softrast.project(corners, cameras)))
    assert sj.orbit(2.5, 10.0, [20.0, 70.0]).shape == (2, 4)


@pytest.mark.parametrize("call, message", [
    (lambda: sj.project(CORNERS, np.zeros((1, 5))), "cameras must be orbits"),
    (lambda: sj.project(jnp.zeros((4, 3), int), CAMERAS), "vertices must be float32 or float64"),
    (lambda: sj.silhouette(renderer(), CORNERS[None, :2]), "a face uses vertex 3, but there are 2"),
    (lambda: sj.silhouette(renderer(), CORNERS[None], np.zeros(2)), r"phi must be \[1\], found \[2\]"),
])
def test_bad_input_is_an_error_of_one_line(call, message):
    with pytest.raises(ValueError, match=message) as error:
        call()
    assert "\n" not in str(error.value)


def test_a_third_derivative_is_refused():
    draw = renderer()
    f = lambda x: (image(draw, x, CAMERAS) ** 2).sum()
    for _ in range(2):
        f = (lambda g: lambda x: (jax.grad(g)(x) ** 2).sum())(f)
    with pytest.raises(ValueError, match="not a third time"):
        jax.grad(f)(CORNERS)


def squares(draw):
    return lambda corners, cameras, phi: (image(draw, corners, cameras, phi) ** 2).sum()


DERIVATIVES = {
    "value_and_grad": lambda loss: jax.value_and_grad(loss, (0, 1, 2)),
    "jvp": lambda loss: lambda *x: jax.jvp(loss, x, tuple(jnp.ones_like(part) for part in x)),
    "hessian": lambda loss: jax.hessian(loss, (0, 1, 2)),
    "vmap": lambda loss: jax.vmap(jax.grad(lambda corners, camera, phi: loss(corners, camera[None], phi)), (None, 0, None)),
}


@pytest.mark.parametrize("wide", [True, False], ids=["f64", "f32"])
@pytest.mark.parametrize("derivative", DERIVATIVES)
def test_a_derivative_is_the_same_compiled(derivative, wide):
    jax.config.update("jax_enable_x64", wide)
    draw = renderer()
    of = DERIVATIVES[derivative](squares(draw))
    given = tuple(jnp.asarray(x) for x in (CORNERS, CAMERAS, draw.phi))
    found, expected = (jax.tree.leaves(f(*given)) for f in (jax.jit(of), of))
    assert len(found) == len(expected)
    for a, b in zip(found, expected):
        assert a.dtype == b.dtype == (jnp.float64 if wide else jnp.float32)
        assert np.abs(a - b).max() <= (1e-12 if wide else 1e-5) * (1.0 + np.abs(b).max())


def test_colours_of_32_bits_are_the_same_compiled():
    jax.config.update("jax_enable_x64", False)
    draw = softrast.ColourRenderer(FACES, (4, 3), softrast.Softness("logistic", 0.2), [1.5, 3.5], depth_scale=0.3)
    seen, values = jnp.asarray(softrast.project(CORNERS, CAMERAS), jnp.float32), jnp.asarray(np.random.default_rng(0).random((4, 2)), jnp.float32)
    loss = lambda seen, values, phi: (sj.blend(draw, seen, values, 0.5, phi=phi) ** 2).sum()
    given = seen, values, jnp.asarray(draw.phi)
    for of in (jax.value_and_grad(loss, (0, 1, 2)), jax.hessian(loss, (1, 2))):
        for a, b in zip(*(jax.tree.leaves(f(*given)) for f in (jax.jit(of), of))):
            assert a.dtype == jnp.float32 and np.abs(a - b).max() <= 1e-5 * (1.0 + np.abs(b).max())


def test_phi_may_be_wider_than_the_vertices():
    draw = renderer()
    seen = jnp.asarray(softrast.project(CORNERS, CAMERAS), jnp.float32)
    loss = lambda seen, phi: sj.silhouette(draw, seen, phi).sum()
    for of in (jax.grad(loss, (0, 1)), jax.jit(jax.grad(loss, (0, 1)))):
        by_seen, by_phi = of(seen, jnp.asarray(draw.phi))
        assert by_seen.dtype == jnp.float32 and by_phi.dtype == jnp.float64 and jnp.abs(by_phi[0]) > 0.0


def test_compiled_functions_call_no_python():
    draw = renderer()
    text = jax.jit(jax.grad(squares(draw))).lower(CORNERS, CAMERAS, draw.phi).as_text()
    assert "@softrast" in text and "callback" not in text


def test_a_function_cannot_be_compiled_for_a_gpu():
    draw = renderer()
    traced = jax.jit(lambda seen: sj.silhouette(draw, seen)).trace(jnp.asarray(softrast.project(CORNERS, CAMERAS)))
    with pytest.raises(ValueError, match="softrast draws on the CPU, found a function that is compiled for cuda"):
        traced.lower(lowering_platforms=("cuda",))


def test_a_compiled_function_keeps_its_renderer():
    seen = jnp.asarray(softrast.project(CORNERS, CAMERAS))

    def compiled():
        draw = renderer()
        of = jax.jit(lambda seen: sj.silhouette(draw, seen))
        return of.lower(seen).compile(), of, draw._by_own.handle, draw._by_own.id, softrast.silhouette(draw, seen)

    early, of, handle, number, expected = compiled()
    assert np.array_equal(of(seen), expected)
    del of
    jax.clear_caches()
    gc.collect()
    assert np.array_equal(early(seen), expected) and handle in _passes._NAMED
    del early
    jax.clear_caches()
    gc.collect()
    assert handle not in _passes._NAMED
    with pytest.raises(jax.errors.JaxRuntimeError, match="the renderer of a compiled function is gone"):
        called(number, [jnp.swapaxes(seen, 1, 2)], [expected, expected])


def called(function, arrays, results, order=0, along=0, wanted=0):
    """The results of a call by XLA of the handler itself."""
    like = [jax.ShapeDtypeStruct(result.shape, result.dtype) for result in results]
    settings = np.array([function, order, along, wanted], np.int64).view(np.int32)
    return jax.ffi.ffi_call("softrast", like)(settings, *arrays)


VERTICES, IMAGE = np.zeros((2, 3, 4)) + 1.0, np.zeros((2, 6, 5))


@pytest.mark.parametrize("arrays, results, settings, message", [
    ([VERTICES[:, :2]], [IMAGE] * 2, {}, "shapes do not fit"),
    ([VERTICES[:, :, :3]], [IMAGE] * 2, {}, "shapes do not fit"),
    ([VERTICES[0, 0]], [IMAGE] * 2, {}, "shapes do not fit"),
    ([], [IMAGE] * 2, {}, "shapes do not fit"),
    ([VERTICES.astype("i4")], [IMAGE] * 2, {}, "must be float32 or float64"),
    ([VERTICES, IMAGE, IMAGE.astype("f4")], [VERTICES], dict(order=3, wanted=1), "must be of one type"),
    ([VERTICES, IMAGE, IMAGE[:1]], [VERTICES], dict(order=3, wanted=1), "shapes do not fit"),
    ([VERTICES], [IMAGE], {}, "has 2 results, XLA expects 1"),
    ([VERTICES], [IMAGE, IMAGE[:1]], {}, "a result is"),
    ([VERTICES], [IMAGE, IMAGE.astype("f4")], {}, "a result is"),
    ([VERTICES], [IMAGE] * 2, dict(order=7), "no such derivative"),
    ([VERTICES], [IMAGE] * 2, dict(order=-1), "no such derivative"),
])
def test_the_handler_refuses_calls_that_do_not_fit(arrays, results, settings, message):
    draw = renderer()
    assert np.asarray(called(draw._by_own.id, [VERTICES], [IMAGE] * 2)).shape == (2, *IMAGE.shape)
    # A call that JAX has compiled before raises a ValueError.
    with pytest.raises((jax.errors.JaxRuntimeError, ValueError), match=message):
        called(draw._by_own.id, arrays, results, **settings)


@pytest.mark.parametrize("arrays, message", [
    ([], "a call has no settings"),
    ([VERTICES], "must be its settings"),
    ([np.zeros(7, np.int32), VERTICES], "must be its settings"),
    ([np.zeros(8, np.float32), VERTICES], "must be its settings"),
])
def test_the_handler_refuses_other_settings(arrays, message):
    like = [jax.ShapeDtypeStruct(IMAGE.shape, IMAGE.dtype)] * 2
    with pytest.raises(jax.errors.JaxRuntimeError, match=message):
        jax.ffi.ffi_call("softrast", like)(*arrays)


def test_a_compiled_function_refuses_values_in_one_line():
    draw = renderer()
    seen = softrast.project(CORNERS, CAMERAS)
    of = jax.jit(lambda phi: sj.silhouette(draw, seen, phi))
    with pytest.raises(jax.errors.JaxRuntimeError, match=r"phi\[0\] is NaN, expected a finite number"):
        of(np.array([np.nan]))
    paint = softrast.ColourRenderer(FACES, (4, 3), softrast.Softness("logistic", 0.2), [1.5, 3.5])
    with pytest.raises(jax.errors.JaxRuntimeError, match="attributes must be finite"):
        jax.jit(lambda values: sj.blend(paint, seen, values))(np.full((4, 2), np.inf))


def test_threads_draw_what_one_draws():
    draws = [renderer(), renderer(softness=softrast.Softness("gauss", 0.05))]
    steps = [jax.jit(jax.value_and_grad(squares(draw), (0, 1, 2))) for draw in draws]
    scenes = [(k % 2, CORNERS + 0.01 * k, CAMERAS, draws[k % 2].phi * (1.0 + 0.1 * (k // 4))) for k in range(24)]
    of = lambda scene: jax.tree.leaves(steps[scene[0]](*scene[1:]))
    expected = [of(scene) for scene in scenes]
    with ThreadPoolExecutor(2) as threads:
        for _ in range(3):
            for found, one in zip(threads.map(of, scenes), expected):
                assert all(map(np.array_equal, found, one))
