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
    # One preparation for all: a difference must not see the support move with φ.
    prepared = draw.prepared(draw.phi)

    def image(corners, camera, phi):
        table = st._Value.apply(prepared.table(), phi)
        seen = st.project(corners, camera)
        sums = st._Value.apply(prepared.sum(), seen.transpose(1, 2).contiguous(), table)
        return st._Value.apply(prepared.coverage(), sums)

    inputs = (*leaves(), phi)
    assert torch.equal(image(*inputs), st.silhouette(draw, st.project(*inputs[:2]), phi))
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


def test_tensors_of_another_type_are_refused():
    corners, camera = leaves()
    with pytest.raises(ValueError, match="vertices must be a float32 or float64 tensor on the CPU, found torch.int64"):
        st.project(corners.long(), camera)


def test_a_meta_gradient_through_30_steps_is_that_of_differences():
    draw = renderer()
    prepared = draw.prepared(draw.phi)
    truth = torch.from_numpy(softrast.orbit(2.5, 10.0, 20.0))
    corners = torch.tensor(CORNERS, dtype=torch.float64)

    def image(angles, phi):
        camera = torch.cat([truth[:, :1], angles, truth[:, 3:]], 1)
        table = st._Value.apply(prepared.table(), phi)
        seen = st.project(corners, camera).transpose(1, 2).contiguous()
        return st._Value.apply(prepared.coverage(), st._Value.apply(prepared.sum(), seen, table))

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
