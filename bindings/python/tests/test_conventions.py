"""Conventions of PyTorch3D and nvdiffrast, against their published formulas in plain tensor ops."""

import math

import numpy as np
import pytest

import softrast

torch = pytest.importorskip("torch")
import softrast.pytorch3d as sp  # noqa: E402
import softrast.torch as st  # noqa: E402

SIGMA, FOCAL, MIDDLE = 1e-3, 2.1, [0.1, -0.05]


def mesh():
    """A ball that is pressed and sheared, so that no two of its sides look the same."""
    positions, faces, _ = softrast.icosphere(1)
    x, y, z = positions.T
    return torch.from_numpy(np.stack([x + 0.3 * y, 0.6 * y, 0.8 * z - 0.2 * x], 1)), torch.from_numpy(faces)


def look_at(distance, elevation, azimuth):
    """`R` `[1, 3, 3]` and `T` `[1, 3]` for row vectors, of axes x left, y up, z ahead, of a camera that looks at the origin."""
    e, a = math.radians(elevation), math.radians(azimuth)
    eye = distance * torch.tensor([math.cos(e) * math.sin(a), math.sin(e), math.cos(e) * math.cos(a)], dtype=torch.float64)
    z = -eye / distance
    x = torch.nn.functional.normalize(torch.linalg.cross(torch.tensor([0.0, 1.0, 0.0], dtype=torch.float64), z), dim=0)
    r = torch.stack([x, torch.linalg.cross(z, x), z], 1)
    return r[None], -(eye @ r)[None]


def theirs(points, faces, height, width, sigma):
    """`1 - prod(1 - sigmoid(-dists / sigma))` for points `[V, 2]` in NDC with x left and y up: the first pixel is at the largest of both."""
    shorter = min(height, width)
    rows, columns = ((side - 2.0 * torch.arange(side, dtype=torch.float64) - 1.0) / shorter for side in (height, width))
    y, x = torch.meshgrid(rows, columns, indexing="ij")
    pixels = torch.stack([x, y], -1).reshape(-1, 1, 2)
    nearest, sides = None, []
    for start, end in ((0, 1), (1, 2), (2, 0)):
        a, b = points[faces[:, start]], points[faces[:, end]]
        along, off = b - a, pixels - a
        share = ((off * along).sum(-1) / (along * along).sum(-1)).clamp(0.0, 1.0)
        squared = (off - share[..., None] * along).pow(2).sum(-1)
        nearest = squared if nearest is None else torch.minimum(nearest, squared)
        sides.append(along[:, 0] * off[..., 1] - along[:, 1] * off[..., 0] > 0.0)
    inside = (sides[0] == sides[1]) & (sides[1] == sides[2])
    dists = torch.where(inside, -nearest, nearest)
    return (1.0 - (1.0 - torch.sigmoid(-dists / sigma)).prod(-1)).reshape(height, width)


@pytest.mark.parametrize("size", [24, (20, 28), (28, 20)])
def test_a_silhouette_of_pytorch3d_comes_out_with_its_gradients(size):
    (points, faces), (r, t) = mesh(), look_at(3.0, 20.0, 35.0)
    leaves = [x.requires_grad_() for x in (points, r, t)]
    height, width = (size, size) if isinstance(size, int) else size
    weights = torch.rand(height, width, dtype=torch.float64, generator=torch.Generator().manual_seed(0))

    silhouettes = sp.SoftSilhouette(faces, size, sigma=SIGMA, blur_radius=math.log(1 / 1e-4 - 1) * SIGMA, tolerance=1e-7)
    image = silhouettes(points, sp.cameras(r, t, FOCAL, torch.tensor([MIDDLE])))
    assert image.shape == (1, height, width, 4) and (image[..., :3] == 1.0).all()
    gradients = torch.autograd.grad((image[0, ..., 3] * weights).sum(), leaves)

    seen = points @ r[0] + t
    ndc = FOCAL * seen[:, :2] / seen[:, 2:] + torch.tensor(MIDDLE)
    expected = theirs(ndc, faces, height, width, SIGMA)
    assert 0.1 < expected.mean() < 0.9
    assert (image[0, ..., 3] - expected).abs().max() < 1e-6
    for found, one in zip(gradients, torch.autograd.grad((expected * weights).sum(), leaves)):
        assert (found - one).abs().max() < 1e-3 * one.abs().max()


