"""Functions that need NumPy alone."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time

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
    (lambda: softrast.silhouette(renderer(), CORNERS[0]), r"vertices must be \[views, V, 3\] with at least one view, as project returns them, found \[3, 3\]"),
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
    (lambda: softrast.Softness.learned("nothing"), "no softness of that kind is called"),
    (lambda: softrast.load_mesh("missing.obj"), "missing.obj"),
    (lambda: softrast.project(CORNERS, np.zeros((1, 5))), "cameras must be orbits"),
])
def test_bad_input_is_an_error_of_one_line(call, message):
    with pytest.raises(ValueError, match=message) as error:
        call()
    assert "\n" not in str(error.value)


def test_cameras_of_another_float_type_are_taken_in_that_of_the_vertices():
    assert softrast.project(CORNERS.astype("f4"), softrast.orbit(3.0)).dtype == np.float32
    with pytest.raises(ValueError, match="of one type, float32 or float64"):
        softrast._native.perspective().call("image", [CORNERS, np.zeros((1, 3, 4), "f4")], [], [])


def test_a_softness_with_a_surrogate_draws_its_own_image():
    softness = softrast.Softness.learned("shape3d-surrogate")
    assert softness.has_surrogate and "surrogate" in repr(softness)
    plain = softness.with_phi(softness.phi_at(0.5, 9))
    assert not plain.has_surrogate
    images = [softrast.silhouette(softrast.Renderer(FACES, 9, kind, progress=0.5), CORNERS) for kind in (softness, plain)]
    assert np.array_equal(*images)


def colours(**settings):
    return softrast.ColourRenderer(FACES, 9, softrast.Softness("logistic", 0.01), [0.5, 1.5], **settings)


def test_a_face_of_one_colour_hides_the_background_where_it_covers_a_pixel():
    image = softrast.blend(colours(), CORNERS, np.full((3, 2), [0.25, 0.75]), [1.0, 0.0])
    assert image.shape == (1, 3, 9, 9)
    assert image[0, :, 4, 4] == pytest.approx([0.25, 0.75, 1.0], abs=2e-3)
    assert image[0, :, 0, 0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-5)


def test_without_back_faces_a_face_is_seen_from_one_side():
    both, culled = (softrast.blend(colours(cull_back_faces=cull), CORNERS, np.ones((3, 1))) for cull in (False, True))
    mirrored = softrast.blend(colours(cull_back_faces=True), CORNERS * [-1, 1, 1], np.ones((3, 1)))
    shares = [image[0, 1].max() for image in (both, culled, mirrored)]
    # The corners go counter-clockwise.
    assert shares[0] > 0.9 and shares[1] == shares[0] and shares[2] == 0.0


def test_entries_of_corners_and_a_texture_show_what_vertices_would():
    values = np.array([[0.1], [0.5], [0.9]])
    expected = softrast.blend(colours(), CORNERS, values)
    assert np.array_equal(softrast.blend(colours(), CORNERS, values[::-1].copy(), corners=[[2, 1, 0]]), expected)
    # A picture of one row is a straight line between the centres of its texels.
    places = np.stack([0.25 + 0.5 * values[:, 0], np.full(3, 0.5)], 1)
    painted = softrast.blend(colours(), CORNERS, places, texture=[[[0.0], [1.0]]])
    assert painted == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("call, message", [
    (lambda: softrast.blend(colours(), CORNERS, np.zeros((2, 3))), "a corner has entry 2, but there are attributes of 2"),
    (lambda: softrast.blend(colours(), CORNERS, np.zeros((2, 3, 3))), r"attributes must be \[entries, channels\] or \[1 or 1"),
    (lambda: softrast.blend(colours(), CORNERS, np.zeros((3, 2)), [0.0] * 3), r"background must be a number or \[2\], found \[3\]"),
    (lambda: softrast.blend(colours(), CORNERS, np.full((3, 2), np.nan)), "attributes must be finite"),
    (lambda: softrast.blend(colours(), CORNERS, np.zeros((3, 3)), texture=np.zeros((2, 2, 1))), "places with 2 numbers"),
    (lambda: softrast.blend(colours(), CORNERS, np.zeros((3, 2)), texture=np.zeros((2, 2, 5))), "1 to 4 channels"),
    (lambda: softrast.blend(colours(), CORNERS, np.zeros((3, 1)), corners=[[0, 1, 2]] * 2), "a row for each of the 1 faces, found 2"),
    (lambda: softrast.blend(colours(), CORNERS, np.zeros((3, 1)), log_weight=np.inf), "log_weight is inf"),
    (lambda: softrast.blend(colours(), CORNERS, np.zeros((3, 1)), phi_depth=[0.0]), "phi_depth of exp has 2 parameters, found 1"),
    (lambda: softrast.ColourRenderer(FACES, 9, softrast.Softness("logistic", 0.01), [2.0, 1.0]), "the planes are"),
    (lambda: softrast.ColourRenderer(FACES, 9, softrast.Softness("logistic", 0.01), 2.0), "planes must be a near and a far depth"),
    (lambda: colours(depth="deep"), "unknown depth softness"),
    (lambda: colours(depth_scale=0.0), "the scale of the depth softness is 0"),
    (lambda: softrast.ColourRenderer(FACES, 9, softrast.Softness.learned("shape3d-surrogate"), [1.0, 2.0]), "only silhouettes use"),
    (lambda: softrast.Renderer(FACES, 9, "logistic"), "softness must be a softrast.Softness .* found str"),
    (lambda: softrast.project([[0, 0, 0]], softrast.orbit(3.0)), "vertices must be float32 or float64, found int64"),
    (lambda: softrast.project([[0.0, 0.0], [0.0]], softrast.orbit(3.0)), "vertices is no array"),
    (lambda: softrast.save_mesh("a.ply", np.zeros((3, 2)), FACES), r"positions must be \[N, 3\], found \[3, 2\]"),
])
def test_bad_colours_and_types_are_errors_of_one_line(call, message):
    with pytest.raises(ValueError, match=message) as error:
        call()
    assert "\n" not in str(error.value)


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


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_process_that_was_forked_draws_too():
    script = """
