"""Draws docs/guide/squared.svg, coverage by the distance from an edge: python3 docs/guide/squared.py"""

import math
import pathlib

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM, REACH = 720, 280, 50, 20, 20, 46, 0.05
CURVES = [
    ("squared, sigma 1e-4 (PyTorch3D)", "#1f6f8b", lambda d: d * abs(d) / 1e-4),
    ("squared, sigma 1e-5 (SoftRas)", "#7fb4c6", lambda d: d * abs(d) / 1e-5),
    ("plain distance, scale 0.005", "#b3541e", lambda d: d / 0.005),
]


def svg():
    x = lambda d: LEFT + (WIDTH - LEFT - RIGHT) * (d + REACH) / (2 * REACH)
    y = lambda coverage: TOP + (HEIGHT - TOP - BOTTOM) * (1 - coverage)
    yield f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="13"><rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>'
    for coverage, name in [(0, "0"), (0.5, "½"), (1, "1")]:
        yield f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(coverage):.1f}" y2="{y(coverage):.1f}" stroke="#ddd"/><text x="{LEFT - 8}" y="{y(coverage) + 4:.1f}" text-anchor="end">{name}</text>'
    for d in [-0.04, -0.02, 0, 0.02, 0.04]:
        yield f'<text x="{x(d):.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{d:g}</text>'
    yield f'<line x1="{x(0):.1f}" x2="{x(0):.1f}" y1="{y(0):.1f}" y2="{y(1):.1f}" stroke="#ddd"/>'
    yield f'<text x="{x(0):.1f}" y="{HEIGHT - 8}" text-anchor="middle">signed distance from the edge in NDC, inside on the right</text>'
    for place, (name, colour, argument) in enumerate(CURVES):
        points = " ".join(f"{x(d):.1f},{y(1 / (1 + math.exp(-max(-50, min(50, argument(d)))))):.1f}" for d in (REACH * (k / 150 - 1) for k in range(301)))
        yield f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2.5"/><text x="{LEFT + 10}" y="{TOP + 34 + 20 * place}" fill="{colour}">{name}</text>'
    yield "</svg>"


pathlib.Path(__file__).with_suffix(".svg").write_text("\n".join(svg()) + "\n", encoding="utf-8")
