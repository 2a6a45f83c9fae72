"""What needs NumPy alone."""

import threading

import numpy as np
import pytest

import softrast

FACES = [[0, 1, 2]]
CORNERS = np.array([[[-0.6, -0.5, 1.0], [0.6, -0.5, 1.0], [0.0, 0.6, 1.0]]])


def renderer(scale=0.01, **settings):
    return softrast.Renderer(FACES, 9, softrast.Softness("logistic", scale), **settings)


def test_one_face_is_the_logistic_of_its_signed_distance():
    image = softrast.silhouette(renderer(0.1, tolerance=1e-9), CORNERS)
    # The middle of the image is 0.5 above the lower edge; the other two edges pass at 0.6 * 0.6 / hypot(0.6, 1.1).
    distance = 0.36 / np.hypot(0.6, 1.1)
    assert image[0, 4, 4] == pytest.approx(1 / (1 + np.exp(-distance / 0.1)), abs=1e-9)


def test_a_narrow_softness_draws_the_hard_image():
    image = softrast.silhouette(renderer(1e-5), CORNERS)
    hard = softrast.hard_silhouette(CORNERS, FACES, 9)
    assert hard.sum() > 10 and np.abs(image - hard).max() < 1e-3


def test_f32_and_f64_agree():
    wide, narrow = (softrast.silhouette(renderer(0.05), CORNERS.astype(kind)) for kind in ("f8", "f4"))
    assert narrow.dtype == np.float32 and np.abs(wide - narrow).max() < 1e-5


def test_arrays_that_are_not_contiguous_draw_the_same():
    strided = np.zeros((1, 3, 6))
    strided[..., ::2] = CORNERS
    assert np.array_equal(softrast.silhouette(renderer(), strided[..., ::2]), softrast.silhouette(renderer(), CORNERS))


def test_nan_never_comes_out():
    broken = CORNERS.copy()
    broken[0, 1, 0] = np.nan
    assert np.isfinite(softrast.silhouette(renderer(), broken)).all()


@pytest.mark.parametrize("call, message", [
    (lambda: softrast.silhouette(renderer(), CORNERS[0]), r"vertices must be \[views, V, 3\] with at least one view, found \[3, 3\]"),
    (lambda: softrast.silhouette(renderer(), CORNERS[:0]), "at least one view"),
    (lambda: softrast.silhouette(renderer(), CORNERS[:, :2]), "a face uses vertex 2, but there are 2"),
    (lambda: softrast.silhouette(renderer(), CORNERS, [np.nan]), r"phi\[0\] is NaN, expected a finite number"),
    (lambda: softrast.silhouette(renderer(), CORNERS, [0.0, 1.0]), "has 1 parameters, found 2"),
    (lambda: softrast.Renderer(np.zeros((0, 3), int), 9, softrast.Softness("logistic", 0.1)), "at least one face"),
    (lambda: softrast.Renderer([[0, 1, -2]], 9, softrast.Softness("logistic", 0.1)), "face 0 uses vertex -2"),
    (lambda: softrast.Renderer([[0.0, 1.0, 2.0]], 9, softrast.Softness("logistic", 0.1)), "faces must be integers"),
    (lambda: softrast.Renderer(FACES, 0, softrast.Softness("logistic", 0.1)), "size must be"),
    (lambda: renderer(tolerance=2.0), "the tolerance is 2"),
    (lambda: renderer(t_conorm="max"), "unknown T-conorm"),
    (lambda: softrast.Softness("sigmoid", 0.1), "unknown softness"),
    (lambda: softrast.Softness("logistic", -1.0), "the scale of a softness is -1"),
    (lambda: softrast.Softness.learned("nothing"), "no learned softness is called"),
    (lambda: softrast.load_mesh("missing.obj"), "missing.obj"),
    (lambda: softrast.project(CORNERS, np.zeros((1, 5))), "cameras must be orbits"),
])
def test_bad_input_is_an_error_of_one_line(call, message):
    with pytest.raises(ValueError, match=message) as error:
        call()
    assert "\n" not in str(error.value)


def test_arrays_of_two_float_types_are_refused():
    with pytest.raises(TypeError, match="of one type"):
        softrast.project(CORNERS, softrast.orbit(3.0).astype("f4"))


def test_meshes_and_softnesses_come_back_from_files(tmp_path):
    positions, faces, colours = softrast.icosphere(1)
    softrast.save_mesh(tmp_path / "a.ply", positions, faces)
    again = softrast.load_mesh(tmp_path / "a.ply")
    assert np.array_equal(again[0], positions) and np.array_equal(again[1], faces) and again[2] is colours is None
    learned = softrast.Softness.learned("pose")
    learned.save(tmp_path / "s.json")
    assert np.array_equal(softrast.Softness.load(tmp_path / "s.json").phi_at(0.5), learned.phi_at(0.5))


def test_threads_draw_the_same_bits():
    draw, images = renderer(), []
    expected = softrast.silhouette(draw, CORNERS)
    threads = [threading.Thread(target=lambda: images.append(softrast.silhouette(draw, CORNERS))) for _ in range(8)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert len(images) == 8 and all(np.array_equal(image, expected) for image in images)


def test_memory_does_not_grow():
    resource = pytest.importorskip("resource")
    draw = renderer()
    of = lambda calls: [softrast.silhouette(draw, CORNERS) for _ in range(calls)] and resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(500):
        softrast.silhouette(draw, CORNERS)
    before = of(1)
    for _ in range(10_000):
        softrast.silhouette(draw, CORNERS)
    assert of(1) - before < 4096, "kB"
