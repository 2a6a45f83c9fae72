"""Prints the version, what draws, and which frameworks are there: `python -m softrast`."""

from importlib.metadata import PackageNotFoundError, version

import softrast

from . import _native


def _installed(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def main() -> None:
    print(f"softrast {softrast.__version__}")
    print("backend: CPU")
    print(f"threads: {_native.threads()} (RAYON_NUM_THREADS sets them)")
    for name in ("numpy", "torch", "jax"):
        print(f"{name}: {_installed(name)}")


if __name__ == "__main__":
    main()
