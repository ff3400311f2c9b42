"""Runs over many frames: nothing is lost or repeated, and any worker gives the same bits."""

import csv
import errno
import gc
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.file_lock import RunLock
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.lab.batch import batch_run as batch_run
from gelpolight_core.lab.batch import worker_pool
from gelpolight_core.lab.batch.batch_plan import BatchSettings, FrameJob
from gelpolight_core.lab.batch.batch_run import run_batch
from gelpolight_core.lab.batch.batch_table import TABLE, FrameRow
from gelpolight_core.lab.batch.frame_worker import reconstruct_job
from gelpolight_core.lab.batch.worker_pool import WorkerPool, dask_cluster, process_pool
from gelpolight_core.output.heightmap_files import write_heightmap
from gelpolight_core.output.recording.recording_reader import Recording
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session_images import read_linear_image
from tests.lab.batch.conftest import in_this_process


def results(out: Path) -> dict[str, bytes]:
    """Return the bytes of all results of a run."""
    files = [path for path in out.rglob("*") if path.suffix in (".npz", ".tif")]
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in files}


def table(out: Path) -> list[dict[str, str]]:
    with (out / TABLE).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


FRAMES = [f"day/run/run_{k:06d}" for k in range(4)]
IMAGES = ["day/left/a", "day/left/b"]


def test_every_frame_has_its_files_as_it_has_them_alone_and_its_row(go, settings, day, tmp_path):
    """As made by ``reconstruct``, to the last bit."""
    out = tmp_path / "out"
    assert go(day, out=out).done == 6
    assert sorted(results(out)) == sorted(
        f"{name}.{ending}" for name in FRAMES + IMAGES for ending in ("npz", "tif")
    )
    rows = table(out)
    assert [row["output"] for row in rows] == IMAGES + FRAMES
    assert [row["frame"] for row in rows[2:]] == ["0", "1", "2", "3"]
    assert [row["number"] for row in rows[2:]] == ["10", "11", "12", "13"]
    assert float(rows[3]["time_s"]) == pytest.approx(5.0 + 1 / 30)
    with np.load(out / "day/left/a.npz") as held:
        inside = (held["flags"] & 1) == 0
        depth_mm = held["depth_mm"][inside].astype(float)
        assert float(rows[0]["max_depth_mm"]) == depth_mm.max()
        volume_mm3 = depth_mm.sum() * float(held["pitch_mm"]) ** 2
        assert float(rows[0]["volume_mm3"]) == pytest.approx(volume_mm3)
        assert float(rows[0]["flagged_share"]) == np.mean(held["flags"][inside] != 0)
    calibration = read_calibration(settings.calibration)
    image = read_linear_image(day / "left" / "a.png", response=calibration.response)
    heightmap = Reconstructor(calibration, model="paper").depth(image.rgb, name="a.png")
    (alone,) = write_heightmap(heightmap, tmp_path / "alone", formats=["npz"])
    assert (out / "day" / "left" / "a.npz").read_bytes() == alone.read_bytes()


def test_a_run_whose_power_was_cut_goes_on(go, day, tmp_path):
    """Half a line of the table, and half a file, do not count."""
    out = tmp_path / "out"
    left = go(day, out=out, until=3)
    assert (left.done, left.left) == (3, 3)
    before = results(out)
    kept = (out / f"{FRAMES[0]}.npz").stat().st_mtime_ns
    text = (out / TABLE).read_bytes()
    (out / TABLE).write_bytes(text[: len(text) - 40])
    part = out / "day" / "run" / ".run_000000.npz.0123abcd.part"
    table_part = out / ".batch.csv.0123abcd.part"
    for each in (part, table_part):
        each.write_bytes(b"half")
    assert (go(day, out=out).before, len(table(out))) == (2, 6)
    assert not part.exists()
    assert not table_part.exists()
    assert {name: results(out)[name] for name in before} == before
    assert (out / f"{FRAMES[0]}.npz").stat().st_mtime_ns == kept
    assert go(day, out=out).before == 6


def test_a_result_that_was_removed_is_computed_again(go, day, tmp_path):
    out = tmp_path / "out"
    go(day, out=out)
    (out / f"{FRAMES[1]}.tif").unlink()
    assert go(day, out=out).done == 1


@pytest.mark.parametrize("content", [b"", b"output,input\nday/left/a,x\n", b"\0\xff\n" * 9])
def test_a_table_that_is_none_is_written_again(go, day, tmp_path, content):
    """Also that of an earlier version of the program."""
    out = tmp_path / "out"
    go(day / "left", out=out)
    (out / TABLE).write_bytes(content)
    assert go(day / "left", out=out).done == 2
    assert [row["output"] for row in table(out)] == ["left/a", "left/b"]


