"""The functions for PyTorch: values, first and second derivatives."""

import numpy as np
import pytest

import softrast

torch = pytest.importorskip("torch")
import softrast.torch as st  # noqa: E402

FACES = [[0, 1, 2], [1, 3, 2]]
CORNERS = [[[-0.6, -0.5, 0.1], [0.5, -0.6, -0.2], [0.05, 0.55, 0.0], [0.8, 0.4, 0.3]]]


def renderer(**settings):
    softness = settings.pop("softness", softrast.Softness("logistic", 0.1))
    return softrast.Renderer(FACES, (6, 5), softness, tolerance=1e-9, **settings)


def leaves():
    corners = torch.tensor(CORNERS, dtype=torch.float64, requires_grad=True)
    camera = torch.from_numpy(softrast.orbit(2.5, 10.0, [20.0, 70.0])).requires_grad_()
    return corners, camera


@pytest.mark.parametrize("t_conorm", ["probabilistic", "einstein", "yager:2"])
def test_gradients_of_both_orders_are_those_of_differences(t_conorm):
    draw = renderer(t_conorm=t_conorm)
    phi = torch.from_numpy(draw.phi).requires_grad_()

    def image(corners, camera, phi):
        return st.silhouette(draw, st.project(corners, camera), phi)

    inputs = (*leaves(), phi)
    assert torch.autograd.gradcheck(image, inputs, eps=1e-6, atol=1e-5, rtol=1e-3)
    torch.manual_seed(1)
    assert torch.autograd.gradgradcheck(image, inputs, eps=1e-6, atol=1e-4, rtol=1e-2)


def test_torch_and_numpy_draw_the_same_bits():
    draw = renderer()
    corners, camera = leaves()
    image = st.silhouette(draw, st.project(corners, camera)).detach().numpy()
    seen = softrast.project(np.array(CORNERS), camera.detach().numpy())
    assert np.array_equal(image, softrast.silhouette(draw, seen))
    assert image.shape == (2, 6, 5) and image.min() >= 0.0 and image.max() <= 1.0


def test_a_third_derivative_is_refused():
    draw, (corners, camera) = renderer(), leaves()
    value = st.silhouette(draw, st.project(corners, camera)).pow(2).sum()
    (first,) = torch.autograd.grad(value, corners, create_graph=True)
    (second,) = torch.autograd.grad(first.pow(2).sum(), corners, create_graph=True)
    with pytest.raises(RuntimeError, match="twice"):
        second.sum().backward()


def test_a_softness_of_f32_images_learns_in_f64():
    draw, (corners, camera) = renderer(), leaves()
    phi = torch.from_numpy(draw.phi).requires_grad_()
    image = st.silhouette(draw, st.project(corners.float(), camera.float()), phi)
    assert image.dtype == torch.float32
    image.sum().backward()
    assert phi.grad.dtype == torch.float64 and phi.grad.abs().item() > 0.0


def test_the_gradient_of_a_surrogate_is_that_of_the_wider_softness():
    softness = softrast.Softness.learned("shape3d-surrogate")
    draw = renderer(softness=softness)
    surrogate = draw._native.surrogate()
    corners, camera = leaves()
    weights = torch.linspace(-1.0, 1.0, 60, dtype=torch.float64).reshape(2, 6, 5)
    seen = st.project(corners, camera)
    image = st.silhouette(draw, seen)
    assert np.array_equal(image.detach().numpy(), softrast.silhouette(draw, seen.detach().numpy()))
    (gradient,) = torch.autograd.grad((image * weights).sum(), seen, create_graph=True)
    # The image's own softness maps sums to coverage; the surrogate's gives the derivative of the sums.
    scene = np.ascontiguousarray(seen.detach().numpy().swapaxes(1, 2))
    _, sums = surrogate.call("value", [scene], [], [])
    upstream = ((1.0 - image) * weights).detach().numpy() * np.exp(sums)
    (expected,) = surrogate.call("vjp", [scene, sums, upstream], [], [True])
    expected = torch.from_numpy(expected).transpose(1, 2)
    assert gradient.abs().max() > 1e-3 and torch.allclose(gradient, expected, rtol=1e-9, atol=1e-12)
    assert torch.autograd.grad(gradient.pow(2).sum(), corners)[0].isfinite().all()


