"""Softnesses that are learned."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import softrast

WIDE = softrast.Softness("logistic", 0.1)
SMALL = {"size": 16, "steps": 6, "batch": 2}


def test_learning_lowers_the_error_on_runs_that_it_does_not_see(tmp_path):
    seen = []
    learned = softrast.learn_softness(
        softrast.icosphere(0), WIDE, size=16, steps=30, batch=4, updates=6, learning_rate=0.3, progress=lambda *step: seen.append(step))
    assert learned.complete and len(learned.errors) == 7 and min(learned.errors) < 0.8 * learned.errors[0]
    assert not np.allclose(learned.softness.phi_at(0.5), WIDE.phi_at(0.5))
    steps = [step for step, _, _ in seen]
    assert steps == sorted(steps) and steps[-1] == 6 and all(count == 6 for _, count, _ in seen)
    learned.save(tmp_path / "softness.json")
    assert np.array_equal(softrast.Softness.load(tmp_path / "softness.json").phi_at(0.5), learned.softness.phi_at(0.5))


def test_an_interrupt_keeps_the_best_softness_so_far():
    def stop(step, updates, error):
        if step == 2:
            raise KeyboardInterrupt

    learned = softrast.learn_softness(softrast.icosphere(1), WIDE, **SMALL, updates=10_000, progress=stop)
    assert not learned.complete and learned.softness.family == "logistic" and len(learned.errors) == 1


def test_ctrl_c_ends_learning_within_a_second():
    script = """
import signal, sys, softrast
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background is started with it ignored
show = lambda step, *_: step == 1 and print("ready", flush=True)
learned = softrast.learn_softness(softrast.fox(), softrast.Softness("logistic", 0.1), updates=1000, size=16, steps=40, progress=show)
sys.exit(1 if learned.complete else 7)
"""
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    start = time.perf_counter()
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == 7
    assert time.perf_counter() - start < 1.0


@pytest.mark.parametrize("call, message", [
    (lambda: softrast.learn_softness(softrast.fox(), "logistic"), "softness must be a softrast.Softness"),
    (lambda: softrast.learn_softness(softrast.fox(), WIDE, size=2), "size must be a whole number from 8 on"),
    (lambda: softrast.learn_softness(softrast.fox(), WIDE, batch=0), "batch must be a whole number from 1 on"),
    (lambda: softrast.learn_softness(softrast.fox(), WIDE, learning_rate=-1.0), "learning_rate must be more than 0"),
    (lambda: softrast.learn_softness(([[0.0, 0.0]], [[0, 0, 0]], None), WIDE), r"positions must be \[N, 3\]"),
])
def test_bad_input_is_an_error_of_one_line(call, message):
    with pytest.raises(ValueError, match=message) as error:
        call()
    assert "\n" not in str(error.value)
