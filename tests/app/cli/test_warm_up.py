"""The set-up prepares and compiles once for these sources, libraries and this processor."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from app.cli import warm_up


@pytest.mark.function("Set up again in a moment where nothing has changed")
def test_a_set_up_compiles_again_only_after_a_change(tmp_path, monkeypatch):
    done = []
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    monkeypatch.setattr(warm_up, "ProcessPoolExecutor", lambda *_: ThreadPoolExecutor(1))
    monkeypatch.setattr(warm_up, "prepare", lambda **_: tmp_path / "virtual-1.gplcal")
    monkeypatch.setattr(warm_up, "use_open_sensor", done.append)
    monkeypatch.setattr(warm_up, "use_closed_sensor", lambda: done.append("closed"))

    assert warm_up.compile_loops(str)
    assert set(done) == {tmp_path / "virtual-1.gplcal", "closed"}
    assert not warm_up.compile_loops(str) and len(done) == 2
    monkeypatch.setattr(warm_up.llvmlite.binding, "get_host_cpu_name", lambda: "another")
    assert warm_up.compile_loops(str) and len(done) == 4
