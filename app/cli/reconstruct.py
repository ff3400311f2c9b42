"""``gelpolight reconstruct``, ``profile`` and ``benchmark``: depth maps of images."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
from tqdm import tqdm

from gelpolight_core.base.atomic_write import make_folder, write_json
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.measurement.profile import take_profile
from gelpolight_core.output.formats import HEIGHT_MAP_FORMATS, PROFILE_FORMATS
from gelpolight_core.output.heightmap_files import write_heightmap, write_profile
from gelpolight_core.output.recording.calibration_match import recording_notes, require_match
from gelpolight_core.reconstruction.benchmark import benchmark_frame
from gelpolight_core.session.session_images import read_colours

from .inputs import open_inputs
from .options import Command, option, output, positional, refuse_overwriting, result_option
from .parser import MENDABLE
from .reconstructing import (
    despite_faults,
    effort,
    formats,
    load_reconstructor,
    model,
    read_frame,
    trace_lines,
)
from .terminal import print_safe


@dataclass(frozen=True)
class ReconstructCommand(Command):
    """Images and recordings become height maps."""

    calibration: Path = positional("CALIBRATION")
    images: list[Path] = positional("IMAGE", "images and recordings")
    output: Path = output("OUT", writes=False)
    format: tuple[str, ...] = formats()
    uncertainty: bool = option(
        "also compute standard deviations, in npz; takes several times as long"
    )
    frames: str = option(
        "every N-th frame of a recording from A, counted from 0, up to but not including B",
        default="",
        metavar="A:B:N",
    )
    explain: bool = option("show the steps of each image, and why steps were skipped")
    despite_faults: bool = despite_faults()
    effort: str = effort()
    model: str | None = model()

    def run(self) -> int:
        """Reconstruct every image and write its files."""
        if self.uncertainty and "npz" not in self.format:
            raise InputError(
                "Only npz can contain standard deviations", "--uncertainty", Remedy.REMOVE_OPTION
            )
        suffixes = [HEIGHT_MAP_FORMATS[key].suffix for key in self.format]
        with ExitStack() as opened:
            inputs, recordings = open_inputs(self.images, self.frames, opened)
            results = [self.output / f"{item.stem}{end}" for item in inputs for end in suffixes]
            refuse_overwriting(results, [self.calibration, *self.images])
            reconstructor = load_reconstructor(self.calibration, self.model, self.effort)
            for recording in recordings:
                require_match(recording, reconstructor.calibration)
                for note in recording_notes(recording):
                    print_safe(f"{recording.path}: {note}", file=sys.stderr)
            make_folder(self.output)
            refused, unread = 0, 0
            for item in tqdm(inputs, file=sys.stderr, unit="image"):
                try:
                    image = item.read(reconstructor.calibration.response)
                    rgb = image.rgb
                    health = reconstructor.health(rgb, name=item.name, loss=image.loss)
                except InputError as error:
                    if len(inputs) == 1:
                        raise
                    unread += 1
                    print_safe(f"gelpolight: {error}", file=sys.stderr)
                    continue
                fault = health.meaningless
                if fault is not None and not self.despite_faults:
                    refused += 1
                    print_safe(f"gelpolight: {item.where}: {fault.line}", file=sys.stderr)
                    continue
                heightmap = reconstructor.depth(
                    rgb, name=item.name, uncertainty=self.uncertainty, health=health
                )
                write_heightmap(heightmap, self.output, formats=self.format)
                if self.explain and heightmap.trace is not None:
                    tqdm.write("\n".join([f"{item.where}:", *trace_lines(heightmap.trace)]))
                for finding in heightmap.findings:
                    tqdm.write(f"{item.where}: {finding.line}", file=sys.stderr)
        saved = len(inputs) - refused - unread
        print_safe(f"{saved} depth maps saved to {self.output}")
        again = "were refused. Add --despite-faults to use them anyway."
        for count, text in ((unread, "cannot be used, as said above."), (refused, again)):
            if count:
                print_safe(f"gelpolight: {count} images {text}", file=sys.stderr)
        return MENDABLE if refused or unread else 0


_end = partial(option, "an end of the line, in mm", metavar=("X", "Y"))


@dataclass(frozen=True)
class ProfileCommand(Command):
    """The depth along a line, as a table."""

    calibration: Path = positional("CALIBRATION")
    image: Path = positional("IMAGE")
    start: tuple[float, float] = _end("--from")
    end: tuple[float, float] = _end("--to")
    width: float = option("average over this width", default=0.0, metavar="MM")
    output: Path = output(" | ".join(f"FILE{f.suffix}" for f in PROFILE_FORMATS.values()))
    model: str | None = model()

    def run(self) -> None:
        """Reconstruct the image and write its section along the line."""
        reconstructor = load_reconstructor(self.calibration, self.model)
        frame = read_frame(self.image, reconstructor)
        heightmap = reconstructor.depth(
            frame, name=self.image.name, normals=False, uncertainty=True
        )
        profile = take_profile(heightmap, self.start, self.end, width_mm=self.width)
        write_profile(profile, self.output)
        print_safe(
            f"{profile.along_mm.size} points over "
            f"{profile.along_mm[-1]:.3f} mm saved to {self.output}"
        )


@dataclass(frozen=True)
class BenchmarkCommand(Command):
    """The time of each processing step of a frame."""

    calibration: Path = positional("CALIBRATION")
    image: Path = positional("IMAGE")
    json: Path | None = result_option()
    repeats: int = option(default=25, metavar="N")
    effort: str = effort()
    model: str | None = model()

    def run(self) -> None:
        """Time the frame and print a table."""
        reconstructor = load_reconstructor(self.calibration, self.model, self.effort)
        image = read_colours(self.image)
        frame = np.round(image.rgb * (2**image.bit_depth - 1)).astype(f"u{image.bit_depth // 8}")
        timing = benchmark_frame(reconstructor, frame, repeats=max(self.repeats, 1))
        step, median, p95, size = "step", "median ms", "p95 ms", "MB"
        print_safe(f"{step:<26}{median:>12}{p95:>10}{size:>8}")
        for row in (*timing.steps, timing.total):
            print_safe(
                f"{row.name:<26}{row.median_ms:12.2f}{row.p95_ms:10.2f}{row.bytes / 1e6:8.1f}"
            )
        copy = "memory copy"
        print_safe(f"{copy:<26}{timing.copy_floor_ms:12.2f}")
        floor = timing.total.median_ms / timing.copy_floor_ms
        print_safe(f"{floor:.1f} times a memory copy")
        print_safe("\n".join(trace_lines(timing.trace)))
        if self.json:
            content = {
                "total_ms": {"median": timing.total.median_ms, "p95": timing.total.p95_ms},
                "copy_floor_ms": timing.copy_floor_ms,
                "steps": [asdict(row) for row in timing.steps],
                "threads": timing.threads,
                "model": reconstructor.model,
                "effort": reconstructor.effort,
                "plan": timing.trace.as_dicts(),
                "versions": timing.versions,
            }
            write_json(self.json, content)
