"""The context of a page: settings, source, calibration library and messages."""
