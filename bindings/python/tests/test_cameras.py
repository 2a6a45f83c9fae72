"""Pinhole cameras by K, R and t, and the names of conventions."""

import numpy as np
import pytest

import softrast

POINTS = np.array([[0.3, -0.2, 0.1], [-0.4, 0.5, 0.2], [0.1, 0.1, -0.3], [0.0, 0.0, 0.0]])
K = np.array([[70.0, 1.5, 31.0], [0.0, 72.0, 25.0], [0.0, 0.0, 1.0]])
T = np.array([0.1, -0.2, 3.0])
HEIGHT, WIDTH = 48, 64


def turn():
    """A rotation about all axes."""
    a, b, c = 0.3, -0.5, 0.8
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    about_z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    return about_x @ about_y @ about_z


def pixels(seen):
    """Places of projected vertices in pixels, the centre of the first one at 0."""
    shorter = min(HEIGHT, WIDTH)
    return np.stack([(seen[..., 0] * shorter + WIDTH) / 2 - 0.5, (HEIGHT - seen[..., 1] * shorter) / 2 - 0.5], -1)


def test_a_camera_of_opencv_sees_points_where_its_formula_has_them():
    seen = softrast.project(POINTS, softrast.pinhole(K, turn(), T, (HEIGHT, WIDTH)))
    at = (POINTS @ turn().T + T) @ K.T
    assert np.allclose(pixels(seen)[0], at[:, :2] / at[:, 2:], rtol=0, atol=1e-12)
    assert np.allclose(seen[0, :, 2], at[:, 2])


def test_the_same_camera_has_a_pose_in_each_convention():
    expected = softrast.pinhole(K, turn(), T, (HEIGHT, WIDTH))
    flip, left = np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, -1.0, 1.0])
    assert np.allclose(softrast.pinhole(K, flip @ turn(), flip @ T, (HEIGHT, WIDTH), "opengl"), expected, rtol=0, atol=1e-14)
    # Row vectors.
    assert np.allclose(softrast.pinhole(K, (left @ turn()).T, left @ T, (HEIGHT, WIDTH), "pytorch3d"), expected, rtol=0, atol=1e-14)


def test_a_camera_of_pytorch3d_is_that_of_its_own_helper():
    torch = pytest.importorskip("torch")
    import softrast.pytorch3d as sp

    r, t = torch.from_numpy(turn())[None], torch.from_numpy(T)[None]
    focal, middle = 2.1, [0.1, -0.05]
    # x and y of the principal point go left and up in its NDC.
    half = 0.5 * min(HEIGHT, WIDTH)
    k = np.array([[focal * half, 0, WIDTH / 2 - middle[0] * half - 0.5], [0, focal * half, HEIGHT / 2 - middle[1] * half - 0.5], [0, 0, 1.0]])
    found = softrast.pinhole(k, r.numpy(), t.numpy(), (HEIGHT, WIDTH), "pytorch3d")
    assert np.allclose(found, sp.cameras(r, t, focal, torch.tensor([middle], dtype=torch.float64)), rtol=0, atol=1e-12)


def test_frameworks_have_the_same_cameras_and_views_share_what_they_have_once():
    turns, shifts = np.stack([turn(), np.eye(3)]), np.stack([T, 2 * T])
    expected = softrast.pinhole(K, turns, shifts, 32, "opengl")
    assert expected.shape == (2, 3, 4)
    assert np.array_equal(expected[1], softrast.pinhole(K, np.eye(3), 2 * T, 32, "opengl")[0])
    torch = pytest.importorskip("torch")
    import softrast.torch as st

    assert np.array_equal(st.pinhole(*map(torch.from_numpy, (K, turns, shifts)), 32, "opengl"), expected)
    pytest.importorskip("jax")
    import softrast.jax as sj

    assert np.allclose(sj.pinhole(K, turns, shifts, 32, "opengl"), expected, rtol=1e-6)


@pytest.mark.parametrize("call, message", [
    (lambda: softrast.pinhole(K, turn(), T, 32, "blender"), "convention must be one of opencv, opengl, pytorch3d, found 'blender'"),
    (lambda: softrast.pinhole(K, turn(), np.zeros((2, 4)), 32), r"or have views first, found \[3, 3\], \[3, 3\] and \[2, 4\]"),
    (lambda: softrast.pinhole(K, np.stack([turn()] * 2), np.zeros((3, 3)), 32), r"found \[3, 3\], \[2, 3, 3\] and \[3, 3\]"),
])
def test_bad_cameras_are_errors_of_one_line(call, message):
    with pytest.raises(ValueError, match=message) as error:
        call()
    assert "\n" not in str(error.value)
