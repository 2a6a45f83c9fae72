"""Progress of a long call: a function, or a bar such as that of tqdm."""

from __future__ import annotations

from typing import Any, Callable, Optional, Protocol, Union

Visit = Callable[[int, int, float], object]


class Bar(Protocol):
    """A bar as tqdm has it: `total` steps, of which `n` are done."""

    total: Any
    n: Any

    def update(self, n: Any = ...) -> Any: ...


Progress = Optional[Union[Visit, Bar]]


def visit(progress: Progress) -> Optional[Visit]:
    """A function that receives the number of a step, how many there are and the loss."""
    if progress is None or callable(progress):
        return progress
    bar = progress
    if not all(hasattr(bar, name) for name in ("total", "n", "update")):
        raise ValueError(f"progress must be a function or a bar of tqdm, found {type(bar).__name__}")

    def show(step: int, steps: int, loss: float) -> None:
        bar.total = steps
        bar.update(step - bar.n)

    return show
