"""The set-up of a closed sensor: kind, scale and ball radius."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from PySide6.QtWidgets import QFormLayout, QGroupBox, QWidget

from app.calibrate.form_page import FormPage, length_box
from app.widgets.inputs import ComboBox, DoubleSpinBox
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.naming import named
from gelpolight_core.in_place.preset import Preset, preset_named, presets
from gelpolight_core.session.closed import ClosedSession
from gelpolight_core.translation import tr

OTHER = "other"
USUAL_RADIUS_MM = 3.0
USUAL_SD, USUAL_SCALE = 0.01, 0.06
USUAL_KIND = "gelsight-mini"


def new_closed_session() -> ClosedSession:
    """Return the default description of a new session of a closed sensor, without a folder."""
    kind = preset_named(USUAL_KIND)
    return ClosedSession(
        Path(), "", kind.mm_per_px, kind.mm_per_px_sd, ball_default_radius_mm=USUAL_RADIUS_MM
    )


class ClosedForm(FormPage):
    """The form with the data of a sensor that cannot be opened."""

    def __init__(self) -> None:
        self._session = new_closed_session()
        self._presets = {preset.key: preset for preset in presets()}
        super().__init__(
            tr("Closed sensor"),
            tr(
                "The sensor is calibrated from one image of the untouched membrane and some "
                "presses of a ball of known diameter. Use the same image size, crop and exposure "
                "for all images."
            ),
        )
        self.first = self.kind
        self.show_session(self._session, new=True)

    def groups(self) -> tuple[QWidget, ...]:
        """Create the groups of the form."""
        box = QGroupBox(tr("Sensor"))
        form = QFormLayout(box)
        self.kind = named(ComboBox(), "setup.preset", tr("Kind of sensor"))
        for preset in self._presets.values():
            self.kind.addItem(preset.name, preset.key)
        self.kind.addItem(tr("Other"), OTHER)
        self.kind.activated.connect(self._on_kind)
        self.facts = named(PlainLabel(), "setup.facts", tr("About this kind of sensor"))
        self.facts.setWordWrap(True)
        self.scale = named(
            DoubleSpinBox(), "setup.scale", tr("Size of a pixel on the membrane in mm")
        )
        self.scale.setDecimals(5)
        self.scale.setRange(0.0001, 10.0)
        self.scale.setSingleStep(0.0001)
        self.scale.setSuffix(tr(" mm"))
        self.scale.setToolTip(
            plain_tip(
                tr(
                    "A scale that is 1 % wrong makes every size 1 % wrong. Measure it with an "
                    "object of known size"
                )
            )
        )
        self.scale_sd = named(
            DoubleSpinBox(), "setup.scale_sd", tr("Uncertainty of the scale in percent")
        )
        self.scale_sd.setDecimals(1)
        self.scale_sd.setRange(0.0, 50.0)
        self.scale_sd.setSuffix(tr(" %"))
        self.measured = named(PlainLabel(), "setup.measured", tr("Where the scale comes from"))
        self.measured.setWordWrap(True)
        form.addRow(tr("Serial number"), self.serial)
        form.addRow(tr("Elastomer"), self.elastomer)
        form.addRow(tr("Kind of sensor"), self.kind)
        form.addRow("", self.facts)
        form.addRow(tr("Size of a pixel"), self.scale)
        form.addRow(tr("Uncertainty"), self.scale_sd)
        form.addRow("", self.measured)
        balls = QGroupBox(tr("Balls"))
        rows = QFormLayout(balls)
        self.ball = length_box("setup.ball", tr("Default ball diameter"), 0.1, 1000.0)
        self.ball.setToolTip(tr("Diameter measured with a calliper; each press can have its own"))
        rows.addRow(tr("Default diameter"), self.ball)
        return box, balls

    def fill(self, session: ClosedSession) -> None:
        """Show the values of a session."""
        self._session = session
        stated = session.mm_per_px is not None
        scale, sd = session.mm_per_px or USUAL_SCALE, session.mm_per_px_sd
        self.serial.setText(session.serial)
        self.elastomer.setText(session.elastomer)
        self.scale.setValue(scale)
        self.scale_sd.setValue(100.0 * (USUAL_SD if sd is None else sd / scale))
        for widget in (self.scale, self.scale_sd, self.kind):
            widget.setEnabled(stated)
        self.measured.setText("" if stated else tr("Measured on the images in scale/."))
        self.measured.setVisible(not stated)
        self.ball.setValue(2.0 * (session.ball_default_radius_mm or USUAL_RADIUS_MM))
        self._show_kind(next((p for p in self._presets.values() if _is_of(p, session)), None))

    def _on_kind(self) -> None:
        preset = self._presets.get(self.kind.currentData())
        if preset is not None:
            self.scale.setValue(preset.mm_per_px)
            self.scale_sd.setValue(100.0 * preset.mm_per_px_sd / preset.mm_per_px)
        self._show_kind(preset)

    def _show_kind(self, preset: Preset | None) -> None:
        self.kind.setCurrentIndex(self.kind.findData(OTHER if preset is None else preset.key))
        self.facts.setText(
            tr("State the size of a pixel on the membrane: image an object of known size.")
            if preset is None
            else _facts(preset)
        )

    def stated(self) -> ClosedSession:
        """Return the session with the values of the form."""
        session, scale = self._session, self.scale.value()
        if session.mm_per_px is not None:
            sd = 0.01 * self.scale_sd.value() * scale
            session = replace(session, mm_per_px=scale, mm_per_px_sd=sd)
        return replace(
            session,
            serial=self.serial.text().strip(),
            ball_default_radius_mm=0.5 * self.ball.value(),
            elastomer=self.elastomer.text().strip(),
        )


def _is_of(preset: Preset, session: ClosedSession) -> bool:
    return session.mm_per_px is not None and abs(session.mm_per_px - preset.mm_per_px) < 5e-6


def _facts(preset: Preset) -> str:
    """Return the images that a preset is made for, as sentences."""
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
