"""A compiled step of an optimisation in JAX, float32: projection, silhouette, mean squared difference, gradient to the vertices.

`python bindings/python/benches/jax_step.py [DIR]`, in an environment with the wheel and JAX. DIR holds another `softrast` (`pip install --target DIR`),
which is timed in turn with ours, so that both have the same neighbours on the machine.
"""

import os
import subprocess
import sys
import time

import numpy as np

# Name: mesh, pixels a side, views, steps of a median.
CASES = {"fox, 64 px": ("fox", 64, 1, 200), "fox, 64 px, 24 views": ("fox", 64, 24, 20), "5,120 faces, 256 px": ("sphere", 256, 1, 50)}
ROUNDS = 7


def step_of(mesh, size, views):
    import jax

    import softrast
    import softrast.jax as sj

    positions, faces, _ = softrast.fox() if mesh == "fox" else softrast.icosphere(4)
    renderer = softrast.Renderer(faces, size, softrast.Softness("logistic", 0.01))
    cameras = softrast.orbit(2.7, 20.0, 15.0 * np.arange(views)).astype("f4")
    target = np.zeros((views, size, size), "f4")
    loss = lambda vertices: sj.mse_loss(sj.silhouette(renderer, sj.project(vertices, cameras)), target).mean()
    step, vertices = jax.jit(jax.value_and_grad(loss)), jax.numpy.asarray(positions, "float32")
    return lambda: jax.block_until_ready(step(vertices))


def answer():
    """Prints the median of a case in milliseconds for each line that names one."""
    steps = {}
    for line in sys.stdin:
        *case, repetitions = CASES[line.strip()]
        if line not in steps:
            steps[line] = step_of(*case)
            for _ in range(repetitions // 4):
                steps[line]()
        times = []
        for _ in range(repetitions):
            start = time.perf_counter()
            steps[line]()
            times.append(time.perf_counter() - start)
        print(1e3 * np.median(times), flush=True)


def started(folder):
    environment = os.environ if folder is None else {**os.environ, "PYTHONPATH": folder}
    pipe = subprocess.PIPE
    return subprocess.Popen([sys.executable, __file__, "--answer"], stdin=pipe, stdout=pipe, text=True, env=environment)


def compare(folders):
    workers = [started(folder) for folder in folders]
    for case in CASES:
        rounds = []
        for _ in range(ROUNDS):
            rounds.append([])
            for worker in workers:
                worker.stdin.write(case + "\n")
                worker.stdin.flush()
                rounds[-1].append(float(worker.stdout.readline()))
        medians = np.median(rounds, 0)
        line = f"{case}: {medians[0]:.2f} ms"
        if len(folders) > 1:
            ratios = " ".join(f"{ours / other:.2f}" for ours, other in rounds)
            line += f"; {folders[1]}: {medians[1]:.2f} ms; ratio {np.median([ours / other for ours, other in rounds]):.2f}, round by round: {ratios}"
        print(line, flush=True)
    for worker in workers:
        worker.stdin.close()
        worker.wait()


if __name__ == "__main__":
    answer() if sys.argv[1:] == ["--answer"] else compare([None, *sys.argv[1:]])