def test_another_image_of_the_same_name_is_another_frame(go, day, tmp_path):
    out = tmp_path / "out"
    go(day, out=out)
    image = day / "left" / "a.png"
    cv2.imwrite(str(image), np.roll(cv2.imread(str(image)), 5, axis=0))
    assert go(day, out=out).done == 1
    assert len(table(out)) == 6


def test_frames_that_cannot_be_used_are_noted_and_the_others_done(go, day, tmp_path):
    """A damaged image, another size, a file that is no recording; repaired, they are done."""
    out = tmp_path / "out"
    good = (day / "left" / "a.png").read_bytes()
    (day / "left" / "a.png").write_bytes(good[:-100])
    cv2.imwrite(str(day / "left" / "small.png"), cv2.imread(str(day / "left" / "b.png"))[:50])
    (day / "torn.gplrec").write_bytes(b"nothing")
    data = bytearray((day / "run.gplrec").read_bytes())
    data[-100] ^= 0xFF
    (day / "run.gplrec").write_bytes(data)
    progress = go(day, out=out)
    assert (progress.done, len(progress.faults)) == (4, 4)
    errors = {row["output"]: row["error"] for row in table(out) if row["error"]}
    assert "PNG image is not complete" in errors["day/left/a"]
    assert "the calibration is for" in errors["day/left/small"]
    assert "Frame 3 is damaged" in errors["day/run/run_000003"]
    assert "not a recording" in errors["day/torn/torn_000000"]
    (day / "left" / "a.png").write_bytes(good)
    again = go(day, out=out)
    assert (again.before, again.done, len(again.faults)) == (4, 1, 3)


def test_an_internal_error_costs_one_frame_and_is_recorded(go, day, tmp_path, monkeypatch):
    depth = Reconstructor.depth

    def faulty(self, frame, *, name="", **options):
        if name == "b.png":
            raise ValueError("a shape that nobody thought of")
        return depth(self, frame, name=name, **options)

    monkeypatch.setattr(Reconstructor, "depth", faulty)
    out = tmp_path / "out"
    progress = go(day, out=out)
    (fault,) = progress.faults
    assert (progress.done, fault.internal) == (5, True)
    assert table(out)[1]["error"] == "ValueError: a shape that nobody thought of"
    assert "Traceback" in fault.error


def test_a_full_disk_ends_the_run_and_says_how_far_it_came(go, day, tmp_path, monkeypatch):
    out = tmp_path / "out"
    replace_file = os.replace

    def full(source, target):
        if "run_000003.tif" in str(target):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        replace_file(source, target)

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(InputError, match=r"The disk is full; 3 of 6 frames are done") as reported:
        go(day, out=out)
    assert "Run the same command again" in str(reported.value)
    monkeypatch.undo()
    goes_on = go(day, out=out)
    assert (goes_on.before, goes_on.done) == (3, 3)


def test_results_of_two_calibrations_never_get_into_one_folder(plan, settings, day, tmp_path):
    out = tmp_path / "out"
    run = partial(run_batch, report=lambda _: None, stopped=lambda: False)
    run(plan(day, out=out), settings, out, in_this_process())
    before = results(out)
    with pytest.raises(InputError, match="has results of the calibration"):
        run(plan(day, out=out), replace(settings, calibration_id="B-1"), out, in_this_process())
    assert results(out) == before


@pytest.mark.parametrize("changed", [{"effort": "fast"}, {"measure": "ball"}])
def test_other_settings_compute_the_frames_again(plan, settings, go, day, tmp_path, changed):
    out = tmp_path / "out"
    go(day / "left", out=out)
    again = run_batch(
        plan(day / "left", out=out),
        replace(settings, **changed),
        out,
        in_this_process(),
        report=lambda _: None,
        stopped=lambda: False,
    )
    assert (again.before, again.done) == (0, 2)


def test_a_worker_of_another_version_is_refused(plan, settings, day, tmp_path):
    with pytest.raises(InputError, match=r"A worker has version .*, not 9\.9"):
        reconstruct_job(
            replace(settings, program="9.9"), tmp_path, plan(day, out=tmp_path / "out").jobs[0]
        )


