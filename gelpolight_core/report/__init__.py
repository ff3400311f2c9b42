"""The calibration report: one document, written as HTML or PDF."""
