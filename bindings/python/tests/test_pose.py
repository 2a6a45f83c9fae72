"""Poses from masks."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import softrast

VIEWS = Path(__file__).parents[3] / "data/views/fox"


def scene(name="images/03.png"):
    """The mask, K, and the true R and t of a view of the fox."""
    cameras = json.loads((VIEWS / "transforms.json").read_text())
    # Its principal point is from the corner of the picture.
    K = np.array([[cameras["fl_x"], 0, cameras["cx"] - 0.5], [0, cameras["fl_y"], cameras["cy"] - 0.5], [0, 0, 1.0]])
    (frame,) = (frame for frame in cameras["frames"] if frame["file_path"] == name)
    world = np.linalg.inv(np.array(frame["transform_matrix"]))
    flip = np.diag([1.0, -1.0, -1.0])
    return softrast.load_mask(VIEWS / name), K, flip @ world[:3, :3], flip @ world[:3, 3]


def degrees(a, b):
    return np.degrees(np.arccos(np.clip((np.trace(a @ b.T) - 1) / 2, -1, 1)))


@pytest.fixture(scope="module")
def found():
    mask, K, _, _ = scene()
    seen = []
    return softrast.find_pose(softrast.fox(), mask, K, progress=lambda *step: seen.append(step)), seen


def test_the_pose_of_a_mask_is_found_from_nothing(found):
    found, seen = found
    mask, _, R, t = scene()
    assert degrees(found.R, R) < 1.0 and np.linalg.norm(found.t - t) < 0.02 * np.linalg.norm(t)
    steps = [step for step, _, _ in seen]
    assert steps[0] == 1 and steps == sorted(steps) and steps[-1] <= seen[0][1] and len({count for _, count, _ in seen}) == 1
    # The overlap that it reports is that of the image by its camera.
    positions, faces, _ = softrast.fox()
    image = softrast.hard_silhouette(softrast.project(positions, found.cameras[:1]), faces, mask.shape)[0] > 0.5
    inside = mask >= 0.5
    assert found.iou == pytest.approx((image & inside).sum() / (image | inside).sum(), abs=2e-3) and found.iou > 0.95
    assert all(found.iou - 0.03 <= other.iou and degrees(found.R, other.R) > 5.9 for other in found.alternatives)


def test_a_pose_is_saved_as_json(found, tmp_path):
    found, _ = found
    found.save(tmp_path / "pose.json")
    saved = json.loads((tmp_path / "pose.json").read_text())
    assert np.array_equal(saved["poses"][0]["R"], found.R) and np.array_equal(saved["poses"][0]["t"], found.t)
    assert np.array_equal(saved["K"], found.K) and saved["size"] == list(found.size) and len(saved["poses"]) == 1 + len(found.alternatives)


def test_a_search_from_a_start_ends_there():
    mask, K, R, t = scene()
    turn = np.array([[np.cos(0.1), -np.sin(0.1), 0.0], [np.sin(0.1), np.cos(0.1), 0.0], [0.0, 0.0, 1.0]])
    found = softrast.find_pose(softrast.fox(), mask >= 0.5, K, start=(turn @ R, 1.05 * t))
    assert degrees(found.R, R) < 1.0 and np.linalg.norm(found.t - t) < 0.02 * np.linalg.norm(t)


def test_an_error_of_the_progress_ends_the_search_and_is_raised():
    mask, K, _, _ = scene()
    steps = []

    def progress(step, count, loss):
        steps.append(step)
        if step == 3:
            raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        softrast.find_pose(softrast.fox(), mask, K, progress=progress)
    assert steps == [1, 2, 3]


def ended(progress, ready):
    """How a search in another process ends after Ctrl-C: its exit code and the seconds that it took."""
    script = f"""
import signal, sys, numpy as np, softrast
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background is started with it ignored
mask = softrast.load_mask({str(VIEWS / "images/03.png")!r})
K = np.array([[130.0, 0, 62], [0, 131.0, 42.5], [0, 0, 1]])
{ready}
try:
    found = softrast.find_pose(mesh, mask, K, progress={progress})
except KeyboardInterrupt:
    sys.exit(7)
sys.exit(1 if found.complete or found.iou < 0.3 or found.alternatives else 8)
"""
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    time.sleep(0.2)
    start = time.perf_counter()
    process.send_signal(signal.SIGINT)
    return process.wait(timeout=60), time.perf_counter() - start


def test_ctrl_c_before_the_first_step_ends_a_search():
    # The preparation of this mesh, before its first step, takes seconds.
    code, seconds = ended("None", "mesh = softrast.icosphere(8); print('ready', flush=True)")
    assert code == 7 and seconds < 1.0


def test_ctrl_c_keeps_the_best_pose_so_far():
    code, seconds = ended("lambda step, *_: step == 20 and print('ready', flush=True)", "mesh = softrast.fox()")
    assert code == 8 and seconds < 1.0


def test_an_interrupted_search_has_the_best_pose_so_far():
    mask, K, R, _ = scene()

    def stop(step, count, loss):
        if step == 70:
            raise KeyboardInterrupt

    found = softrast.find_pose(softrast.fox(), mask, K, progress=stop)
    assert not found.complete and found.iou > 0.8 and found.alternatives == ()


@pytest.mark.parametrize("call, message", [
    (lambda mask, K: softrast.find_pose(softrast.fox(), mask[0], K), r"mask must be \[height, width\] of bool or float"),
    (lambda mask, K: softrast.find_pose(softrast.fox(), (255 * mask).astype("u1"), K), r"bool or float in \[0, 1\], found uint8"),
    (lambda mask, K: softrast.find_pose(softrast.fox(), 2 * mask, K), r"mask must be in \[0, 1\]"),
    (lambda mask, K: softrast.find_pose(softrast.fox(), 0 * mask, K), "mask"),
    (lambda mask, K: softrast.find_pose(softrast.fox(), mask, -K), "the focal lengths are -130"),
    (lambda mask, K: softrast.find_pose(softrast.fox(), mask, np.eye(2)), r"K must be \[3, 3\]"),
    (lambda mask, K: softrast.find_pose(softrast.fox(), mask, K, start=(np.eye(3), np.array([0, 0, -3.0]))), "the start is inside the mesh, or has it behind"),
    (lambda mask, K: softrast.find_pose(softrast.fox(), mask, K, start=(np.eye(3), np.eye(3))), r"start must be R \[3, 3\] and t \[3\]"),
    (lambda mask, K: softrast.load_mask("missing.png"), "missing.png"),
])
def test_bad_input_is_an_error_of_one_line(call, message):
    mask, K, _, _ = scene()
    with pytest.raises(ValueError, match=message) as error:
        call(mask, K)
    assert "\n" not in str(error.value)