def test_a_run_that_another_program_works_at_is_left_alone(go, day, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    with RunLock(out), pytest.raises(InputError, match="is being written by"):
        go(day, out=out)
    assert not results(out)


def ends_its_process(settings: BatchSettings, out: Path, job: FrameJob) -> FrameRow:
    """Work on a frame; one frame ends its process, and with it the work on the next one."""
    if job.name == "b.png":
        os.kill(os.getpid(), signal.SIGKILL)
    return reconstruct_job(settings, out, job)


def test_a_killed_process_costs_only_the_frame_that_kills_every_process(
    go, day, tmp_path, monkeypatch
):
    """All other frames have the same bits as in one process."""
    out, alone = tmp_path / "out", tmp_path / "alone"
    go(day, out=alone)
    monkeypatch.setattr(batch_run, "reconstruct_job", ends_its_process)
    progress = go(day, out=out, workers=process_pool(1))
    assert (progress.done, len(progress.faults)) == (5, 1)
    (error,) = [row["error"] for row in table(out) if row["error"]]
    assert "Several processes ended" in error
    expected = results(alone)
    assert results(out) == {name: expected[name] for name in expected if "left/b." not in name}
    assert len(table(out)) == 6
    assert not multiprocessing.active_children()


@pytest.mark.function("`gelpolight batch --scheduler`: on a Dask cluster")
def test_dask_gives_the_same_bits_and_survives_a_killed_worker(go, day, tmp_path):
    distributed = pytest.importorskip("distributed")
    out, alone = tmp_path / "out", tmp_path / "alone"
    go(day, out=alone)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=":0"
    ) as local:
        pids = [nanny.pid for nanny in local.workers.values()]

        def kill_one() -> None:
            if pids:
                os.kill(pids.pop(), signal.SIGKILL)
                pids.clear()

        progress = go(day, out=out, workers=dask_cluster(local.scheduler_address), after=kill_one)
    assert not pids
    assert (progress.done, len(progress.faults)) == (6, 0)
    assert results(out) == results(alone)


@pytest.mark.parametrize("address", ["nonsense", "foo://bar", "tcp://127.0.0.1:9"])
def test_an_address_without_a_scheduler_is_one_error(address, monkeypatch, capfd):
    """Nothing is printed beside the error, also later when memory is collected."""
    pytest.importorskip("distributed")
    monkeypatch.setattr(worker_pool, "ANSWER_S", 0.3)
    with pytest.raises(InputError) as refused, dask_cluster(address):
        pass
    assert refused.value.where == address
    del refused
    gc.collect()
    assert "Traceback" not in capfd.readouterr().err


def test_a_silent_server_is_no_scheduler(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(worker_pool, "ANSWER_S", 0.3)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(InputError, match="No Dask scheduler responds"), dask_cluster(address):
            pass


def test_a_cluster_without_workers_is_refused_after_a_time(go, day, tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(worker_pool, "EMPTY_S", 0.5)
    notes: list[str] = []
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=":0") as local,
        pytest.raises(InputError, match=r"no workers for .* 0 of 6 frames are done"),
    ):
        address = local.scheduler_address
        go(day, out=tmp_path / "out", workers=dask_cluster(address, notes.append))
    (note,) = notes  # once, while it waits
    assert address in note
    assert "0 workers" in note


def test_a_lost_scheduler_is_one_error_with_one_remedy(go, day, tmp_path, monkeypatch, capfd):
    pytest.importorskip("distributed")
    monkeypatch.setattr(worker_pool, "ANSWER_S", 60.0)  # the scheduler may be slow to start
    own = "from distributed.cli.dask_scheduler import main; main()"
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = [sys.executable, "-c", own, "--port", str(port), "--no-dashboard"]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as scheduler:
        try:
            with pytest.raises(InputError, match="scheduler was lost") as refused:
                killed = killed_once_open(dask_cluster(f"tcp://127.0.0.1:{port}"), scheduler)
                go(day, out=tmp_path / "out", workers=killed)
        finally:
            scheduler.kill()
    assert refused.value.advice.count("again") == 1
    assert "Traceback" not in capfd.readouterr().err


@contextmanager
def killed_once_open(
    workers: AbstractContextManager[WorkerPool], scheduler: subprocess.Popen[bytes]
) -> Iterator[WorkerPool]:
    """Yield the workers of a cluster whose scheduler ends as soon as it has a task."""
    with workers as opened:

        def start(*task: object) -> Future[object]:
            future: Future[object] = opened.start(*task)
            scheduler.kill()
            return future

        yield replace(opened, start=start)


def test_a_long_running_worker_detects_a_replaced_recording(settings, plan, go, day, tmp_path):
    """Workers of a cluster outlive a run: a half-copied recording is completed meanwhile."""
    out, path = tmp_path / "out", day / "run.gplrec"
    whole = path.read_bytes()
    with Recording.open(path) as recording:
        size = recording.frame(0).rgb.size
    path.write_bytes(whole[: len(whole) - size // 2])
    first = go(path, out=out)
    path.write_bytes(whole)
    again = go(path, out=out)
    assert first.done < 4
    assert (again.done + first.done, len(again.faults)) == (4, 0)
    (late,) = plan(path, out=out).jobs[3:]
    frames_of_before = replace(late, stamp="2026-11-22T08:00:00+00:00 3")
    row = reconstruct_job(settings, out, frames_of_before)
    assert "has changed since the run was started" in row.error
