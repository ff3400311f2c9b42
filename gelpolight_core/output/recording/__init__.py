"""Recordings: raw lossless frames of a source, with their times, in one file."""
