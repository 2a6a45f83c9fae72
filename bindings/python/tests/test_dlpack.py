"""Arrays of other libraries in the functions of NumPy."""

import numpy as np
import pytest

import softrast
from softrast import _shapes

FACES = np.array([[0, 1, 2], [1, 3, 2]])
CORNERS = np.array([[-0.6, -0.5, 0.1], [0.5, -0.6, -0.2], [0.05, 0.55, 0.0], [0.8, 0.4, 0.3]])


class Foreign:
    """An array that has nothing but the protocol of DLPack."""

    def __init__(self, array, device=1):
        self.own, self.device = array, device

    def __dlpack__(self, **settings):
        return self.own.__dlpack__(**settings)

    def __dlpack_device__(self):
        return self.device, 0


def torch_tensor(array):
    return pytest.importorskip("torch").from_numpy(np.array(array))


def jax_array(array):
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    try:
        return jax.numpy.asarray(array)
    finally:
        jax.config.update("jax_enable_x64", False)


@pytest.fixture(params=[Foreign, torch_tensor, jax_array], ids=["dlpack", "torch", "jax"])
def given(request):
    return request.param


def test_images_of_other_arrays_are_those_of_numpy(given):
    cameras = softrast.orbit(given(np.array([2.5, 2.7])), 10.0, given(np.array([20.0, 70.0])))
    assert np.array_equal(cameras, softrast.orbit([2.5, 2.7], 10.0, [20.0, 70.0]))
    seen = softrast.project(CORNERS, cameras)
    assert np.array_equal(softrast.project(given(CORNERS), given(cameras)), seen)
    softness = softrast.Softness("logistic", 0.1)
    draw, own = softrast.Renderer(given(FACES), 8, softness), softrast.Renderer(FACES, 8, softness)
    assert np.array_equal(softrast.silhouette(draw, given(seen), given(np.array([-2.0]))), softrast.silhouette(own, seen, [-2.0]))
    assert np.array_equal(softrast.hard_silhouette(given(seen), given(FACES), 8), softrast.hard_silhouette(seen, FACES, 8))
    painter = softrast.ColourRenderer(given(FACES), 8, softness, [1.0, 4.0])
    values, background = np.linspace(0.0, 1.0, 8).reshape(4, 2), np.array([0.2, 0.8])
    picture, places = np.linspace(0.0, 1.0, 12).reshape(2, 2, 3), values * 0.5 + 0.2
    for attributes, behind, more in [(values, background, {}), (places, np.zeros(3), {"texture": picture, "corners": FACES})]:
        expected = softrast.blend(painter, seen, attributes, behind, phi=painter.phi, phi_depth=painter.phi_depth, **more)
        others = {name: given(array) for name, array in more.items()}
        found = softrast.blend(
            painter, given(seen), given(attributes), given(behind), phi=given(painter.phi), phi_depth=given(painter.phi_depth), **others)
        assert np.array_equal(found, expected)


def test_cameras_meshes_and_views_of_other_arrays_are_those_of_numpy(given, tmp_path):
    K, R, t = np.array([[9.0, 0.0, 4.0], [0.0, 9.0, 4.0], [0.0, 0.0, 1.0]]), np.eye(3), np.array([0.0, 0.0, 3.0])
    assert np.array_equal(softrast.pinhole(given(K), given(R), given(t), 8), softrast.pinhole(K, R, t, 8))
    softrast.save_mesh(tmp_path / "a.ply", given(CORNERS), given(FACES), given(np.abs(CORNERS)))
    assert np.array_equal(softrast.load_mesh(tmp_path / "a.ply")[1], FACES)
    mask = np.zeros((8, 8), np.float32)
    mask[2:5, 2:5] = 1.0
    views = softrast.Views([given(mask)], given(K), given(R[None]), given(t[None]), [given(np.zeros((8, 8, 3), np.uint8))])
    assert np.array_equal(views.masks[0], mask) and np.array_equal(views.R[0], R)


def test_numbers_are_not_copied(given):
    array = given(CORNERS)
    read = _shapes.floats(array, "vertices")
    again = array.own if given is Foreign else np.from_dlpack(array)
    assert np.shares_memory(read, again)


def test_results_go_to_others_without_copies():
    image = softrast.silhouette(softrast.Renderer(FACES, 8, softrast.Softness("logistic", 0.1)), softrast.project(CORNERS, softrast.orbit(2.5)))
    assert np.shares_memory(np.from_dlpack(image), image)
    torch = pytest.importorskip("torch")
    tensor = torch.from_dlpack(image)
    assert tensor.data_ptr() == image.__array_interface__["data"][0] and tensor.shape == (1, 8, 8)


def test_what_does_not_lie_on_the_cpu_is_refused():
    with pytest.raises(ValueError, match="vertices must lie on the CPU"):
        softrast.project(Foreign(CORNERS, device=2), softrast.orbit(2.5))


def test_a_tensor_with_a_gradient_is_refused_in_one_line():
    tensor = torch_tensor(CORNERS).requires_grad_()
    with pytest.raises(ValueError, match="vertices is no array: .*detach") as error:
        softrast.project(tensor, softrast.orbit(2.5))
    assert "\n" not in str(error.value)


def test_half_floats_are_refused_with_their_type():
    torch = pytest.importorskip("torch")
    with pytest.raises(ValueError, match="vertices must be float32 or float64, found float16"):
        softrast.project(torch.zeros(4, 3, dtype=torch.float16), softrast.orbit(2.5))
    with pytest.raises(ValueError, match="vertices is no array: .*BFloat16"):
        softrast.project(torch.zeros(4, 3, dtype=torch.bfloat16), softrast.orbit(2.5))
