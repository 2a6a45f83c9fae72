"""Values and derivatives against what Rust computes by itself, to the last bit.

`cargo run --release --example reference` writes the file that the variable SOFTRAST_REFERENCE names.
"""

import os

import numpy as np
import pytest

import softrast

torch = pytest.importorskip("torch")
import softrast.torch as st  # noqa: E402


@pytest.fixture(scope="module")
def reference():
    path = os.environ.get("SOFTRAST_REFERENCE")
    if not path:
        pytest.skip("SOFTRAST_REFERENCE names no file")
    with open(path) as file:
        lines = [line.split() for line in file]
    return {name: np.array([int(bits, 16) for bits in numbers], np.uint64).view(np.float64) for name, *numbers in lines}


def pattern(shape):
    return torch.from_numpy((np.arange(np.prod(shape)) * 37 % 17 / 8.0 - 1.0).reshape(tuple(shape)))


def same(reference, name, tensor):
    assert np.array_equal(reference[name], tensor.detach().numpy().ravel()), name


def scene():
    positions, faces, _ = softrast.icosphere(1)
    camera = torch.from_numpy(softrast.orbit(2.5, 10.0, [20.0, 75.0]))
    return torch.from_numpy(positions)[None], faces, camera


def test_silhouettes_and_their_derivatives_of_both_orders(reference):
    vertices, faces, camera = scene()
    renderer = softrast.Renderer(faces, (12, 10), softrast.Softness("logistic", 0.05))
    leaves = [x.requires_grad_() for x in (vertices, camera, torch.from_numpy(renderer.phi))]
    image = st.silhouette(renderer, st.project(*leaves[:2]), leaves[2])
    same(reference, "image", image)
    first = torch.autograd.grad((image * pattern(image.shape)).sum(), leaves, create_graph=True)
    for name, gradient in zip(["vertices", "cameras", "phi"], first):
        same(reference, name, gradient)
    second = torch.autograd.grad((first[0].reshape(-1) * pattern([first[0].numel()])).sum(), leaves)
    for name, gradient in zip(["vertices2", "cameras2", "phi2"], second):
        same(reference, name, gradient)


def test_colours_and_their_derivatives_of_both_orders(reference):
    vertices, faces, camera = scene()
    renderer = softrast.ColourRenderer(faces, (12, 10), softrast.Softness("logistic", 0.05), [1.5, 3.5])
    seen = st.project(vertices, camera)
    names = ["vertices", "attributes", "phi", "phi_depth", "background", "log_weight"]
    numbers = [
        seen.contiguous(), pattern([1, seen.shape[1], 2]), torch.from_numpy(renderer.phi), torch.from_numpy(renderer.phi_depth),
        torch.tensor([0.25, 0.5], dtype=torch.float64), torch.tensor([renderer.log_weight], dtype=torch.float64),
    ]
    leaves = dict(zip(names, (x.detach().requires_grad_() for x in numbers)))
    image = st.blend(renderer, **leaves)
    same(reference, "blend", image)
    first = torch.autograd.grad((image * pattern(image.shape)).sum(), list(leaves.values()), create_graph=True)
    for name, gradient in zip(names, first):
        same(reference, f"blend-{name}", gradient)
    second = torch.autograd.grad((first[0] * pattern(first[0].shape)).sum(), list(leaves.values()))
    for name, gradient in zip(names, second):
        same(reference, f"blend-{name}2", gradient)


def test_a_meta_gradient_through_30_steps_of_adam(reference):
    positions, faces, _ = softrast.fox()
    vertices = torch.from_numpy(positions)
    renderer = softrast.Renderer(faces, 32, softrast.Softness("logistic", 0.05))
    image = lambda angles, phi: st.silhouette(renderer, st.project(vertices, st.orbit(2.7, *angles)), phi)
    truth = torch.tensor([20.0, 30.0], dtype=torch.float64)
    target = image(truth, torch.tensor([0.01], dtype=torch.float64).log())
    phi = torch.from_numpy(renderer.phi).requires_grad_()
    angles = torch.tensor([10.0, 45.0], dtype=torch.float64, requires_grad=True)
    mean, square = torch.zeros(2, dtype=torch.float64), torch.zeros(2, dtype=torch.float64)
    for step in range(1, 31):
        loss = (image(angles, phi) - target).pow(2).mean()
        (gradient,) = torch.autograd.grad(loss, angles, create_graph=True)
        mean = 0.9 * mean + 0.1 * gradient
        square = 0.99 * square + 0.01 * gradient * gradient
        root = (square / (1.0 - 0.99 ** step) + 1e-16).sqrt() + 1e-8
        angles = angles - mean / (1.0 - 0.9 ** step) / root
    loss = (angles - truth).pow(2).sum()
    (gradient,) = torch.autograd.grad(loss, phi)
    assert abs(gradient.item()) > 1.0
    assert loss.item() == pytest.approx(reference["meta-loss"][0], rel=1e-8)
    assert gradient.item() == pytest.approx(reference["meta-phi"][0], rel=1e-9)
