"""What a page is given: settings, source, calibration library and messages."""
