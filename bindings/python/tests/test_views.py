"""Views from folders and arrays, meshes from views, and colours from pictures."""

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import softrast

DATA = Path(__file__).parents[3] / "data"
FOX, LENS = DATA / "views/fox", DATA / "views/fox_lens"
EYES = 3.0 * np.array([[0.0, 0.3, -1.0], [1.0, 0.1, 0.1], [-0.3, 0.2, 1.0], [-1.0, -0.4, 0.2], [0.1, 1.0, 0.2], [0.5, -0.9, -0.4]])


def look_at(eyes):
    """R and t of cameras that look at the origin."""
    ahead = -eyes / np.linalg.norm(eyes, axis=1, keepdims=True)
    right = np.cross(ahead, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    R = np.stack([right, np.cross(ahead, right), ahead], 1)
    return R, -(R @ eyes[:, :, None])[:, :, 0]


def ball():
    """A ball, wider than high, with colours that follow its shape."""
    positions, faces, _ = softrast.icosphere(3)
    positions = positions * [1.0, 0.7, 1.0]
    return positions, faces, 0.5 + 0.4 * np.sin(3.0 * positions)


def ball_views(size=(40, 48), **more):
    """Views of the ball with soft colours."""
    positions, faces, colours = ball()
    K = np.array([[50.0, 0.0, 23.0], [0.0, 50.0, 20.0], [0.0, 0.0, 1.0]])
    R, t = look_at(EYES)
    seen = softrast.project(positions, softrast.pinhole(K, R, t, size))
    draw = softrast.ColourRenderer(faces, size, softrast.Softness("logistic", 0.005), [1.0, 6.0])
    image = softrast.blend(draw, seen, colours)
    masks = softrast.hard_silhouette(seen, faces, size)
    pictures = (255.0 * image[:, :3].clip(0.0, 1.0)).round().astype(np.uint8).transpose(0, 2, 3, 1)
    return softrast.Views(masks, K, R, t, pictures, **more)


@pytest.fixture(scope="module")
def fox():
    return softrast.load_views(FOX)


def test_views_of_a_folder_have_the_cameras_of_the_file(fox):
    assert len(fox) == 12 and fox.names[3] == "images/03.png" and fox.masks[3].shape == (90, 120)
    assert np.array_equal(fox.masks[3], softrast.load_mask(FOX / "images/03.png"))
    cameras = json.loads((FOX / "transforms.json").read_text())
    assert np.allclose(fox.K[3], [[cameras["fl_x"], 0, cameras["cx"] - 0.5], [0, cameras["fl_y"], cameras["cy"] - 0.5], [0, 0, 1]])
    world = np.linalg.inv(np.array(cameras["frames"][3]["transform_matrix"]))
    flip = np.diag([1.0, -1.0, -1.0])
    assert np.allclose(fox.R[3], flip @ world[:3, :3]) and np.allclose(fox.t[3], flip @ world[:3, 3])
    assert fox.pictures[3].shape == (90, 120, 4) and (fox.pictures[3][..., 3] == 1.0).all() and fox.normals is None


def test_the_true_mesh_has_the_masks_of_its_views(fox):
    positions, faces, _ = softrast.load_mesh(DATA / "meshes/fox.obj")
    images = softrast.hard_silhouette(softrast.project(positions, fox.cameras), faces, (90, 120)) > 0.5
    masks = np.stack(fox.masks) >= 0.5
    assert (images & masks).sum() > 0.97 * (images | masks).sum()


def test_a_lens_is_undone_and_a_model_of_colmap_has_the_same_cameras(tmp_path):
    straight = softrast.load_views(LENS)
    assert any("distorts" in note for note in straight.notes)
    shutil.copytree(LENS, tmp_path / "views")
    (tmp_path / "views/transforms.json").unlink()
    colmap = softrast.load_views(tmp_path / "views", pictures=False)
    order = [colmap.names.index(Path(name).name) if Path(name).name in colmap.names else colmap.names.index(name) for name in straight.names]
    assert np.allclose(colmap.R[order], straight.R, atol=1e-6) and np.allclose(colmap.t[order], straight.t, atol=1e-5)
    assert np.allclose(colmap.K, straight.K) and colmap.pictures is None
    bent = softrast.load_mask(LENS / "masks/00.png")
    assert np.abs(bent - straight.masks[0]).sum() > 10


def test_slices_of_views_are_views(fox):
    some = fox[1::4]
    assert some.names == (fox.names[1], fox.names[5], fox.names[9]) and np.array_equal(some.R, fox.R[1::4]) and len(some.pictures) == 3
    assert len(fox[-1]) == 1 and fox[-1].names == (fox.names[-1],) and some.cameras.shape == (3, 3, 4)
    again = fox[[1, 5, -3]]
    assert again.names == some.names and np.array_equal(again.t, some.t) and np.array_equal(again.masks[2], some.masks[2])
    with pytest.raises(IndexError):
        fox[12]


def test_a_mesh_has_the_masks_of_its_views_also_those_held_out(fox, tmp_path):
    seen = []
    held_out = fox[2::6]
    found = softrast.fit_mesh(fox[[k for k in range(12) if k % 6 != 2]], steps=80, progress=lambda *step: seen.append(step))
    assert found.complete and found.iou.shape == (10,) and found.iou.mean() > 0.93 and found.iou_of(held_out).mean() > 0.85
    assert [step for step, _, _ in seen] == list(range(1, 81)) and all(count == 80 for _, count, _ in seen)
    edges = np.sort(found.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), 1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all(), "closed"
    found.save(tmp_path / "a.ply")
    again = softrast.load_mesh(tmp_path / "a.ply")
    assert np.allclose(again[0], found.positions, atol=1e-6) and np.array_equal(again[1], found.faces) and found.colours is None


def test_few_faces_and_a_start_are_kept_to():
    views = ball_views()
    sphere = softrast.icosphere(2)
    for start in ("sphere", sphere):
        found = softrast.fit_mesh(views, steps=40, size=32, max_faces=300, start=start)
        assert len(found.faces) <= 300 and found.iou.mean() > 0.9


def test_colours_come_with_the_surface():
    found = softrast.fit_mesh(ball_views(), colours=True, steps=120)
    assert found.colours.shape == found.positions.shape and found.iou.mean() > 0.95 and found.psnr.mean() > 20.0
    # Normals of the ball, at the nearest of its vertices.
    positions, _, colours = ball()
    nearest = ((found.positions[:, None] - positions) ** 2).sum(2).argmin(1)
    assert np.abs(found.colours - colours[nearest]).mean() < 0.12


def test_normals_pull_the_surface():
    views = ball_views()
    positions, faces, _ = ball()
    normals = positions / [1.0, 0.49, 1.0]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    draw = softrast.ColourRenderer(faces, (40, 48), softrast.Softness("logistic", 0.005), [1.0, 6.0])
    image = softrast.blend(draw, softrast.project(positions, views.cameras), (normals + 1.0) / 2.0)
    pictures = image.clip(0.0, 1.0).transpose(0, 2, 3, 1)
    turned = softrast.Views(views.masks, views.K, views.R, views.t, normals=pictures)

    def error(found):
        return np.abs(((found.positions / [1.0, 0.7, 1.0]) ** 2).sum(1) ** 0.5 - 1.0).mean()

    with_normals, without = (softrast.fit_mesh(part[:3], steps=100) for part in (turned, views))
    assert error(with_normals) < 0.6 * error(without)


def test_a_mesh_takes_the_colours_of_pictures():
    views, (positions, faces, colours) = ball_views(), ball()
    seen = []
    found = softrast.paint((positions, faces, None), views, progress=lambda *step: seen.append(step[:2]))
    assert np.array_equal(found.positions[:len(positions)], positions) and len(found.faces) >= len(faces)
    assert np.abs(found.colours[:len(positions)] - colours).mean() < 0.05 and found.psnr.mean() > 25.0
    assert seen == [(step, 60) for step in range(1, 61)]


class Bar:
    """A bar as tqdm's is."""

    total, n = None, 0

    def update(self, n=1):
        self.n += n


def test_progress_may_be_a_bar_as_of_tqdm():
    bar = Bar()
    softrast.fit_mesh(ball_views(), steps=5, size=32, progress=bar)
    assert (bar.n, bar.total) == (5, 5)


def test_a_progress_that_interrupts_leaves_what_there_is():
    def stop(step, steps, loss):
        if step == 3:
            raise KeyboardInterrupt

    views, mesh = ball_views(), ball()
    found = softrast.fit_mesh(views, steps=10_000, size=32, progress=stop)
    assert not found.complete and len(found.faces) > 10 and found.iou.mean() > 0.5
    painted = softrast.paint(mesh, views, steps=10_000, size=32, progress=stop)
    assert not painted.complete and painted.colours.shape == painted.positions.shape


def test_an_error_of_the_progress_is_raised():
    def fail(step, steps, loss):
        raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        softrast.fit_mesh(ball_views(), steps=10_000, size=32, progress=fail)


def test_ctrl_c_ends_a_fit_within_a_second_and_keeps_the_mesh():
    script = f"""
import signal, sys, softrast
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background is started with it ignored
views = softrast.load_views({str(FOX)!r}, pictures=False)
found = softrast.fit_mesh(views, steps=100_000, progress=lambda step, *_: step == 5 and print("ready", flush=True))
sys.exit(7 if not found.complete and found.iou.mean() > 0.8 else 1)
"""
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    start = time.perf_counter()
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == 7
    assert time.perf_counter() - start < 1.5, "a second, and the score"


def one(**changed):
    views = ball_views()
    return softrast.Views(**{**{name: getattr(views, name) for name in ("masks", "K", "R", "t", "pictures", "names")}, **changed})


@pytest.mark.parametrize("call, message", [
    (lambda: softrast.load_views("nowhere"), "nowhere"),
    (lambda: softrast.load_views(FOX, masks="nowhere"), "no mask in nowhere has its name"),
    (lambda: softrast.load_views(FOX, normals="nowhere"), "no picture in nowhere has the name of"),
    (lambda: one(masks=[]), "views need a mask"),
    (lambda: one(masks=[np.zeros((2, 2, 2))] * 6), r"mask must be \[height, width\] of bool or float"),
    (lambda: one(R=np.eye(3)), r"K, R and t must be \[6, 3, 3\], \[6, 3, 3\] and \[6, 3\]"),
    (lambda: one(K=np.array([[50.0, 1.0, 0.0], [0.0, 50.0, 0.0], [0.0, 0.0, 1.0]])), "without skew"),
    (lambda: one(pictures=[np.zeros((40, 48, 3))]), "pictures must be one for each of the 6 masks, found 1"),
    (lambda: one(pictures=np.zeros((6, 40, 40, 3))), r"pictures must be \[40, 48, 3\] or \[40, 48, 4\]"),
    (lambda: one(pictures=np.full((6, 40, 48, 3), 2.0)), r"pictures must be in \[0, 1\]"),
    (lambda: one(names=["a"]), "names must be one for each"),
    (lambda: softrast.fit_mesh(one()[0]), "two views or more"),
    (lambda: softrast.fit_mesh(one(pictures=None), colours=True), "needs views with pictures"),
    (lambda: softrast.fit_mesh(one(), start="cube"), "start must be 'hull', 'sphere' or a mesh"),
    (lambda: softrast.fit_mesh(one(), size=7), "size must be a whole number from 8 on"),
    (lambda: softrast.fit_mesh(one(), max_faces=99), "max_faces must be a whole number from 100 on"),
    (lambda: softrast.fit_mesh(one(), smoothing=6.0), "smoothing is 6, expected more than 0"),
    (lambda: softrast.fit_mesh(one(), progress=3), "progress must be a function or a bar"),
    (lambda: softrast.fit_mesh(one(masks=np.zeros((6, 40, 48)))), "mask"),
    (lambda: softrast.paint(ball(), one(pictures=None)), "paint needs views with pictures"),
    (lambda: softrast.paint(ball(), one(), learning_rate=0.0), "learning_rate must be more than 0"),
    (lambda: softrast.fit_mesh(one(), steps=2, size=8).psnr, "psnr needs a mesh with colours"),
])
def test_bad_input_is_an_error_of_one_line(call, message):
    with pytest.raises(ValueError, match=message) as error:
        call()
    assert "\n" not in str(error.value)
