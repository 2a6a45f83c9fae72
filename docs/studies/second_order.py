"""Compares second derivatives in float32 with those in float64: `python docs/studies/second_order.py`, in an environment with the wheel and torch.

The Hessian of the mean square of an image of the fox (64 x 64 pixels, 12 views, a logistic) with respect to the vertices times a fixed random direction. An
error is the length of the difference over the length in float64. Prints medians and largest errors over the views, for silhouettes and colours.
"""

import numpy as np
import softrast
import softrast.torch as st
import torch

positions, faces, _ = softrast.fox()
random = torch.Generator().manual_seed(0)
direction = torch.randn(positions.shape, generator=random, dtype=torch.float64)
colours = torch.rand(positions.shape, generator=random, dtype=torch.float64)
print("| width | silhouettes: median | largest | colours: median | largest |\n|--:|--:|--:|--:|--:|")
for width in (0.003, 0.005, 0.01, 0.02, 0.03):
    softness = softrast.Softness("logistic", width)
    silhouettes, paints = softrast.Renderer(faces, 64, softness), softrast.ColourRenderer(faces, 64, softness, [2.0, 4.0])
    draws = (lambda seen: st.silhouette(silhouettes, seen), lambda seen: st.blend(paints, seen, colours.to(seen.dtype)))
    errors = []
    for azimuth in range(0, 360, 30):
        camera = st.orbit(3.0, 10.0, float(azimuth))
        for draw in draws:
            products = []
            for dtype in (torch.float64, torch.float32):
                vertices = torch.from_numpy(positions).to(dtype).requires_grad_()
                loss = draw(st.project(vertices, camera.to(dtype))).pow(2).mean()
                (gradient,) = torch.autograd.grad(loss, vertices, create_graph=True)
                products.append(torch.autograd.grad((gradient * direction.to(dtype)).sum(), vertices)[0].double())
            errors.append(((products[1] - products[0]).norm() / products[0].norm()).item())
    cells = [f"{of(errors[k::2]):.0e}" for k in (0, 1) for of in (np.median, np.max)]
    print(f"| {width} | {' | '.join(cells)} |")