def test_an_orbit_shows_what_look_at_view_transform_does():
    (points, faces), (r, t) = mesh(), look_at(3.0, 20.0, 35.0)
    focal = 1.0 / math.tan(math.radians(25.0))
    seen = st.project(points, sp.cameras(r, t, focal))
    assert torch.allclose(seen, st.project(points, st.orbit(3.0, 20.0, 180.0 - 35.0, 50.0)), rtol=0.0, atol=1e-12)


def test_cameras_of_several_views_may_have_a_focal_length_each():
    r, t = (torch.cat(x) for x in zip(look_at(3.0, 20.0, 35.0), look_at(2.0, 0.0, 80.0)))
    both = sp.cameras(r, t, torch.tensor([1.5, 2.0]), torch.tensor([[0.1, 0.2]]))
    each = [sp.cameras(r[k:k + 1], t[k:k + 1], focal, torch.tensor([0.1, 0.2])[None]) for k, focal in enumerate([1.5, 2.0])]
    assert torch.equal(both, torch.cat(each))


@pytest.mark.parametrize("height, width", [(24, 24), (20, 28), (28, 20)])
def test_clip_space_is_what_an_orbit_sees(height, width):
    points, faces = mesh()
    shorter = min(height, width)
    # OpenGL: x right, y up, z behind the camera; its frustum is as wide as the image.
    eye = st.orbit(3.0, 20.0, 145.0, 50.0)
    expected = st.project(points, eye)
    focal = 1.0 / math.tan(math.radians(25.0))
    r, t = look_at(3.0, 20.0, 35.0)
    left, up, ahead = (points @ r[0] + t).unbind(-1)
    near, far = 0.1, 10.0
    depth = (far + near) / (near - far) * -ahead + 2.0 * far * near / (near - far)
    clip = torch.stack([-left * focal * shorter / width, up * focal * shorter / height, depth, ahead], -1)[None]
    found = st.from_clip(clip, (height, width))
    assert torch.allclose(found, expected, rtol=0.0, atol=1e-12)


def test_clip_space_behind_the_camera_is_not_drawn_and_has_no_nan():
    clip = torch.tensor([[[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, -1.0], [0.0, 1.0, 0.0, 1.0]]], requires_grad=True)
    renderer = softrast.Renderer([[0, 1, 2]], 8, softrast.Softness("logistic", 0.1))
    image = st.silhouette(renderer, st.from_clip(clip, 8))
    assert (image == 0.0).all()
    image.sum().backward()
    assert clip.grad.isfinite().all()


@pytest.mark.parametrize("call, message", [
    (lambda: st.from_clip(torch.zeros(1, 3, 3), 8), r"clip must be \[views, V, 4\]"),
    (lambda: sp.cameras(torch.eye(3), torch.zeros(3)), r"R must be \[N, 3, 3\] and T \[N, 3\], found \[3, 3\] and \[3\]"),
    (lambda: sp.cameras(torch.eye(3)[None], torch.zeros(1, 3), torch.ones(4)), r"focal_length must be a number, \[1\] or \[1, 2\]"),
    (lambda: sp.SoftSilhouette([[0, 1, 2]], 8, blur_radius=0.0), "blur_radius 0 cuts faces off where they cover 0.5"),
    (lambda: sp.SoftSilhouette([[0, 1, 2]], 8, sigma=0.0), "the scale of a softness is 0"),
])
def test_bad_input_is_an_error_of_one_line(call, message):
    with pytest.raises(ValueError, match=message) as error:
        call()
    assert "\n" not in str(error.value)