import os, signal, numpy as np, softrast
positions, faces, _ = softrast.icosphere(2)
draw = softrast.Renderer(faces, 64, softrast.Softness("logistic", 0.02))
image = lambda: softrast.silhouette(draw, softrast.project(positions, softrast.orbit(2.7, 0.0, [0.0, 10.0])))
expected = image()
child = os.fork()
if not child:
    signal.alarm(20)
    os._exit(0 if np.array_equal(image(), expected) else 1)
assert os.waitpid(child, 0)[1] == 0
"""
    assert subprocess.run([sys.executable, "-c", script], timeout=60).returncode == 0


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


def test_ctrl_c_is_seen_once_a_long_call_ends():
    script = """
import signal, sys, numpy as np, softrast
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background is started with it ignored
positions, faces, _ = softrast.icosphere(4)
seen = softrast.project(positions, softrast.orbit(2.7, 0.0, [0.0, 10.0]))
draw = softrast.Renderer(faces, 256, softrast.Softness("logistic", 0.02))
print("ready", flush=True)
try:
    for _ in range(1000):
        softrast.silhouette(draw, seen)
except KeyboardInterrupt:
    sys.exit(7)
"""
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    # A thousand calls would take minutes.
    assert process.wait(timeout=120) == 7


def test_other_faces_are_drawn_as_by_a_new_renderer():
    positions, faces, _ = softrast.icosphere(2)
    _, finer, _ = softrast.icosphere(3)
    seen = softrast.project(np.concatenate([positions, np.eye(3)])[None], softrast.orbit(2.5, 10.0, 30.0))
    settings = {"tolerance": 1e-6, "cull_back_faces": True}
    soft = softrast.Softness("gauss", 0.05)
    first = softrast.Renderer(faces, (12, 15), soft, **settings)
    painter = softrast.ColourRenderer(faces, (12, 15), soft, [1.0, 4.0], **settings)
    attributes = np.ones((seen.shape[1], 3))
    # Fewer faces, and their knots serve; more vertices than the mesh has are an error.
    other, new = first.with_faces(faces[::2]), softrast.Renderer(faces[::2], (12, 15), soft, **settings)
    assert np.abs(softrast.silhouette(other, seen) - softrast.silhouette(new, seen)).max() < 1e-6
    assert np.array_equal(other.faces, faces[::2]) and repr(other) == repr(new)
    assert np.array_equal(softrast.silhouette(pickle.loads(pickle.dumps(other)), seen), softrast.silhouette(new, seen))
    shown = [softrast.blend(one, seen, attributes) for one in (painter.with_faces(faces[::2]), softrast.ColourRenderer(faces[::2], (12, 15), soft, [1.0, 4.0], **settings))]
    assert np.abs(shown[0] - shown[1]).max() < 1e-6
    with pytest.raises(ValueError, match="a face uses vertex"):
        softrast.silhouette(first.with_faces(finer), seen)
    with pytest.raises(ValueError, match="at least one face"):
        first.with_faces(faces[:0])


def test_renderers_state_their_error():
    faces = np.array([[0, 1, 2]])
    softness = softrast.Softness("logistic", 0.01)
    assert softrast.Renderer(faces, 16, softness, tolerance=1e-6).error_bound == 1e-6
    assert softrast.ColourRenderer(faces, 16, softness, (1.0, 4.0), tolerance=1e-4).error_bound == 1e-4
    # Powers below 1 of a law that begins rise faster than knots follow.
    steep = softrast.Renderer(faces, 16, softrast.Softness("uniform", 1e-3, squared=True), tolerance=1e-7, t_conorm="yager:0.3")
    assert steep.error_bound > 1e-7


def test_silhouettes_without_back_faces_are_those_of_front_faces():
    faces = [[0, 1, 2], [0, 2, 1]]
    draw = lambda faces, **more: softrast.silhouette(softrast.Renderer(faces, 8, softrast.Softness("logistic", 0.1), **more), CORNERS)
    front, back, both = draw(faces[:1]), draw(faces[1:]), draw(faces, cull_back_faces=True)
    assert np.abs(both - front).max() < 2e-5 or np.abs(both - back).max() < 2e-5
    assert np.abs(draw(faces) - both).max() > 1e-3
