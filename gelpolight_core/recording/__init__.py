"""Recordings: raw frames of a source, lossless, with their times, in one file."""