def test_gradients_of_colours_of_both_orders_are_those_of_differences():
    draw = softrast.ColourRenderer(FACES, (5, 4), softrast.Softness("logistic", 0.2), [1.5, 3.5], depth_scale=0.3, tolerance=1e-9)
    corners, camera = leaves()
    seen = st.project(corners, camera).detach().requires_grad_()
    f64 = dict(dtype=torch.float64, requires_grad=True)
    values = torch.tensor([[[0.1, 0.7], [0.4, 0.2], [0.9, 0.5], [0.3, 0.6]]], **f64)
    background, log_weight = torch.tensor([0.2, 0.8], **f64), torch.tensor([-4.0], **f64)
    phi, phi_depth = (torch.from_numpy(x).requires_grad_() for x in (draw.phi, draw.phi_depth))

    def image(seen, values, background, log_weight, phi, phi_depth):
        return st.blend(draw, seen, values, background, log_weight=log_weight, phi=phi, phi_depth=phi_depth)

    inputs = (seen, values, background, log_weight, phi, phi_depth)
    assert torch.autograd.gradcheck(image, inputs, eps=1e-6, atol=1e-5, rtol=1e-3)
    torch.manual_seed(1)
    assert torch.autograd.gradgradcheck(image, inputs, eps=1e-6, atol=1e-4, rtol=1e-2, fast_mode=True)


def test_a_texture_and_the_places_on_it_receive_gradients():
    draw = softrast.ColourRenderer(FACES, (5, 4), softrast.Softness("logistic", 0.2), [1.5, 3.5])
    seen = st.project(*leaves()).detach()
    picture = torch.rand(3, 2, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0)).requires_grad_()
    places = torch.tensor([[0.3, 0.3], [0.6, 0.35], [0.4, 0.6], [0.7, 0.7]], dtype=torch.float64, requires_grad=True)
    image = lambda places, picture: st.blend(draw, seen, places, 0.5, texture=picture)
    assert image(places, picture).shape == (2, 4, 5, 4)
    assert torch.autograd.gradcheck(image, (places, picture), eps=1e-6, atol=1e-6)
    plain = softrast.blend(draw, seen.numpy(), places.detach().numpy(), 0.5, texture=picture.detach().numpy())
    assert np.array_equal(image(places, picture).detach().numpy(), plain)


def test_an_orbit_is_that_of_numpy_and_passes_gradients_on():
    azimuth = torch.tensor([20.0, 70.0], requires_grad=True)
    camera = st.orbit(2.5, 10.0, azimuth)
    assert camera.dtype == torch.float32 and st.orbit(2.5).dtype == torch.float64
    assert np.array_equal(camera.detach().numpy(), softrast.orbit(2.5, 10.0, [20.0, 70.0]).astype("f4"))
    camera[:, 2].sum().backward()
    assert azimuth.grad.tolist() == [1.0, 1.0]


def test_vertices_of_all_views_need_no_axis_of_views():
    corners, camera = leaves()
    assert torch.equal(st.project(corners[0], camera), st.project(corners, camera))
    hard = st.hard_silhouette(st.project(corners, camera), torch.tensor(FACES), 8)
    assert hard.shape == (2, 8, 8) and hard.dtype == torch.float64 and 0.0 < hard.mean() < 1.0


def test_memory_does_not_grow_over_gradients_of_both_orders():
    resource = pytest.importorskip("resource")
    draw, (corners, camera) = renderer(), leaves()

    def step():
        image = st.silhouette(draw, st.project(corners, camera))
        (gradient,) = torch.autograd.grad(image.sum(), corners, create_graph=True)
        torch.autograd.grad(gradient.sum(), corners)

    used = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(500):
        step()
    before = used()
    for _ in range(10_000):
        step()
    assert used() - before < 8192, "kB"


def test_tensors_of_another_type_are_refused():
    corners, camera = leaves()
    with pytest.raises(ValueError, match="vertices must be float32 or float64, found torch.int64"):
        st.project(corners.long(), camera)


def test_a_meta_gradient_through_30_steps_is_that_of_differences():
    draw = renderer()
    truth = torch.from_numpy(softrast.orbit(2.5, 10.0, 20.0))
    corners = torch.tensor(CORNERS, dtype=torch.float64)

    def image(angles, phi):
        camera = torch.cat([truth[:, :1], angles, truth[:, 3:]], 1)
        return st.silhouette(draw, st.project(corners, camera), phi)

    def result(phi):
        angles = torch.tensor([[22.0, 35.0]], dtype=torch.float64, requires_grad=True)
        target = image(truth[:, 1:3], phi.detach() * 0 + np.log(0.05))
        for _ in range(30):
            loss = (image(angles, phi) - target).pow(2).mean()
            angles = angles - 100.0 * torch.autograd.grad(loss, angles, create_graph=True)[0]
        return (angles - truth[:, 1:3]).pow(2).sum()

    phi = torch.from_numpy(draw.phi).requires_grad_()
    (gradient,) = torch.autograd.grad(result(phi), phi)
    phi = phi.detach()
    difference = (result(phi + 1e-5) - result(phi - 1e-5)) / 2e-5
    assert gradient.abs().item() > 1e-3
    assert gradient.item() == pytest.approx(difference.item(), rel=1e-5)
