"""The set-up of a closed sensor: kind, scale and ball radius."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from app.calibrate.form_page import USUAL_RADIUS_MM, FormPage, Values
from app.widgets.fields import choice, number
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from gelpolight_core.in_place.preset import Preset, presets
from gelpolight_core.session.session import InPlace, SensorData, Session
from gelpolight_core.translation import tr

OTHER = "other"
USUAL_SD = 0.01
PRESETS = {preset.key: preset for preset in presets()}
USUAL = PRESETS["gelsight-mini"]


@dataclass(frozen=True)
class ClosedValues(Values):
    """What is known about a sensor that cannot be opened."""

    preset: str = choice(
        USUAL.key,
        tr("Kind of sensor"),
        {k: p.name for k, p in PRESETS.items()} | {OTHER: tr("Other")},
    )
    scale: float = number(
        0.06,
        tr("Size of a pixel"),
        0.0001,
        10.0,
        tr(" mm"),
        5,
        step=0.0001,
        tip=tr(
            "A scale that is 1 % wrong makes every size 1 % wrong. Measure it with an object of "
            "known size"
        ),
    )
    scale_sd: float = number(1.0, tr("Uncertainty"), 0.0, 50.0, tr(" %"), 1)


def new_closed_session() -> Session:
    """Return the default description of a new session of a closed sensor, without a folder."""
    scale = InPlace((USUAL.mm_per_px, USUAL.mm_per_px), USUAL.mm_per_px_sd)
    sensor = SensorData("")
    return Session(Path(), sensor, ball_default_radius_mm=USUAL_RADIUS_MM, in_place=scale)


class ClosedForm(FormPage):
    """The form with the data of a sensor that cannot be opened."""

    def __init__(self) -> None:
        self.facts = named(PlainLabel(wrap=True), "setup.facts", tr("About this kind of sensor"))
        self.measured = PlainLabel(tr("Measured on the images in scale/."), wrap=True)
        super().__init__(
            tr("Closed sensor"),
            tr(
                "The sensor is calibrated from one image of the untouched membrane and some "
                "presses of a ball of known diameter. Use the same image size, crop and exposure "
                "for all images."
            ),
            new_closed_session(),
            ClosedValues(),
        )
        self.first = self.values.inputs["preset"]
        self.values.rows.insertRow(3, "", self.facts)
        self.values.rows.addRow("", self.measured)
        self.values.changed.connect(self._on_changed)

    def values_of(self, session: Session) -> ClosedValues:
        """Return the values of a session, and show what is known about its kind of sensor."""
        in_place = session.in_place or InPlace()
        stated = in_place.mm_per_px is not None
        scale, sd = (in_place.mm_per_px or (ClosedValues().scale,))[0], in_place.mm_per_px_sd
        for name in ("scale", "scale_sd", "preset"):
            self.values.inputs[name].setEnabled(stated)
        self.measured.setVisible(not stated)
        kind = next((p.key for p in PRESETS.values() if _is_of(p, in_place)), OTHER)
        self.facts.setText(_facts(kind))
        percent = 100.0 * (USUAL_SD if sd is None else sd / scale)
        return ClosedValues(session.serial, session.elastomer, kind, scale, percent)

    def _on_changed(self, name: str, value: object) -> None:
        if name == "preset":
            self.facts.setText(_facts(str(value)))
            preset = PRESETS.get(str(value))
            if preset is not None:
                percent = 100.0 * preset.mm_per_px_sd / preset.mm_per_px
                self.values.change(scale=preset.mm_per_px, scale_sd=percent)

    def session_of(self, values: ClosedValues) -> Session:
        """Return the session with this scale, if it is stated."""
        in_place = self.session.in_place
        if in_place.mm_per_px is not None:
            sd = 0.01 * values.scale_sd * values.scale
            stated = values.scale, values.scale
            in_place = replace(in_place, mm_per_px=stated, mm_per_px_sd=sd)
        return replace(self.session, sensor=SensorData(values.serial), in_place=in_place)


def _is_of(preset: Preset, stated: InPlace) -> bool:
    return stated.mm_per_px is not None and abs(stated.mm_per_px[0] - preset.mm_per_px) < 5e-6


def _facts(kind: str) -> str:
    """Return the images that a preset is made for, as sentences."""
    if kind == OTHER:
        return tr("State the size of a pixel on the membrane: image an object of known size.")
    preset = PRESETS[kind]
    text = tr("For images of {w} x {h} pixels").format(w=preset.image_px[0], h=preset.image_px[1])
    if any(preset.cropped):
        text += tr(", with {c:.0f} % of the camera image cut off on each side").format(
            c=100.0 * max(preset.cropped)
        )
    area = tr("The visible membrane is {a:g} x {b:g} mm.").format(
        a=preset.working_area_mm[0], b=preset.working_area_mm[1]
    )
    markers = ""
    if any(preset.marker_pitches_mm):
        markers = tr(" Printed markers are found and left out.")
    limits = f" {preset.limits}." if preset.limits else ""
    return f"{text}. {area}{markers}{limits}"
