"""The set-up compiles once for these sources, libraries and this processor."""

from collections.abc import Iterator
from pathlib import Path

from app import warm_up


def test_a_set_up_compiles_again_only_after_a_change(tmp_path, monkeypatch):
    def steps(_folder: Path) -> Iterator[str]:
        yield from map(str, range(warm_up.STEPS))

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    monkeypatch.setattr(warm_up, "_steps", steps)
    shown: list[tuple[int, int]] = []

    def compiled() -> bool:
        return warm_up.compile_loops(lambda _what, number, count: shown.append((number, count)))

    assert compiled() and shown[-1] == (warm_up.STEPS, warm_up.STEPS)
    assert not compiled()
    monkeypatch.setattr(warm_up.llvmlite.binding, "get_host_cpu_name", lambda: "another")
    assert compiled()
